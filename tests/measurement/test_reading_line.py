"""Lines as controllers show them."""

from __future__ import annotations

import pytest

from robotrue.errors import FormatError
from robotrue.measurement.formats.reading_line import joints_line, position_line

SIX = (-27.2, -29.9, 1.4, 75.0, -113.0, 55.6)


@pytest.mark.parametrize(
    ("text", "counting"),
    [
        ("{E6AXIS: A1 -27.2, A2 -29.9, A3 1.4, A4 75.0, A5 -113.0, A6 55.6, E1 9E9}", "controller"),
        ("A1 -27,2 A2 -29,9 A3 1,4 A4 75 A5 -113,0 A6 55,6", "controller"),
        ("J1= -27.2 deg, J2= -29.9 deg, J3= 1.4 deg, J4= 75.0 deg, J5= -113 deg, J6= 55.6 deg",
         "controller"),
        ("[[-27.2,-29.9,1.4,75,-113,55.6],[9E9,9E9,9E9,9E9,9E9,9E9]]", "controller"),
        ("q1=-27.2 q2=-29.9 q3=1.4 q4=75 q5=-113 q6=55.6", "model"),
        ("-27.2, -29.9, 1.4, 75, -113, 55.6", "stated"),
        ("-27,2;-29,9;1,4;75;-113;55,6", "stated"),
        ("\u221227.2, \u221229.9, 1.4, 75, \u2212113, 55.6", "stated"),
        ("-27.2\t-29.9\t1.4\t75\t-113\t55.6", "stated"),
    ],
)  # fmt: skip
def test_joints(text: str, counting: str) -> None:
    found = joints_line(text, 6)
    assert found.values == pytest.approx(SIX)
    assert found.counting == counting


@pytest.mark.parametrize(
    "text",
    [
        "{E6POS: X 1200.02, Y -150.04, Z 599.97, A 12.0, B -1.5, C 0.8, S 2, T 35}",
        "X = 1200.02 mm, Y = -150.04 mm, Z = 599.97 mm",
        "[[1200.02,-150.04,599.97],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
        "p[1.20002, -0.15004, 0.59997, 0.1, 3.1, 0.0]",
        "1200,02; -150,04; 599,97",
        "1200.02 -150.04 599.97",
        "1200.02,-150.04,599.97",
    ],
)
def test_positions(text: str) -> None:
    assert position_line(text).values == pytest.approx((1200.02, -150.04, 599.97))


def test_what_is_no_reading_is_said_in_plain_words() -> None:
    with pytest.raises(FormatError, match=r"a position \(X, Y, Z\) where joints are read"):
        joints_line("X 1200 Y -150 Z 600", 6)
    with pytest.raises(FormatError, match="joints where a position is read"):
        position_line("A1 1 A2 2 A3 3 A4 4 A5 5 A6 6")
    with pytest.raises(FormatError, match="5 numbers in '1 2 3 4 5', expected 6 joints in deg"):
        joints_line("1 2 3 4 5", 6)
    with pytest.raises(FormatError, match="0 numbers in 'hello'"):
        position_line("hello")
    with pytest.raises(FormatError, match=r"inf in .* expected mm or deg of up to 100,000"):
        position_line("1e999 2 3")
    with pytest.raises(FormatError, match="expected one line of up to 2000"):
        joints_line("1 " * 2000, 6)
