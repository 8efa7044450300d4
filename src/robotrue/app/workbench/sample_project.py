"""A practice project: the virtual cell of ``robotrue demo`` as items of a workspace."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from robotrue.app.demo_virtual import write_virtual_cell
from robotrue.app.operations.demo import DemoRequest
from robotrue.app.workbench.file_imports import import_cell, import_measurements
from robotrue.simulation.flange_hole import FlangeHole
from robotrue.simulation.presets import deng2022, reflector_at_tool
from robotrue.store import programs
from robotrue.store.nouns import CellRecord
from robotrue.store.workspace import Workspace

NOTE: Final = "simulated: the virtual cell of robotrue demo"
NAMES: Final = {
    "cell": "Practice cell, simulated",
    "calibration": "80 poses for the calibration, simulated",
    "held_out": "50 poses to check it, simulated",
    "program": "Flange hole",
}


def add_sample_project(workspace: Workspace) -> CellRecord:
    """Returns the practice cell, added with two sets of simulated poses and a program."""
    with TemporaryDirectory() as scratch:
        place = Path(scratch)
        virtual = reflector_at_tool(deng2022(DemoRequest().seed))
        write_virtual_cell(virtual, FlangeHole(), place)
        cell = import_cell(workspace, [place / "cell.toml"], NAMES["cell"])
        for name in ("held_out", "calibration"):  # the newest is offered first
            import_measurements(workspace, [place / f"{name}.csv"], NAMES[name], cell.id, None)
        file = place / "flange_hole.src"
        programs.add(workspace, [file], name=NAMES["program"], note=NOTE)
    return cell
