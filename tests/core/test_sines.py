"""Compiled elementary functions against those of NumPy."""

from __future__ import annotations

import numpy as np

from robotrue.core.sines import arc_tangents, exponentials, sines
from robotrue.core.units import DEG


def test_sines_and_cosines() -> None:
    angle = np.random.default_rng(2).uniform(-700.0, 700.0, size=192)
    angle[:5] = 0.0, np.pi / 2, -np.pi, 1e-9, 3 * np.pi / 4
    out = np.zeros(384)
    sines(angle, 192, out)
    assert np.abs(out[:192] - np.sin(angle)).max() < 3e-16
    assert np.abs(out[192:] - np.cos(angle)).max() < 3e-16


def test_arc_tangents() -> None:
    rng = np.random.default_rng(4)
    angle = np.concatenate([rng.uniform(-np.pi, np.pi, 2000), np.arange(-180, 181, 22.5) * DEG])
    size = 10.0 ** rng.uniform(-5, 3, len(angle))
    n = len(angle)
    rows = np.concatenate([size * np.sin(angle), size * np.cos(angle), np.zeros(n)])
    arc_tangents(rows, 0, n, n, 2 * n)
    assert np.abs(rows[2 * n :] - np.arctan2(rows[:n], rows[n : 2 * n])).max() < 5e-16
    odd = np.array([0.0, np.nan, 1.0, np.inf, 0.0, 1.0, np.nan, 1.0, 7.0, 7.0, 7.0, 7.0])
    arc_tangents(odd, 0, 4, 4, 8)
    assert odd[8] == 0.0
    assert np.isnan(odd[9:]).all()


def test_exponentials() -> None:
    values = np.random.default_rng(6).uniform(-690.0, 1.0, size=1001)
    values[:3] = 0.0, -1e9, -1e-300
    expected = np.exp(np.maximum(values, -700.0))
    exponentials(values, np.empty_like(values))
    np.testing.assert_allclose(values, expected, rtol=1e-14, atol=0.0)
