"""Laws of printed numbers: style and value survive, and nothing else is touched."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robotrue.errors import ShapeError
from robotrue.program.formats.number_table import NumberTable
from robotrue.program.formats.number_text import NUMBER, restyle, splice_texts

digits = st.text("0123456789", min_size=1, max_size=6)
tokens = st.builds(
    lambda sign, number, exponent: (sign + number + exponent).encode(),
    st.sampled_from(["", "-", "+"]),
    st.one_of(digits, digits.map(lambda d: d + "."), st.tuples(digits, digits).map(".".join),
              digits.map(lambda d: "." + d)),
    st.sampled_from(["", "", "", "E-05", "e+2", "E3", "E-14"]),
)  # fmt: skip
values = st.one_of(
    st.floats(-4000, 4000), st.floats(-1, 1), st.sampled_from([0.0, -0.0, 0.9999996])
)


def half_digit(token: bytes) -> float:
    """Half of the last digit a number shows: 0.0005 for ``1.250``, 5 for ``1E1``."""
    mantissa, _, exponent = token.lower().partition(b"e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(b".")[2]))


@given(tokens, values, st.integers(0, 7))
@settings(max_examples=300, deadline=None)
def test_value_to_half_a_digit_in_the_style_that_stood_there(
    token: bytes, value: float, least: int
) -> None:
    out = restyle(token, value, least=least)
    assert re.fullmatch(NUMBER, out)
    assert abs(float(out) - value) <= half_digit(out) * (1 + 1e-9) + 1e-12
    assert restyle(token, float(token), least=least) == token
    assert restyle(out, value, least=least) == out
    if out == token:
        return
    exponent = b"E" in token.upper()
    assert (b"E" in out.upper()) == exponent
    assert half_digit(out) <= 0.5 * 10.0**-least * (1 + 1e-9)
    assert out.startswith(b"+") == (token.startswith(b"+") and not out.startswith(b"-"))
    if not exponent:
        shown = len(token.partition(b".")[2])
        assert len(out.partition(b".")[2]) == max(shown, least)


def test_styles() -> None:
    assert restyle(b"-0.000", 0.0004) == b"-0.000"
    assert restyle(b"-0.000", 0.0006) == b"0.001"
    assert restyle(b"0.0", -0.02) == b"0.0"
    assert restyle(b"5", 5.02) == b"5"
    assert restyle(b"5", 5.02, least=3) == b"5.020"
    assert restyle(b"+5.", 6.7) == b"+7."
    assert restyle(b".50", -0.25) == b"-.25"
    assert restyle(b".50", 1.25) == b"1.25"
    assert restyle(b"0.10", -0.004) == b"0.00"
    assert restyle(b"1.5E-03", 0.25) == b"2.50000E-01"
    assert restyle(b"1E3", 1234.5) == b"1.234500000E3"
    for bad in (float("nan"), 1e9):
        with pytest.raises(ShapeError, match="cannot be printed"):
            restyle(b"1.0", bad)
    for word in (b"", b".", b"-", b"1,5", b"1.5\n"):
        with pytest.raises(ShapeError, match="is not a number"):
            restyle(word, 1.0)


@given(st.lists(st.tuples(st.binary(max_size=5), st.binary(max_size=4), st.binary(max_size=6))))
@settings(max_examples=100, deadline=None)
def test_splicing_touches_what_it_is_told(parts: list[tuple[bytes, bytes, bytes]]) -> None:
    data, want = b"", b""
    starts = []
    for kept, old, new in parts:
        starts.append(len(data) + len(kept))
        data, want = data + kept + old, want + kept + new
    stretches = [(at, len(old), new) for at, (_, old, new) in zip(starts, parts, strict=True)]
    assert splice_texts(data, stretches) == want
    assert splice_texts(data, []) == data


def test_stretches_must_not_overlap() -> None:
    with pytest.raises(ShapeError, match="bytes 1 to 3 cannot be replaced, expected 2 to 4"):
        splice_texts(b"abcd", [(0, 2, b"x"), (1, 2, b"y")])
    with pytest.raises(ShapeError, match="cannot be replaced"):
        splice_texts(b"abcd", [(3, 2, b"x")])


SIXTEEN_DIGITS = [
    *(b"95142426273599.37", b"9474996.311614687", b"97873.74139710449"),
    *(b"907554643.4292405", b"94483.34263716771", b"123456789012.345"),
]
"""One quotient of two whole numbers does not round the first five to their last bit."""


@given(st.lists(tokens, min_size=6, max_size=6))
@example(SIXTEEN_DIGITS)
@settings(max_examples=150, deadline=None)
def test_numbers_of_literals_are_read_to_the_last_bit(row: list[bytes]) -> None:
    data = b"x 7, [" + b" , ! 5\n".join(row) + b"]"
    table = NumberTable(data, [(5, 4, 3, 2, 1, 0)], b"!")
    assert table.add(5, len(data), 0) == 0
    numbers = table.numbers()
    assert numbers.value[0, ::-1].tolist() == [float(token) for token in row]
    found = [
        data[start : start + length]
        for start, length in zip(numbers.start[0], numbers.length[0], strict=True)
    ]
    assert found[::-1] == row
