"""``robotrue compensate``: a program in, the program that lands on target out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_json, say
from robotrue.cli.inputs import check_output, parse_wrench
from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import unchanged
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.units import MM
from robotrue.errors import ArchiveError, ConfigurationError
from robotrue.program.formats import read_job, write_program
from robotrue.program.program import FrameTable, Program
from robotrue.store.model_file import ZIP, read_model


def run(
    model_path: Path,
    program_path: Path,
    output: Path,
    *,
    wrench: str | None,
    axis_targets: bool,
    max_shift_mm: float,
    as_json: bool,
) -> None:
    """Writes the compensated program and says what became of each target."""
    check_output(output, [model_path, program_path])
    if not max_shift_mm > 0.0:
        raise ConfigurationError(
            f"--max-shift-mm is {max_shift_mm:g} mm, expected above 0.", hint="--max-shift-mm 10"
        )
    cell, model = _cell_and_model(model_path)
    job = read_job(program_path, frame_table(cell))
    outputs = _outputs(job, program_path, output)
    rewritten = [
        _rewritten(model, cell, program, wrench, axis_targets, max_shift_mm) for program in job
    ]
    documents = []
    for program, target, (data, document) in zip(job, outputs, rewritten, strict=True):
        for note in program.notes:
            say(f"note: {program.name}: {note}")
        write_atomic(target, data)
        documents.append({"output": str(target), **document})
        _tell(program, target, document)
    if as_json:
        emit_json(documents[0] if len(documents) == 1 else _together(documents))


def _together(documents: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The counts of a job of several files, and each file by itself."""
    status: Counter[str] = Counter()
    for document in documents:
        status.update(document["status"])
    return {
        "output": documents[0]["output"],
        **{k: sum(d[k] for d in documents) for k in ("targets", "compensated", "unchanged")},
        "status": dict(status),
        "notes": [note for document in documents for note in document["notes"]],
        "files": list(documents),
    }


def _cell_and_model(path: Path) -> tuple[Cell, ErrorModel | None]:
    """The content of a model file, or a bare cell."""
    if read_bytes(path).startswith(ZIP):
        stored = read_model(path)
        return stored.cell, stored.model
    if path.suffix.lower() == ".toml":
        return read_cell(path), None
    try:
        return read_cell(path), None
    except ConfigurationError as cause:
        raise ArchiveError(
            f"neither a model file nor a cell ({cause.message})",
            source=path,
            line=cause.line,
            hint="robotrue compensate MODEL PROGRAM -o OUT.",
        ) from cause


def _rewritten(
    model: ErrorModel | None,
    cell: Cell,
    program: Program,
    wrench: str | None,
    axis_targets: bool,
    max_shift_mm: float,
) -> tuple[bytes, Mapping[str, Any]]:
    if model is None:
        n = len(program)
        counts = {"targets": n, "compensated": 0, "unchanged": n, "status": {}, "notes": []}
        return write_program(program, unchanged(program)), counts
    settings = CompensationSettings(
        load=cell.payload,
        wrench=parse_wrench(wrench) if wrench else np.empty(0),
        axis_targets=axis_targets,
        max_shift=max_shift_mm * MM,
        covariance=True,
    )
    result = compensate(model, program, settings=settings)
    return write_program(program, result.replacement), result.summary()


def _outputs(job: Sequence[Program], source: Path, output: Path) -> list[Path]:
    """The output, and beside it one file per companion, each refused if it is a source."""
    paths = [output] + [output.with_suffix(Path(p.name).suffix) for p in job[1:]]
    originals = [source.with_name(program.name) for program in job]
    for path in paths:
        check_output(path, [source, *originals])
    return paths


def frame_table(cell: Cell) -> FrameTable:
    """Returns the frames a program falls back on."""
    return FrameTable(T_base_frame=cell.T_base_frame, T_flange_tool=cell.robot.T_flange_tool)


def _tell(program: Program, target: Path, document: Mapping[str, Any]) -> None:
    """Says on stderr what was done and which targets were left alone."""
    say(
        f"{program.name}: {document['compensated']} of {document['targets']} targets compensated, "
        f"written to {target}"
    )
    before, after = (document.get(f"predicted_error_{k}_um") for k in ("before", "after"))
    if before and after:
        say(
            f"predicted error {before['mean']:.0f} um mean, {before['max']:.0f} um max before; "
            f"the inversion leaves {after['max']:.3f} um"
        )
    sigma = document.get("predicted_sigma_um")
    if sigma:
        say(f"expected scatter about the target (1 sigma, 3-D): {sigma['mean']:.0f} um")
    for note in document["notes"]:
        say(f"note: {note}")
