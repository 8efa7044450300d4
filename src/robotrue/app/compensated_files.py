"""The files of one program: compensated, and written with the identity of their model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robotrue.app.compensated_job import Counts, FileResult, common_notes, report_job
from robotrue.app.compensation_ground import Ground, open_ground, open_programs
from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.context import Context
from robotrue.app.presentation import PlainResult
from robotrue.app.reporting import place_in_file
from robotrue.cell.cell import cutter_axis
from robotrue.cell.part import PartFrame
from robotrue.compensation.between_targets import Between, look_between, require_no_spin
from robotrue.compensation.compensate_file import CompensatedFile, compensate_file
from robotrue.compensation.frame_correction import FrameCorrection, fit_frames
from robotrue.compensation.process_force import (
    DescribedForce,
    StatedForce,
    note_rigid_model,
    state_forces,
)
from robotrue.compensation.redundancy import compensate_with_spins, require_free_spin
from robotrue.compensation.redundancy_result import spin_sentences
from robotrue.compensation.result import Compensation, zero_correction
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.stance import sentence
from robotrue.compensation.status import list_left_alone
from robotrue.compensation.steps import (
    NO_STEPS,
    Steps,
    job_steps,
    join_steps,
    path_sentence,
    steps_sentence,
)
from robotrue.core.arrays import Array
from robotrue.core.files import atomic_stream, sha256
from robotrue.core.units import MM
from robotrue.errors import StepError
from robotrue.program.formats import read_job, write_program
from robotrue.program.identity import ProgramIdentity, identity_path, write_identity
from robotrue.program.program import Program
from robotrue.program.program_file import ProgramFile

PART: tuple[str, ...] = ("name", "xyz_mm", "abc_deg", "verdict")
"""Reported keys of the part frame of a program."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rewritten:
    """One file of a program whose new bytes are written; they have no name yet.

    Attributes:
        sha256: Of the bytes.
        counts: JSON values.
        notes: Notes of the reader besides those of the file.
        steps: Of the file by itself.
        held: The program with what became of its targets; None of a file that is cut, or without a
            model.
    """

    sha256: str
    counts: Counts
    notes: tuple[str, ...] = ()
    steps: Steps = NO_STEPS
    held: tuple[Program, Compensation] | None = None


def compensate_files(request: CompensateRequest, context: Context) -> PlainResult:
    """Writes the compensated program; returns the counts, and of several programs their tables.

    Raises:
        ConfigurationError: Options that do not go together, or an invalid limit.
        ModelMismatchError: A program or a part frame of another model.
        StepError: Steps in the path are too large and not allowed; nothing is written.
    """
    ground = open_ground(request, context)
    files, outputs = open_programs(request, ground, context)
    forces = _forces(ground, files)
    context.step("compensating", 0, 1)
    with ExitStack() as open_outputs:  # an output still open after a failure gets no name
        stacks = [open_outputs.enter_context(ExitStack()) for _ in outputs]
        streams = [
            stack.enter_context(atomic_stream(path))
            for stack, path in zip(stacks, outputs, strict=True)
        ]
        rewritten, between = _rewrite(request, ground, files, forces, streams, context)
        steps = _join_files(rewritten)
        frames = [] if request.free_spin else _fit_frames(ground, rewritten)
        _tell_each([], [place_in_file(each.program, each.sentence()) for each in frames], context)
        _require_steps(ground, files, rewritten, steps, context)
        report = None
        if ground.model is not None:
            report = report_job(_file_results(files, rewritten, steps))
        reporter = context if report is None or request.verbose else None
        documents = []
        for file, target, force, made, stack in zip(
            files, outputs, forces, rewritten, stacks, strict=True
        ):
            stack.close()
            documents.append(_finish(ground, file, target, force, made, reporter))
    document = documents[0] if len(documents) == 1 else _together(documents)
    if report is not None:
        document |= report.document()
        if reporter is None:
            notes = [(str(each["source"]), note) for each in documents for note in each["notes"]]
            _tell_each([], common_notes(notes), context)
    if ground.model is not None:
        document = {**document, "steps": ground.steps.document(steps)}
        _tell_each([path_sentence(steps)], [steps_sentence(steps)], context)
    if frames:
        document = {**document, "frame_corrections": [each.document() for each in frames]}
    if between is not None:
        document = {**document, "between_targets": between.document}
        _tell_each(between.sentences, between.left_whole, context)
        _tell_each(between.worst, [], context)
    shown = () if report is None else report.blocks()
    return PlainResult(values=document, shown=shown, provenance=ground.provenance)


def _file_results(
    files: Sequence[ProgramFile], rewritten: Sequence[Rewritten], steps: Steps
) -> list[FileResult]:
    return [
        FileResult(
            name=file.name,
            language=file.dialect,
            counts=made.counts,
            path=steps.by_file.get(file.name, (0.0, 0.0)),
            held=made.held,
        )
        for file, made in zip(files, rewritten, strict=True)
    ]


def _forces(ground: Ground, files: Sequence[ProgramFile]) -> list[StatedForce]:
    """Returns the force on every file; a described one needs programs that are held whole."""
    if isinstance(ground.force, DescribedForce):
        return state_forces(ground.force, [file.held for file in files if file.held is not None])
    return [StatedForce(wrench=np.asarray(ground.force)) for _ in files]


def _tell_each(sentences: Iterable[str], notes: Iterable[str], context: Context) -> None:
    for text in filter(None, sentences):
        context.inform(text)
    for text in filter(None, notes):
        context.note(text)


def _join_files(rewritten: Sequence[Rewritten]) -> Steps:
    """Returns the steps of a job; programs that are held may be one text, as those of KRL are."""
    if len(rewritten) == 1:
        return rewritten[0].steps
    held = [made.held for made in rewritten if made.held is not None]
    seen = [(program, result.status, result.shift) for program, result in held]
    cut = [made.steps for made in rewritten if made.held is None]
    return join_steps([job_steps(seen), *cut] if seen else cut)


def _fit_frames(ground: Ground, rewritten: Sequence[Rewritten]) -> list[FrameCorrection]:
    """Returns what a corrected work frame would do for the targets that are computed."""
    held = [made.held for made in rewritten if made.held is not None]
    return [each for program, result in held for each in fit_frames(program, result, ground.table)]


def _require_steps(
    ground: Ground,
    files: Sequence[ProgramFile],
    rewritten: Sequence[Rewritten],
    steps: Steps,
    context: Context,
) -> None:
    """Raises if steps exceed the limit and are not allowed; reports first why targets stay."""
    try:
        ground.steps.require(steps, ground.programs[0].name)
    except StepError:
        for file, made in zip(files, rewritten, strict=True):
            notes = [*file.notes, *made.notes, *made.counts["notes"]]
            _tell_each([], [place_in_file(file.name, note) for note in notes], context)
        raise


def _rewrite(
    request: CompensateRequest,
    ground: Ground,
    files: Sequence[ProgramFile],
    forces: Sequence[StatedForce],
    streams: Sequence[BinaryIO],
    context: Context,
) -> tuple[list[Rewritten], Between | None]:
    """Compensates the files and, if requested, examines the moves between their targets."""
    if request.free_spin:
        require_free_spin(ground.model, ground.force)
    settings = [_settings(request, ground, force) for force in forces]
    if ground.split.asked:
        require_no_spin(ground.split, request.free_spin)
        reread = partial(read_job, ground.programs, ground.table)
        held = [file.held for file in files if file.held is not None]
        between = look_between(
            ground.model, held, settings, ground.split, lambda data: reread(instead=data)
        )
        pairs = zip(between.programs, between.results, forces, streams, strict=True)
        return [_write_held(*pair, {}) for pair in pairs], between
    turned = cutter_axis(ground.cell, request.cutter) if request.free_spin else None
    made: list[Rewritten] = []
    past, every = 0, sum(file.targets for file in files)
    for file, force, setting, stream in zip(files, forces, settings, streams, strict=True):
        if ground.model is None:
            made.append(_copy(file, stream))
        elif turned is not None and file.held is not None:
            result, spins = compensate_with_spins(ground.model, file.held, setting, turned)
            made.append(_write_held(file.held, result, force, stream, {"free_spin": spins}))
        else:
            progress = partial(_step_of_all, context, past, every)
            done = compensate_file(
                ground.model, file, ground.folder / file.name, stream, settings=setting,
                workers=request.workers, dask=request.dask, progress=progress,
            )  # fmt: skip
            made.append(_rewritten(file, done, force, files, context))
        past += file.targets
    return made, None


def _step_of_all(context: Context, past: int, every: int, text: str, done: int, of: int) -> None:
    """Reports the progress of one of several programs, as a part of all of them."""
    context.step(text, past + done, every)


def _copy(file: ProgramFile, stream: BinaryIO) -> Rewritten:
    """Writes a program as it is."""
    data = b"" if file.held is None else write_program(file.held, zero_correction(file.held))
    stream.write(data)
    counts = {
        "targets": file.targets, "compensated": 0, "unchanged": file.targets, "status": {},
        "notes": [],
    }  # fmt: skip
    return Rewritten(sha256=sha256(data), counts={"route": "whole", **counts})


def _rewritten(
    file: ProgramFile,
    result: CompensatedFile,
    force: StatedForce,
    files: Sequence[ProgramFile],
    context: Context,
) -> Rewritten:
    """Returns what the compensation of a file came to."""
    if file.held is not None and result.held is not None:
        held = (file.held, result.held)
        counts = _counts(result.summary(), force) | _name_left_alone(file.held, result.held)
        steps = result.tally.steps
        return Rewritten(sha256=result.sha256, counts=counts, steps=steps, held=held)
    beside = "moves between points next to it and its points are not checked for steps."
    remarks = [beside] if any(f.held is not None and len(f.held.path) for f in files) else []
    for text in (*remarks, *result.notes):
        context.note(place_in_file(file.name, text))
    context.inform(f"{file.name}: {result.chunks} blocks by {result.workers} at a time")
    return Rewritten(
        sha256=result.sha256,
        counts=result.summary(),
        notes=tuple(each.sentence(file.name) for each in result.noted),
        steps=result.tally.steps,
    )


def _write_held(
    program: Program,
    result: Compensation,
    force: StatedForce,
    stream: BinaryIO,
    more: Mapping[str, object],
) -> Rewritten:
    """Writes a program that was compensated as a whole."""
    data = write_program(program, result.replacement)
    stream.write(data)
    tally = result.tally(program)
    counts = {"route": "whole", **_counts(tally.summary(), force), **more}
    counts |= _name_left_alone(program, result)
    held = (program, result)
    return Rewritten(sha256=sha256(data), counts=counts, steps=tally.steps, held=held)


def _name_left_alone(program: Program, result: Compensation) -> dict[str, object]:
    """Returns the targets that keep their numbers, one by one; no key where there are none."""
    left = list_left_alone(program, result.status)
    return {"left_alone": left} if left else {}


def _counts(summary: Mapping[str, object], force: StatedForce) -> dict[str, object]:
    return {**summary, "force": force.document()} if force.uses else dict(summary)


def _settings(
    request: CompensateRequest, ground: Ground, force: StatedForce
) -> CompensationSettings:
    return CompensationSettings(
        load=ground.cell.payload,
        wrench=force.wrench,
        home=ground.home,
        axis_targets=request.axis_targets,
        max_shift=request.max_shift_mm * MM,
        covariance=True,
    )


def _finish(
    ground: Ground,
    file: ProgramFile,
    target: Path,
    force: StatedForce,
    made: Rewritten,
    context: Context | None,
) -> dict[str, Any]:
    """Writes the identity of a written program, by its hash, and reports to a context, if any."""
    frame, document = ground.frame, {"source": file.name, **made.counts}
    notes = [
        *file.notes,
        *made.notes,
        *_frame_notes(file.frames_in_use, frame),
        *note_rigid_model(force, ground.model),
    ]
    if ground.model is not None or frame is not None:
        identity = ProgramIdentity(
            model=ground.used,
            compensated=ground.model is not None,
            part="" if frame is None else frame.name,
            made_from=file.name,
            made_from_sha256=file.sha256,
            provenance=ground.provenance,
        )
        write_identity(target, made.sha256, identity)
        document |= {"model": ground.used.document(), "identity": str(identity_path(target))}
    if frame is not None:
        stated = frame.document()
        document["part"] = {key: stated[key] for key in PART}
    if context is not None:
        _tell_each([], [place_in_file(file.name, note) for note in notes], context)
        _tell(target, document, force, context)
    return {"output": str(target), **document, "notes": [*notes, *document["notes"]]}


def _tell(target: Path, document: Counts, force: StatedForce, context: Context) -> None:
    """Reports the compensation and the targets left alone."""
    name = document["source"]
    context.inform(
        f"{name}: {document['compensated']} of {document['targets']} targets compensated, "
        f"written to {target}"
    )
    if not document["targets"]:
        missing = "it holds no target; give the programs it calls, or the folder of all files."
        context.note(place_in_file(name, missing))
    sentences = []
    before, after = (document.get(f"predicted_error_{k}_um") for k in ("before", "after"))
    if before and after:
        sentences.append(
            f"predicted error {before['mean']:.0f} um mean, {before['max']:.0f} um max before; "
            f"the inversion leaves {after['max']:.3f} um"
        )
    sigma, won = document.get("predicted_sigma_um"), document.get("free_spin")
    if sigma:
        sentences.append(
            f"expected scatter about the target (1 sigma, 3-D): {sigma['mean']:.0f} um"
        )
    if document.get("configuration") is not None:
        sentences.append(sentence(document["configuration"]))
    sentences += force.sentences()
    if won is not None:
        sentences += spin_sentences(won)
    _tell_each(sentences, [*(won["notes"] if won else ()), *document["notes"]], context)


def _together(documents: Sequence[Counts]) -> dict[str, Any]:
    """The counts of a program of several files, and each file by itself."""
    status: Counter[str] = Counter()
    left = [each for document in documents for each in document.get("left_alone", ())]
    for document in documents:
        status.update(document["status"])
    return {
        "output": documents[0]["output"],
        **{k: sum(d[k] for d in documents) for k in ("targets", "compensated", "unchanged")},
        "status": dict(status),
        "notes": [place_in_file(d["source"], note) for d in documents for note in d["notes"]],
        "files": list(documents),
        **({"left_alone": left} if left else {}),
    }


def _frame_notes(in_use: Array, frame: PartFrame | None) -> list[str]:
    """Returns warnings about work frames (k, 4, 4) other than the registered part frame."""
    if frame is None:
        return []
    notes = []
    if frame.verdict != "GO":
        notes.append(f"part frame {frame.name!r} is {frame.verdict}: do not cut with it.")
    away = in_use - frame.T_base_part
    own = away[np.abs(away).max(axis=(1, 2), initial=0.0) > 1e-7]
    if len(own):
        far = float(np.linalg.norm(own[:, :3, 3], axis=1).max())
        notes.append(
            f"sets a work frame {far / MM:.3f} mm from part frame {frame.name!r}; the program's "
            "frame is used."
        )
    return notes
