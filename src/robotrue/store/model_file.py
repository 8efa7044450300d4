"""Model files: an error model and the cell it was measured in, in one archive.

A compensated program needs more than the error: the tool, the work frame, the payload. They
travel with the model, so the file alone is enough a year later.
"""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.calibration.archive import check_pose, open_model
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import portable_text
from robotrue.cell.config import parse_cell
from robotrue.core.archive import Archive, archive_from, archive_reader, write_archive
from robotrue.core.document_decoder import decode
from robotrue.core.files import read_bytes
from robotrue.errors import ArchiveError
from robotrue.robot.model import RobotModel
from robotrue.store.cell_schema_1 import cell_of_schema_1

CELL_SCHEMA: Final = 2
SUFFIXES: Final = (".robotrue", ".rtm")
"""Of model files in a folder; a file that is stated may be called anything."""
ZIP: Final = b"PK"
"""First bytes of every model file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFile:
    """Content of a model file.

    Attributes:
        model: The error model.
        cell: The cell it was measured in.
        archive: The file's content, with the raw numbers.
    """

    model: ErrorModel
    cell: Cell
    archive: Archive


def write_model(path: str | Path, model: ErrorModel, cell: Cell) -> None:
    """Writes the model and its cell, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    archive = model.to_archive()
    document = {**archive.document, "cell": pack_cell(cell)}
    write_archive(path, replace(archive, document=document))


def read_model(path: str | Path) -> ModelFile:
    """Returns the model and its cell.

    Raises:
        ArchiveError: Not a model file, damaged, without a cell, or from a newer robotrue.
        FormatError: The file cannot be read.
    """
    data = read_bytes(path)
    if not data.startswith(ZIP):
        raise ArchiveError(
            "not a model file.",
            source=path,
            hint="a model file is what `robotrue calibrate ... -o` writes.",
        )
    archive = archive_from(data, source=path)
    model = open_model(archive)
    stated = archive.document.get("cell")
    if not isinstance(stated, Mapping):
        raise ArchiveError(
            "holds a model but no cell.", source=path, hint="calibrate again with a cell.toml."
        )
    return ModelFile(model=model, cell=unpack_cell(stated, model.robot), archive=archive)


def pack_cell(cell: Cell) -> dict[str, object]:
    """Returns the cell as JSON values: the text of its cell.toml and the files it names."""
    text, files = portable_text(cell)
    return {
        "schema": CELL_SCHEMA,
        "source": Path(cell.source).name,
        "digest": cell.digest,
        "text": text,
        "files": {name: b64encode(data).decode() for name, data in files.items()},
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class CellDocument:
    """A cell inside a model file.

    Attributes:
        source: Name of the cell file.
        digest: SHA-256 of its bytes.
        text: The file.
        files: It names, in base 64.
    """

    source: str
    digest: str
    text: str
    files: dict[str, str]


@archive_reader
def unpack_cell(stated: Mapping[str, object], robot: RobotModel) -> Cell:
    """Returns the cell from :func:`pack_cell` and the nominal robot of the model.

    Raises:
        ArchiveError: The document is incomplete, damaged or of a newer schema.
    """
    schema = decode(int, stated.get("schema", 0), key="cell.schema")
    if not 1 <= schema <= CELL_SCHEMA:
        raise ArchiveError(
            f"cell schema {schema}, this robotrue reads up to {CELL_SCHEMA}.",
            hint="update robotrue.",
        )
    if schema == 1:
        cell = cell_of_schema_1(stated, robot)
    else:
        document = decode(CellDocument, stated, key="cell")
        files = {name: b64decode(data) for name, data in document.files.items()}
        cell = parse_cell(document.text.encode(), document.source, files=files)
        # The model states its arm; the file may name a preset that changed since.
        arm = robot.nominal().with_tool(cell.robot.T_flange_tool)
        cell = replace(cell, robot=arm, digest=document.digest)
    for name in ("T_flange_target", "T_base_frame"):
        check_pose(getattr(cell, name), name)
    check_pose(cell.robot.T_flange_tool, "T_flange_tool")
    mass, com = cell.payload.mass, cell.payload.com
    if not ((mass < 1e5).all() and (np.abs(com) < 100.0).all() and cell.target_sigma < 10.0):
        raise ArchiveError("payload or target of the cell in this model file cannot be.")
    return cell
