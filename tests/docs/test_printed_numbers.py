"""Printed answers may differ by a rounding and by nothing else."""

from __future__ import annotations

import pytest
from printed_numbers import agree_in_print, assert_answers_agree


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("add +0.1129 deg, +0.0961 to", "add +0.1129 deg, +0.0962 to", True),
        ("0.0961", "0.0963", False),
        ("0.096", "0.0960", False),
        ("1.75e+06 Nm", "1.76e+06 Nm", True),
        ("1.75e+06 Nm", "1.75e+05 Nm", False),
        ('"mean": 1409.6322327133928', '"mean": 1409.632232713399', True),
        ('"mean": 1409.6322327133928', '"mean": 1409.652232713399', False),
        ("47 of 50 poses", "48 of 50 poses", False),
        ("-0.1 mm", "0.0 mm", True),
        ("0.1 mm", "0.1 deg", False),
        ("the arm (56d7239995fe); twice", "the arm (0a8132f11177); twice", True),
        ("the arm (56d7239995fe); twice", "the arm (none); twice", False),
        (f'"sha256": "{"0a" * 32}"', f'"sha256": "{"b1" * 32}"', True),
        ("Python 3.11.2", "Python 3.11.3", False),
    ],
)
def test_only_a_rounding_is_let_pass(one: str, other: str, same: bool) -> None:
    assert agree_in_print(one, other) is same


def test_lines_that_are_missing_are_shown() -> None:
    with pytest.raises(AssertionError, match="-two"):
        assert_answers_agree("one\ntwo", "one")
