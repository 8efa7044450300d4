"""``robotrue export``: the calibrated robot for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_json, say, say_mark
from robotrue.core.files import write_atomic
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.report.export_controller import export_controller
from robotrue.report.export_dh import export_dh
from robotrue.report.export_losses import ExportableModel, Loss, prepare_export
from robotrue.report.export_urdf import export_urdf
from robotrue.store.model_file import read_model

PLACES: Final = ("target", "tool")


def run(model_path: Path, output: Path, *, kind: str, lossy: str, at: str, as_json: bool) -> None:
    """Writes the export; prints what it misses of the model."""
    check_output(output, [model_path])
    if at not in PLACES:
        raise ConfigurationError(f"--at {at!r}, expected {' or '.join(PLACES)}.")
    stored = read_model(model_path)
    named = tuple(part.strip() for part in lossy.split(",") if part.strip())
    tool = None if at == "target" else stored.cell.robot.T_flange_tool
    found = prepare_export(stored.model, stored.cell.payload, T_flange_tool=tool)
    files, total = _made(kind, found, output, named)
    for path, text in files.items():
        check_output(path, [model_path])
        write_atomic(path, text.encode("utf-8"))
    say_mark(found.provenance)
    say(f"written: {', '.join(str(path) for path in files)}")
    say(
        f"misses the model by {total.rms / MM:.4f} mm rms, {total.largest / MM:.4f} mm at most, "
        "over poses spread over its training range"
    )
    if as_json:
        emit_json(
            {
                "written": [str(path) for path in files],
                "holds": list(found.held),
                "misses_rms_mm": total.rms / MM,
                "misses_largest_mm": total.largest / MM,
            },
            found.provenance,
        )


def _made(
    kind: str,
    found: ExportableModel,
    output: Path,
    lossy: tuple[str, ...],
) -> tuple[dict[Path, str], Loss]:
    if kind == "urdf":
        both = export_urdf(found, lossy=lossy)
        side = output.with_suffix(".compliance.json")
        return {output: both.urdf, side: both.side}, both.total
    if kind == "dh":
        table = export_dh(found, lossy=lossy)
        return {output: table.text}, table.total
    sheet = export_controller(found, lossy=lossy)
    text = sheet.json() if output.suffix.lower() == ".json" else sheet.text()
    return {output: text}, sheet.total
