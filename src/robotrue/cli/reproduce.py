"""``robotrue reproduce``: the tables of a paper beside those of simulated arms."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from robotrue.cli.console import emit_facts, emit_json, emit_table, progress, say
from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue.errors import ConfigurationError
from robotrue_reproductions.deng2022.tables import reproduce_deng2022
from robotrue_reproductions.drill_patent.tables import CASES, CHANCE, SHIFTED, reproduce_drilling
from robotrue_reproductions.feng2018.tables import reproduce_feng2018
from robotrue_reproductions.jin2022.tables import reproduce_jin2022
from robotrue_reproductions.reproduction import Figure, Reproduction

PAPERS: Final = ("deng2022", "feng2018", "jin2022", "drill-patent")
WORDS: Final = {
    "deng2022": ("arms of scenario", "Deng et al. 2022"),
    "feng2018": ("cells,", "Feng, Liang, Xi 2018"),
    "jin2022": ("arms,", "Jin, Sun, Tang, Li 2022"),
    "drill-patent": ("machines", "prototypes of the same methods"),
}
DENG2022: Final = {
    "4": "Table 4: similarity to the reference region",
    "4 readings": "Table 4: readings of eq. 9-10 over random layouts",
    "5": "Table 5: change of the error when the attitude turns, mm",
    "6, 7": "Tables 6 and 7: poses of the plan",
    "8": "Table 8: error of 50 check poses, mm",
    "9": "Table 9: 39 poses of the slot, dry run, mm",
    "11": "Table 11: milled hole, mm",
    "switches": "Tr-GPR under other readings, mean error of 50 check poses, mm",
}
FENG2018: Final = {
    "worked": "Worked example, noise-free, deg and mm",
    "readings": "The equations as printed, worked example, worst of K, L, M in mm",
    "floor": "Recursion (simulated), worst of K, L, M, mm: median [5 % 95 %]",
    "slots": "Two-sided slots (simulated), mm: median [5 % 95 %]",
    "sculpture": "Sculpture (simulated), two sides meet on the outline, mm: median [5 % 95 %]",
    "blind": "What the slots cannot see (simulated), mm: median [5 % 95 %]",
}
JIN2022: Final = {
    "printed": "Printed tables, checked",
    "random": "Random 70 / 23 windows of one pass, 2.5 um of noise (simulated), um",
    "held out": "Windows held out, low noise (simulated), RMSE in um and coverage in %",
}
DRILL: Final = {
    **{case[0]: f"Tilt left after one move, {case[0]} (simulated)" for case in CASES},
    CHANCE: "Tilt left where the foot meets the skin as the clamp before left it (simulated)",
    SHIFTED: "A zero shifted by 50, -50 and 25 um at hole 400 of 800 (simulated)",
}
TITLES: Final = {
    "deng2022": DENG2022,
    "feng2018": FENG2018,
    "jin2022": JIN2022,
    "drill-patent": DRILL,
}
WIDE: Final = {"feng2018": "paper", "drill-patent": "reference"}
"""Papers shown with one column for each quantity, and what the number beside ours is called."""


def run(
    paper: str, *, scenario: str, robots: int, quick: bool, out: Path | None, as_json: bool
) -> None:
    """Runs the reproduction; tables, or JSON, on stdout."""
    if paper not in PAPERS:
        raise ConfigurationError(f"no reproduction of {paper!r}; there are {list(PAPERS)}.")
    with progress() as bar:
        if paper == "feng2018":
            result = reproduce_feng2018(robots, quick=quick, progress=bar)
        elif paper == "drill-patent":
            result = reproduce_drilling(robots, quick=quick, progress=bar)
        elif paper == "jin2022":
            result = reproduce_jin2022(robots, quick=quick, progress=bar)
        else:
            result = reproduce_deng2022(scenario, robots, quick=quick, progress=bar)
    if out is not None:
        _write(result, out, paper)
    if as_json:
        emit_json(result.document())
        return
    of, authors = WORDS[paper]
    emit_facts(
        f"SIMULATED: {result.robots} {of} {result.scenario}, beside {authors}",
        [("", remark) for remark in result.remarks],
    )
    for table, title in TITLES[paper].items():
        figures = [f for f in result.figures if f.table == table]
        if not figures:
            continue
        if paper in WIDE:
            emit_table(title, *_wide(figures, WIDE[paper]))
        else:
            columns = ("", "", "paper", "median", "quartiles")
            heading = title if paper == "jin2022" else f"{title} (simulated)"
            emit_table(heading, columns, [_row(f) for f in figures])
    emit_facts("What cannot be met, and why", result.unmet)


def _wide(figures: Sequence[Figure], printed: str) -> tuple[Sequence[str], Sequence[Sequence[str]]]:
    """One row for each name, one column for each quantity."""
    quantities = list(dict.fromkeys(f.quantity for f in figures))
    names = list(dict.fromkeys(f.name for f in figures))
    found = {(f.name, f.quantity): f for f in figures}
    rows = [
        (name, *(_cell(found[name, q], printed) if (name, q) in found else "" for q in quantities))
        for name in names
    ]
    return ("", *quantities), rows


def _cell(figure: Figure, printed: str) -> str:
    """Median with 5 and 95 %, and the printed number where there is one."""
    fine = figure.unit == "deg" and abs(figure.median) < 0.1
    digits = 0 if figure.unit == "%" else 2 if abs(figure.median) >= 10.0 else 4 if fine else 3
    text = f"{figure.median + 0.0:.{digits}f}{' %' if figure.unit == '%' else ''}"
    if len(figure.ours) > 1:
        low, high = figure.range90
        text += f"\n[{low:.{digits}f} {high:.{digits}f}]"
    if figure.paper is not None:
        text += f"\n{printed} {figure.paper:g}"
    return text


def _row(figure: Figure) -> Sequence[str]:
    digits = 0 if figure.table == "6, 7" else 4 if figure.table.startswith("4") else 3
    low, high = figure.quartiles
    spread = "" if len(figure.ours) == 1 else f"{low:.{digits}f} - {high:.{digits}f}"
    printed = figure.paper if figure.table != "4 readings" else None
    return (
        figure.name,
        figure.quantity,
        "" if printed is None else f"{printed:.{digits}f}",
        f"{figure.median:.{digits}f}",
        spread,
    )


def _write(result: Reproduction, folder: Path, paper: str) -> None:
    """Writes the figures as JSON and as CSV, named after the paper."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(result.document(), indent=1, allow_nan=False)
    write_atomic(folder / f"{paper}.json", text.encode())
    names = list(result.figures[0].document())
    cells = ([_printed(v) for v in figure.document().values()] for figure in result.figures)
    write_atomic(folder / f"{paper}.csv", csv_text([names, *cells]).encode())
    say(f"figures: {folder}")


def _printed(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else value
