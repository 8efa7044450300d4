"""``robotrue compensate``: a program in, the program that lands on target out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.calibration.identity import identity_of
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.part import PartFrame
from robotrue.cli.console import emit_json, say
from robotrue.cli.cutter import cutter_axis
from robotrue.cli.free_spin import require_free, sentences, spun
from robotrue.cli.inputs import check_output
from robotrue.cli.job_outputs import job_outputs
from robotrue.cli.long_program import Staff, compensated_in_blocks, outlined
from robotrue.cli.process_force import StatedForce, described, stated_forces, useless
from robotrue.cli.registered import opened
from robotrue.cli.split import (
    Between,
    SplitOptions,
    looked_between,
    require_no_spin,
    rereader,
)
from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import unchanged
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array
from robotrue.core.files import sha256, write_atomic
from robotrue.core.identity import ModelIdentity
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.formats import read_job, unfollowed, write_program
from robotrue.program.identity import (
    ProgramIdentity,
    identity_path,
    require_compensable,
    write_identity,
)
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.robot.statics import NO_LOAD


def run(
    model_path: Path,
    program_path: Path | Sequence[Path],
    output: Path,
    *,
    registered: Path | None,
    part: str | None,
    wrench: str | None,
    axis_targets: bool,
    max_shift_mm: float,
    as_json: bool,
    force: Path | None = None,
    cutter: str | None = None,
    free_spin: bool = False,
    workers: int | None = None,
    dask: str | None = None,
    split: SplitOptions | None = None,
) -> None:
    """Writes the compensated program and says what became of each target."""
    document = compensated(
        model_path,
        program_path,
        output,
        registered=registered,
        part=part,
        wrench=wrench,
        axis_targets=axis_targets,
        max_shift_mm=max_shift_mm,
        force=force,
        cutter=cutter,
        free_spin=free_spin,
        workers=workers,
        dask=dask,
        split=split,
    )
    if as_json:
        emit_json(document)


def compensated(
    model_path: Path,
    program_path: Path | Sequence[Path],
    output: Path,
    *,
    registered: Path | None,
    part: str | None,
    wrench: str | None,
    axis_targets: bool,
    max_shift_mm: float,
    force: Path | None = None,
    cutter: str | None = None,
    free_spin: bool = False,
    workers: int | None = None,
    dask: str | None = None,
    split: SplitOptions | None = None,
) -> dict[str, Any]:
    """Writes the compensated program; returns the counts as JSON values."""
    programs = [program_path] if isinstance(program_path, Path) else list(program_path)
    read = [p for p in (model_path, *programs, registered, force) if p is not None]
    check_output(output, read, folder=True)
    if not max_shift_mm > 0.0:
        raise ConfigurationError(
            f"--max-shift-mm is {max_shift_mm:g} mm, expected above 0.", hint="--max-shift-mm 10"
        )
    cell, model = opened(model_path, registered)
    frame = None if cell.part is None else cell.part.frame(part)
    if frame is not None:
        cell = replace(cell, T_base_frame=frame.T_base_part)
    elif part is not None:
        raise ConfigurationError(
            f"--part {part!r}, but the cell is not registered.",
            source=registered or model_path,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    used = identity_of(model or cell.robot)
    stated = described(cell, wrench, force, cutter)
    table, staff = frame_table(cell), Staff(workers=workers, dask=dask)
    asks = [(force is not None, "--force"), (free_spin, "--free-spin"), (model is None, "no model")]
    asks += [(True, split.named)] if split else []
    if model is not None:
        asks.append((model.mean_tables(NO_LOAD) is None, "a model without flat tables"))
    why_whole = ", ".join(what for asked, what in asks if asked)
    alone = len(programs) == 1 and not programs[0].is_dir()
    found = outlined(programs[0], table, staff, why_whole=why_whole) if alone else None
    job = read_job(programs, table) if found is None else found.companions
    files = [(program.name, sha256(program.data)) for program in job]
    if found is not None:
        files.insert(found.place, (found.name, found.sha256))
    folder = programs[0] if programs[0].is_dir() else programs[0].parent
    language = job[0].dialect if found is None else found.dialect
    outputs = job_outputs([name for name, _ in files], folder, output, language)
    for name, digest in files:
        require_compensable(folder / name, digest, used)
    if free_spin:
        require_free(model, stated)
    forces = stated_forces(stated, job)
    turned = cutter_axis(cell, cutter) if free_spin else None
    between: Between | None = None
    if split:
        guards = [_settings(cell, pushed, axis_targets, max_shift_mm) for pushed in forces]
        require_no_spin(split, free_spin)
        between = looked_between(model, job, guards, split, rereader(programs, table))
        rewritten = between.written([pushed.uses and pushed.document() for pushed in forces])
    else:
        rewritten = [
            _rewritten(model, cell, program, pushed, axis_targets, max_shift_mm, turned)
            for program, pushed in zip(job, forces, strict=True)
        ]
    finished = partial(_finished, used=used, model=model, frame=frame)
    documents, extra = [], {}
    if found is not None and model is not None:  # the longest work first: nothing stands before it
        pushed, long = StatedForce(wrench=np.asarray(stated)), outputs.pop(found.place)
        in_use = found.T_base_frame[found.judged[found.judged[:, 2] == Reason.NONE, 0]]
        _remark(found.name, [*_frame_notes(in_use, frame), *useless(pushed, model)])
        settings = _settings(cell, pushed, axis_targets, max_shift_mm)
        made = compensated_in_blocks(model, found, folder / found.name, long, settings, staff)
        extra = finished((found.name, found.sha256), long, *made, pushed)
    for program, target, pushed, (data, document) in zip(
        job, outputs, forces, rewritten, strict=True
    ):
        in_use = program.T_base_frame[program.frame[program.reason == Reason.NONE]]
        notes = [*program.notes, *_frame_notes(in_use, frame), *useless(pushed, model)]
        _remark(program.name, notes)
        write_atomic(target, data)
        document = {"route": "whole", **document}
        source = (program.name, sha256(program.data))
        documents.append(finished(source, target, sha256(data), document, pushed))
    if found is not None:
        documents.insert(found.place, extra)
    whole = documents[0] if len(documents) == 1 else _together(documents)
    return whole if between is None else {**whole, "between_targets": between.told()}


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


def _remark(name: str, notes: Sequence[str]) -> None:
    for note in notes:
        say(f"note: {name}: {note}")


def _frame_notes(in_use: Array, frame: PartFrame | None) -> list[str]:
    """What to say of work frames (k, 4, 4) that are not the registered part frame."""
    if frame is None:
        return []
    notes = []
    if frame.verdict != "GO":
        notes.append(f"part frame {frame.name!r} is {frame.verdict}: do not cut before it is not.")
    away = in_use - frame.T_base_part
    own = away[np.abs(away).max(axis=(1, 2), initial=0.0) > 1e-7]
    if len(own):
        far = float(np.linalg.norm(own[:, :3, 3], axis=1).max())
        notes.append(
            f"sets a work frame of its own, {far / MM:.3f} mm from part frame {frame.name!r}; "
            "its own is used."
        )
    return notes


def _finished(
    source: tuple[str, str],
    target: Path,
    digest: str,
    document: Mapping[str, Any],
    force: StatedForce,
    *,
    used: ModelIdentity,
    model: ErrorModel | None,
    frame: PartFrame | None,
) -> dict[str, Any]:
    """Writes the identity of a written program (by name and hash) and says what was done."""
    if model is not None or frame is not None:
        made = ProgramIdentity(
            model=used,
            compensated=model is not None,
            part="" if frame is None else frame.name,
            made_from=source[0],
            made_from_sha256=source[1],
        )
        write_identity(target, digest, made)
        document = {**document, **_identity_document(made, frame, target)}
    _tell(source[0], target, document, force)
    return {"output": str(target), **document}


def _identity_document(
    made: ProgramIdentity, frame: PartFrame | None, target: Path
) -> dict[str, Any]:
    out: dict[str, Any] = {
        "model": made.model.document(),
        "identity": str(identity_path(target)),
    }
    if frame is not None:
        T = frame.T_base_part
        out["part"] = {
            "name": frame.name,
            "xyz_mm": (T[:3, 3] / MM).tolist(),
            "abc_deg": (abc_from_matrix(T[:3, :3]) / DEG).tolist(),
            "verdict": frame.verdict,
        }
    return out


def _rewritten(
    model: ErrorModel | None,
    cell: Cell,
    program: Program,
    force: StatedForce,
    axis_targets: bool,
    max_shift_mm: float,
    turned: Array | None,
) -> tuple[bytes, Mapping[str, Any]]:
    if model is None:
        n = len(program)
        counts = {"targets": n, "compensated": 0, "unchanged": n, "status": {}, "notes": []}
        return write_program(program, unchanged(program)), counts
    settings = _settings(cell, force, axis_targets, max_shift_mm)
    if turned is None:
        result, won = compensate(model, program, settings=settings), {}
    else:
        result, spins = spun(model, program, settings, turned)
        won = {"free_spin": spins}
    summary = {**result.summary(), **({"force": force.document()} if force.uses else {}), **won}
    summary["notes"] = [*summary["notes"], *unfollowed(program, result.replacement)]
    return write_program(program, result.replacement), summary


def _settings(
    cell: Cell, force: StatedForce, axis_targets: bool, max_shift_mm: float
) -> CompensationSettings:
    return CompensationSettings(
        load=cell.payload,
        wrench=force.wrench,
        axis_targets=axis_targets,
        max_shift=max_shift_mm * MM,
        covariance=True,
    )


def frame_table(cell: Cell) -> FrameTable:
    """Returns the frames a program falls back on, and those it names."""
    named = () if cell.part is None else cell.part.frames
    return replace(
        cell.controller,
        external=tuple(_carrying(axis, cell) for axis in cell.controller.external),
        T_base_frame=cell.T_base_frame,
        T_flange_tool=cell.robot.T_flange_tool,
        bases={**cell.controller.bases, **{frame.name: frame.T_base_part for frame in named}},
    )


def _carrying(axis: ExternalAxis, cell: Cell) -> ExternalAxis:
    """The axis, with the default work frame on it where that is a part frame it carries."""
    carried = {name.lower() for name in axis.frames}
    parts = () if cell.part is None else cell.part.frames
    mine = [part.T_base_part for part in parts if part.name.lower() in carried]
    if any(np.array_equal(T, cell.T_base_frame) for T in mine):
        return replace(axis, frames=(*axis.frames, "base"))
    return axis


def _tell(name: str, target: Path, document: Mapping[str, Any], force: StatedForce) -> None:
    """Says on stderr what was done and which targets were left alone."""
    say(
        f"{name}: {document['compensated']} of {document['targets']} targets compensated, "
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
    for sentence in [*force.sentences(), *sentences(document.get("free_spin"))]:
        say(sentence)
    for note in document["notes"]:
        say(f"note: {note}")
