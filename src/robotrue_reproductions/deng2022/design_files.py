"""The paper's design on one simulated arm as the files an engineer would have. Simulated."""

from __future__ import annotations

from pathlib import Path

from robotrue.app.demo_virtual import cell_toml
from robotrue.core.files import write_atomic
from robotrue.measurement.formats.canonical import write_canonical
from robotrue_reproductions.deng2022 import scenarios


def write_design(folder: Path, scenario: str, seed: int) -> tuple[Path, ...]:
    """Writes cell.toml, source.csv (126), target.csv (80), grid.csv (378) and check.csv (50).

    ``grid.csv`` is the complete sampling of the validation region, ``check.csv`` 50 poses of it on
    another day.

    Args:
        folder: Created if missing; files of the same names are replaced.
        scenario: See :mod:`robotrue_reproductions.deng2022.scenarios`.
        seed: Of the arm and all its noise.

    Raises:
        ConfigurationError: No such scenario.
    """
    case = scenarios.scenario(scenario, seed)
    rows = scenarios.paper(case)
    folder.mkdir(parents=True, exist_ok=True)
    cell = folder / "cell.toml"
    write_atomic(cell, cell_toml(case.cell.known).encode())
    written = [cell]
    for name, measured in (
        ("source", rows.subset(rows.group == 0)),
        ("target", rows.subset(rows.group == 1)),
        ("grid", scenarios.validation(case)),
        ("check", scenarios.check(case)),
    ):
        written.append(folder / f"{name}.csv")
        write_canonical(written[-1], measured)
    return tuple(written)
