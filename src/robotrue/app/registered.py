"""A model file, a cell, or a registered cell with the model it belongs to: opened as one thing."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import numpy as np

from robotrue.calibration.model import ErrorModel, UnconditionalModel, identity_of, provenance_of
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.cell import Cell, overlay_cell
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import parse_cell, read_cell
from robotrue.cell.part import PartTable, part_tables
from robotrue.cell.toml_edit import rename_files, with_part, with_table, without_part
from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.model_identity import require_same_model
from robotrue.core.provenance import Provenance, merge
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ArchiveError, ConfigurationError, ModelMismatchError
from robotrue.robot.statics import Load
from robotrue.store.model_file import ZIP, read_model


def open_model(path: Path, registered: Path | None = None) -> tuple[Cell, ErrorModel | None]:
    """Returns the cell and the model of the arm, of one identity; None is the nominal arm.

    Args:
        path: Model file or cell; a registered cell brings the model it was registered with.
        registered: Another cell whose frames are wanted: its part frames, if it is registered,
            and what else it states, see :func:`robotrue.cell.cell.overlay_cell`.

    Raises:
        ConfigurationError: As :func:`~robotrue.cell.cell.overlay_cell`; or two registered
            cells.
        ModelMismatchError: The frames were registered with another model, or it is missing; or the
            other cell has another arm, or another payload where no load enters the model.
    """
    cell, model = _cell_and_model(path)
    if registered is None:
        if model is None and cell.part is not None:
            model = model_of_part(cell.part, path)
        return cell, model
    place = read_cell(registered)
    whole = overlay_cell(cell, place)
    if model is not None:
        _require_measured_payload(model, cell.payload, whole.payload, registered)
    if place.part is None:
        return whole, model
    if cell.part is not None:
        raise ConfigurationError(
            "two registered cells: one with --cell is enough.",
            source=path,
            hint=f"robotrue compensate {registered} PROGRAM -o OUT",
        )
    used = identity_of(model or NominalModel(robot=cell.robot))
    require_same_model(place.part.identity, used, what="the part frame", source=str(registered))
    return whole, model


def _require_measured_payload(
    model: ErrorModel, measured: Load, stated: Load, source: Path
) -> None:
    """Refuses another payload for a calibrated model that no load enters.

    Raises:
        ModelMismatchError: It is another one.
    """
    if not (model.calibrated and isinstance(model, UnconditionalModel)):
        return
    pairs = ((measured.mass, stated.mass), (measured.com, stated.com))
    if not all(np.allclose(was, now, rtol=1e-6, atol=1e-9) for was, now in pairs):
        raise ModelMismatchError(
            f"[payload] states {_describe_payload(stated)}, and the model was measured under "
            f"{_describe_payload(measured)}; no load enters a {type(model).__name__}.",
            source=source,
            hint="leave [payload] out, or calibrate with --method elastic, ripple or gp.",
        )


def _describe_payload(load: Load) -> str:
    x, y, z = load.com[0] / MM
    return f"{load.mass[0]:g} kg at ({x:g}, {y:g}, {z:g}) mm"


def open_arm(path: Path) -> tuple[Cell, ErrorModel]:
    """Returns the cell and the model of :func:`open_model`, of a nominal arm that of no error."""
    cell, model = open_model(path)
    return cell, NominalModel(robot=cell.robot) if model is None else model


def read_model_or_cell(path: Path) -> tuple[Cell, ErrorModel | None]:
    """Returns the cell of a cell file or model file, and the model of the latter."""
    if read_bytes(path).startswith(ZIP):
        stored = read_model(path)
        return stored.cell, stored.model
    return read_cell(path), None


def provenance_used(cell: Cell | None, model: ErrorModel | None) -> Provenance:
    """Returns the provenance of a program's sources: model and part frame."""
    return merge(
        [
            *([] if model is None else [provenance_of(model)]),
            *([] if cell is None or cell.part is None else [cell.part.provenance]),
        ]
    )


def provenance_of_file(model_path: Path | None) -> Provenance:
    """Returns the provenance of the model in a file; empty without a file."""
    return provenance_used(None, None if model_path is None else read_model(model_path).model)


def model_of_part(part: PartTable, cell: Path) -> ErrorModel | None:
    """Returns the model a registered cell belongs to, from the file it names; None: nominal arm.

    Args:
        part: Of the cell.
        cell: Its file; the model's is named relative to it.

    Raises:
        ModelMismatchError: The file is missing, or holds another model by now.
    """
    if part.identity.kind == "nominal":
        return None
    path = cell.parent / part.model_file
    if not part.model_file or not path.is_file():
        raise ModelMismatchError(
            f"the part frame was registered with {part.identity}, whose file "
            f"{part.model_file or '(not named)'} is not there.",
            source=cell,
            hint="restore the model file, or register again from its cell or model.",
        )
    model = read_model(path).model
    require_same_model(part.identity, identity_of(model), what="the part frame", source=str(cell))
    return model


def _cell_and_model(path: Path) -> tuple[Cell, ErrorModel | None]:
    """The content of a model file, or a bare cell."""
    if path.suffix.lower() == ".toml":
        return read_model_or_cell(path)
    try:
        return read_model_or_cell(path)
    except ConfigurationError as cause:
        raise ArchiveError(
            f"neither a model file nor a cell ({cause.message})",
            source=path,
            line=cause.line,
            hint="a model file is what `robotrue calibrate ... -o` writes.",
        ) from cause


def model_file_of(cell: Cell, source: Path) -> Path | None:
    """Returns the model file that was given, itself or by a registered cell; None: nominal."""
    if read_bytes(source).startswith(ZIP):
        return source
    if cell.part is None or cell.part.identity.kind == "nominal":
        return None
    return source.parent / cell.part.model_file


def relative_name(path: Path, output: Path) -> str:
    """Returns a path as the file that is written names it."""
    return Path(os.path.relpath(path.resolve(), output.parent.resolve())).as_posix()


def registered_cell(cell: Cell, source: Path, table: PartTable, output: Path) -> bytes:
    """Returns the registered cell, read back before anything is written."""
    if not read_bytes(source).startswith(ZIP):
        text = rename_files(cell.text, partial(_move_path, source=source, output=output))
    elif cell.text and not cell.files:
        text = cell.text
    else:  # the files that it names are in the model file, not next to the output
        text = cell_text(cell)
    data = with_part(text, part_tables(table)).encode()
    parse_cell(data, output)
    return data


def _move_path(name: str, source: Path, output: Path) -> str:
    """A path that one cell file names, as another names it."""
    path = (source.parent / name).resolve()
    if Path(name).is_absolute() or source.parent.resolve() == output.parent.resolve():
        return str(name)
    return Path(os.path.relpath(path, output.parent.resolve())).as_posix()


def cell_with_tool(cell: Cell, source: Path, T_flange_tool: Array, output: Path) -> bytes:
    """Returns the cell with another ``[tool]``, which reads back.

    Part frames go: they were touched with another tip.

    Raises:
        ConfigurationError: The text that would be written is no cell.
    """
    text = cell.text if cell.text and not read_bytes(source).startswith(ZIP) else cell_text(cell)
    table = {
        "xyz_mm": [round(float(v), 6) for v in T_flange_tool[:3, 3] / MM],
        "abc_deg": [round(float(v), 8) for v in abc_from_matrix(T_flange_tool[:3, :3]) / DEG],
    }
    data = with_table(without_part(text), "tool", table).encode()
    parse_cell(data, output)
    return data
