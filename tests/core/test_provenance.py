"""Provenance: merged, bounded, written and read, and the mark in files."""

from __future__ import annotations

from pathlib import Path

import openpyxl
import pytest

from robotrue.core.provenance import (
    MEASURED,
    MOST_FILES,
    Provenance,
    SourceFile,
    mark_line,
    merge,
    provenance_from,
    provenance_of_lines,
    read_provenance,
    simulation_mark,
)
from robotrue.errors import ArchiveError
from robotrue.measurement.formats.measured_files import read_measurements

VIRTUAL = Provenance(simulated=True, instrument="API T3", files=(SourceFile(name="a", sha256="1"),))
HEADER = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,x_mm,y_mm,z_mm"


def test_one_simulated_part_marks_the_whole() -> None:
    real = Provenance(instrument="AT960", files=(SourceFile(name="b", sha256="2"),))
    both = merge([real, VIRTUAL, real])
    assert both.simulated
    assert both.instrument == "AT960; API T3"
    assert [file.name for file in both.files] == ["b", "a"]
    assert simulation_mark(both, "仿真") == "仿真"
    assert simulation_mark(real) == simulation_mark(None) == ""
    assert provenance_from(both.to_document()) == both


def test_files_are_bounded_and_the_rest_is_counted() -> None:
    files = tuple(SourceFile(name=str(k), sha256=str(k)) for k in range(MOST_FILES + 5))
    found = Provenance(files=files)
    assert len(found.files) == MOST_FILES
    assert merge([found, VIRTUAL]).more_files == 6


def test_only_archives_without_the_field_go_by_names() -> None:
    assert provenance_from(None, before=["simulated.csv sha256:0"]).simulated
    assert not provenance_from(MEASURED.to_document(), before=["simulated.csv"]).simulated
    with pytest.raises(ArchiveError):
        provenance_from({"simulated": "no"})


@pytest.mark.parametrize("instrument", ["API T3", "", 'a, "b"; c\td'])
def test_the_line_survives_a_spreadsheet(instrument: str) -> None:
    line = mark_line(Provenance(simulated=True, instrument=instrument))
    for saved in (line, line.rstrip() + ",,,,", line.rstrip() + ";;;"):
        found = provenance_of_lines([saved])
        assert found.simulated
        assert found.instrument == " ".join(instrument.replace('"', " ").translate(SPLIT).split())
    assert mark_line(MEASURED) == ""


SPLIT = str.maketrans(",;\t", "   ")


@pytest.mark.parametrize(
    "line",
    ["# simulated", "# robotrue simulated annealing", "simulated", "# not robotrue SIMULATED"],
)
def test_other_comments_are_no_mark(line: str) -> None:
    assert not provenance_of_lines([line]).simulated


def test_a_workbook_keeps_the_mark_of_the_text_it_was_made_of(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    rows = [[mark_line(VIRTUAL).strip()], HEADER.split(","), [*range(6), 900.0, 10.0, 800.0]]
    for row in rows:
        book.active.append(row)
    book.save(tmp_path / "saved.xlsx")
    found = read_measurements(tmp_path / "saved.xlsx")
    assert found.provenance.simulated
    assert found.provenance.instrument == "API T3"
    assert len(found) == 1


def test_a_name_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "simulated.csv"
    path.write_text(f"{HEADER}\n0,0,0,0,0,0,1,2,3\n")
    assert not read_measurements(path).provenance.simulated
    assert not read_provenance(path).simulated
    assert read_provenance(path) == read_measurements(path).provenance
