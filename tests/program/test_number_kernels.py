"""Compiled printing and reading of numbers against Python's own."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.program.formats.krl_tokens import read_number
from robotrue.program.formats.number_kernels import (
    put_number,
    put_whole,
)


def printed(value: float, decimals: int, *, plus: bool = False, bare: bool = False) -> str:
    out = np.full(64, 35, np.uint8)
    size = put_number(out, 0, value, decimals, plus, bare)
    assert (out[size:] == 35).all()
    return out[:size].tobytes().decode()


@pytest.mark.parametrize("decimals", range(1, 13))
def test_printing(decimals: int) -> None:
    rng = np.random.default_rng(decimals)
    values = rng.normal(size=3000) * 10.0 ** rng.integers(-4, 5, 3000)
    values[:8] = 0.0, 9.5, 99.5, 9999.5, 10000.0, 99999.0, 123456789.25, 0.5
    for value in values.tolist():
        shown = printed(value, decimals)
        expected = f"{value:.{decimals}f}"
        if set(expected) <= set("-0."):
            expected = expected.lstrip("-")
        # A tie of the decimal number is no tie of the binary one; both are half a digit away.
        assert shown == expected or abs(float(shown) - value) <= 0.5000001 * 10.0**-decimals
        assert len(shown) - shown.index(".") - 1 == decimals


def test_style() -> None:
    assert printed(1.25, 3, plus=True) == "+1.250"
    assert printed(-1.25, 3, plus=True) == "-1.250"
    assert printed(0.25, 3, bare=True) == ".250"
    assert printed(-0.25, 3, bare=True) == "-.250"
    assert printed(10.25, 3, bare=True) == "10.250"
    assert printed(-0.0001, 3) == "0.000"
    assert printed(0.99996, 4) == "1.0000"
    assert printed(9999.99996, 4) == "10000.0000"


def test_whole_numbers() -> None:
    for value in (0, 7, 10, 99, 100, 4096, 10**9, 10**18, 2**62):
        out = np.zeros(32, np.uint8)
        assert out[: put_whole(out, 0, value)].tobytes().decode() == str(value)


def test_plain_numbers_are_read() -> None:
    rng = np.random.default_rng(5)
    texts = ["-0.000", "0", "12.", "-7", "123456789012345678", "-1.2345678"]
    drawn = rng.normal(0, 900, 500), rng.integers(0, 9, 500)
    texts += [f"{v:.{d}f}" for v, d in zip(*drawn, strict=True)]
    for text in texts:
        value, end = read_number(np.frombuffer(text.encode() + b",", np.uint8), 0, len(text) + 1)
        assert (value, end) == (float(text), len(text))
        assert np.signbit(value) == text.startswith("-")
