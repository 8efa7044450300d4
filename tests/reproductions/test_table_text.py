"""Tables of every source from its figures: none is left out, and digits are as the layout says."""

from __future__ import annotations

import json

import pytest

from robotrue.errors import ConfigurationError
from robotrue_reproductions.drill_patent.experiment import CASES
from robotrue_reproductions.jin2022.jin_tables import printed_figures
from robotrue_reproductions.papers import PAPERS, find_paper
from robotrue_reproductions.reproduction import Reproduction, ReproductionRequest, figure
from robotrue_reproductions.table_text import text_tables, write_figures


def silent(what, done, of):
    """Nobody watches."""


def reproduction(*figures):
    return Reproduction(scenario="S1A", robots=3, figures=figures)


@pytest.mark.parametrize("name", PAPERS)
def test_every_table_of_a_source_is_printed_in_its_order(name):
    paper = PAPERS[name]
    figures = [figure(table, "row", "mean", "mm", 1.5, 2.0) for table in reversed(paper.tables)]
    printed = list(text_tables(paper, reproduction(*figures)))
    assert [t.title for t in printed] == [layout.title for layout in paper.tables.values()]
    assert all(len(row) == len(t.columns) for t in printed for row in t.rows)
    assert list(text_tables(paper, reproduction())) == []


def test_a_long_table_has_its_decimals_and_the_printed_number():
    paper = find_paper("deng2022")
    figures = [
        figure("8", "Tr-GPR", "mean", "mm", 0.182, [0.1, 0.2, 0.3]),
        figure("6, 7", "source", "poses", "", 126.0, 126.0),
        figure("4 readings", "per-point", "share", "", 1.0, 0.9),
    ]
    by_title = {t.title[:7]: t.rows for t in text_tables(paper, reproduction(*figures))}
    assert by_title["Table 8"] == [("Tr-GPR", "mean", "0.182", "0.200", "0.150 - 0.250")]
    assert by_title["Tables "] == [("source", "poses", "126", "126", "")]
    assert by_title["Table 4"] == [("per-point", "share", "", "0.9000", "")]


def test_a_wide_table_has_a_column_for_each_quantity():
    paper = find_paper("feng2018")
    figures = [
        figure("slots", "one", "step", "mm", 0.7025, [0.1, 0.2, 0.3]),
        figure("slots", "one", "seen", "%", None, 50.0),
        figure("slots", "two", "step", "mm", None, 20.0),
    ]
    (table,) = text_tables(paper, reproduction(*figures))
    assert table.columns == ("", "step", "seen")
    assert table.rows == [
        ("one", "0.200\n[0.110 0.290]\npaper 0.7025", "50 %"),
        ("two", "20.00", ""),
    ]


def test_no_figure_of_a_run_is_without_a_table():
    paper = find_paper("drill-patent")
    result = paper.run(ReproductionRequest(robots=1, quick=True), silent)
    assert {f.table for f in result.figures} == set(paper.tables) - {case[0] for case in CASES[1:]}
    ours = {(f.name, f.quantity): f.median for f in result.figures if f.table == CASES[0][0]}
    assert 0.0 < ours["ours", "mean deg"] < 0.2 * ours["none", "mean deg"]
    assert ours["patent", "mean deg"] < ours["none", "mean deg"]
    assert {f.table for f in printed_figures()} == {"printed"}


def test_files_hold_every_figure(tmp_path):
    result = reproduction(figure("8", "Tr-GPR", "mean", "mm", None, 1.0 / 3.0))
    write_figures(result, tmp_path / "new", "deng2022")
    assert json.loads((tmp_path / "new" / "deng2022.json").read_text()) == result.document()
    rows = (tmp_path / "new" / "deng2022.csv").read_text().splitlines()
    assert rows[1] == "8,Tr-GPR,mean,mm,,0.333333,0.333333,0.333333,0.333333,0.333333,1"


def test_requests_without_arms_are_refused():
    with pytest.raises(ConfigurationError, match="0 robots, expected 1 or more"):
        ReproductionRequest(robots=0)
    assert list(ReproductionRequest(robots=3).seeds) == [1, 2, 3]
