"""A simulated cell for practice."""

from __future__ import annotations

from pathlib import Path


def write_practice_cell(folder: str | Path, *, seed: int | None = None) -> Path:
    """Writes a simulated robot cell for practice, and returns its folder.

    It is the cell of ``robotrue demo``, a KUKA KR160 with tracker: ``cell.toml``,
    ``calibration.csv`` (80 poses), ``held_out.csv`` (50 poses) and ``flange_hole.src``. The
    measurements are marked as simulated, and so are all results from them.

    Args:
        folder: Created if missing; files of the same names are replaced.
        seed: Seed of the cell and its noise; default: that of the demo.

    Raises:
        FormatError: The folder cannot be written to.
    """
    from robotrue.app.demo_virtual import write_virtual_cell
    from robotrue.app.operations.demo import DemoRequest
    from robotrue.simulation.flange_hole import FlangeHole
    from robotrue.simulation.presets import deng2022, reflector_at_tool

    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    drawn = DemoRequest().seed if seed is None else seed
    write_virtual_cell(reflector_at_tool(deng2022(drawn)), FlangeHole(), place)
    return place
