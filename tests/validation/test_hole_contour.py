from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import MM, UM
from robotrue.errors import ShapeError
from robotrue.validation.hole_contour import evaluate_hole, fit_cylinder


def wall(centre, radius, *, slope=(0.0, 0.0), n=90):
    turn = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    levels = [0.0, -0.01, -0.03]
    return np.concatenate(
        [
            np.column_stack(
                [
                    centre[0] + slope[0] * z + radius * np.cos(turn),
                    centre[1] + slope[1] * z + radius * np.sin(turn),
                    np.full(n, z),
                ]
            )
            for z in levels
        ]
    )


def test_a_perfect_hole_has_no_error():
    result = evaluate_hole(wall((0.15, 0.15), 0.105), centre=np.array([0.15, 0.15]), radius=0.105)
    assert result.position < 1e-13
    assert np.abs(result.contour).max() < 1e-13
    assert np.abs(result.deviation).max() < 1e-13


def test_a_shifted_and_wide_hole_is_told_apart():
    points = wall((0.15 + 0.144 * MM, 0.15 - 0.298 * MM), 0.105 + 0.2 * MM)
    result = evaluate_hole(points, centre=np.array([0.15, 0.15]), radius=0.105)
    np.testing.assert_allclose(result.position_error / MM, [0.144, -0.298], atol=1e-9)
    assert result.position / MM == pytest.approx(0.331, abs=5e-4)  # Table 11
    np.testing.assert_allclose(result.contour / MM, 0.2, atol=1e-9)
    assert np.abs(result.form).max() < 1e-12


def test_an_oval_hole_has_the_form_of_its_oval():
    turn = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    radius = 0.105 + 0.05 * MM * np.cos(2.0 * turn)
    flat = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    points = np.concatenate([np.column_stack([flat, np.full(360, z)]) for z in (0.0, -0.03)])
    result = evaluate_hole(points, centre=np.zeros(2), radius=0.105)
    assert np.abs(result.form).max() / MM == pytest.approx(0.05, abs=1e-4)
    assert result.position / UM < 0.01


def test_the_axis_is_read_at_the_top_face():
    points = wall((0.0, 0.0), 0.105)
    leaning = points + np.outer(points[:, 2], [0.01, 0.0, 0.0])
    fit = fit_cylinder(leaning)
    assert fit.slope[0] == pytest.approx(0.01, abs=1e-3)
    assert np.linalg.norm(fit.centre) < 2 * UM
    with pytest.raises(ShapeError, match="5 points"):
        fit_cylinder(points[:5])
