"""``robotrue reproduce``: the tables of a paper beside those of simulated arms."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from robotrue.cli.console import emit_facts, emit_json, emit_table, progress, say
from robotrue.core.files import write_atomic
from robotrue.errors import ConfigurationError
from robotrue.simulation.reproduce_deng2022 import reproduce_deng2022
from robotrue.simulation.reproduction import Figure, Reproduction

PAPERS: Final = ("deng2022",)
TITLES: Final = {
    "4": "Table 4: similarity to the reference region",
    "4 readings": "Table 4: readings of eq. 9-10 over random layouts",
    "5": "Table 5: change of the error when the attitude turns, mm",
    "6, 7": "Tables 6 and 7: poses of the plan",
    "8": "Table 8: error of 50 check poses, mm",
    "9": "Table 9: 39 poses of the slot, dry run, mm",
    "11": "Table 11: milled hole, mm",
    "switches": "Tr-GPR under other readings, mean error of 50 check poses, mm",
}


def run(
    paper: str, *, scenario: str, robots: int, quick: bool, out: Path | None, as_json: bool
) -> None:
    """Runs the reproduction; tables, or JSON, on stdout."""
    if paper not in PAPERS:
        raise ConfigurationError(f"no reproduction of {paper!r}; there are {list(PAPERS)}.")
    with progress() as bar:
        result = reproduce_deng2022(scenario, robots, quick=quick, progress=bar)
    if out is not None:
        _write(result, out)
    if as_json:
        emit_json(result.document())
        return
    emit_facts(
        f"SIMULATED: {result.robots} arms of scenario {result.scenario}, beside Deng et al. 2022",
        [("", remark) for remark in result.remarks],
    )
    for table, title in TITLES.items():
        figures = [f for f in result.figures if f.table == table]
        if figures:
            columns = ("", "", "paper", "median", "quartiles")
            emit_table(f"{title} (simulated)", columns, [_row(f) for f in figures])
    emit_facts("What cannot be met, and why", result.unmet)


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


def _write(result: Reproduction, folder: Path) -> None:
    """Writes ``deng2022.json`` and ``deng2022.csv``."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(result.document(), indent=1, allow_nan=False)
    write_atomic(folder / "deng2022.json", text.encode())
    names = list(result.figures[0].document())
    lines = [",".join(names)]
    for figure in result.figures:
        values = figure.document().values()
        lines.append(",".join("" if v is None else _quoted(v) for v in values))
    write_atomic(folder / "deng2022.csv", ("\n".join(lines) + "\n").encode())
    say(f"figures: {folder}")


def _quoted(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return f'"{text}"' if "," in text else text
