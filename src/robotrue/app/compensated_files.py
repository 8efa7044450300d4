"""The files of one program: compensated, and written with the identity of their model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.app.compensation_ground import Ground, ProgramFiles, open_ground, read_programs
from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.context import Context
from robotrue.app.reporting import place_in_file
from robotrue.cell.cutter_axis import cutter_axis
from robotrue.cell.part import PartFrame
from robotrue.compensation.between_targets import Between, look_between, require_no_spin
from robotrue.compensation.compensate import compensate
from robotrue.compensation.free_spin import compensate_with_spins, require_free_spin, spin_sentences
from robotrue.compensation.result import Compensation, Tally, unchanged
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.stance import sentence
from robotrue.compensation.stated_force import StatedForce, note_rigid_model, state_forces
from robotrue.compensation.step_rule import StepRule, path_sentence, steps_sentence
from robotrue.compensation.steps import Steps, job_steps, joined
from robotrue.core.arrays import Array
from robotrue.core.files import sha256, write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import StepError
from robotrue.program.formats import read_job, unfollowed, write_program
from robotrue.program.identity import ProgramIdentity, identity_path, write_identity
from robotrue.program.program import Program, Reason

PART: tuple[str, ...] = ("name", "xyz_mm", "abc_deg", "verdict")
"""What is said of the part frame a program runs in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rewritten:
    """One program that was held whole.

    Attributes:
        program: As it is written, before its targets are replaced.
        result: What became of its targets; None without a model.
        data: Bytes to write.
        counts: JSON values.
    """

    program: Program
    result: Compensation | None
    data: bytes
    counts: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The file a compensated program was made from.

    Attributes:
        name: Of the file.
        sha256: Of its bytes.
        notes: Of its reader.
        T_base_frame: (k, 4, 4) work frames its targets use.
    """

    name: str
    sha256: str
    notes: Sequence[str]
    T_base_frame: Array


def compensate_files(
    request: CompensateRequest, context: Context
) -> tuple[Mapping[str, Any], Provenance]:
    """Writes the compensated program; returns the counts as JSON values, and what they rest on.

    Raises:
        ConfigurationError: Options that do not go together, or a limit that is none.
        ModelMismatchError: A program or a part frame of another model.
        StepError: Steps in the path are too large and not allowed; nothing is written.
    """
    ground = open_ground(request, context)
    files = read_programs(request, ground, context)
    forces = state_forces(ground.force, files.programs)
    context.step("compensating", 0, 1)
    rewritten, between = _rewrite(request, ground, files.programs, forces, context)
    seen = [(r.program, r.result.status, r.result.shift) for r in rewritten if r.result is not None]
    steps = job_steps(seen) if seen else Steps()
    notes = [
        place_in_file(program.name, note)
        for program, made in zip(files.programs, rewritten, strict=True)
        for note in (*program.notes, *made.counts["notes"])
    ]
    _require_steps(ground.steps, steps, ground.programs[0].name, notes, context)
    # The longest work comes first: while it can still fail, nothing stands written.
    long, stepped = _compensate_in_blocks(request, ground, files, context)
    steps = joined([steps, stepped])
    documents = [
        _write(ground, *each, context)
        for each in zip(files.programs, files.outputs, forces, rewritten, strict=True)
    ]
    if files.long is not None:
        documents.insert(files.long.place, long)
    document = documents[0] if len(documents) == 1 else _together(documents)
    if ground.model is not None:
        document = {**document, "steps": ground.steps.document(steps)}
        _tell_each([path_sentence(steps)], [steps_sentence(steps)], context)
    if between is not None:
        document = {**document, "between_targets": between.document}
        _tell_each(between.sentences, between.left_whole, context)
        _tell_each(between.worst, [], context)
    return document, ground.provenance


def _tell_each(sentences: Iterable[str], notes: Iterable[str], context: Context) -> None:
    for text in filter(None, sentences):
        context.inform(text)
    for text in filter(None, notes):
        context.note(text)


def _require_steps(
    rule: StepRule, steps: Steps, name: str, notes: Sequence[str], context: Context
) -> None:
    """Passes if steps are small or allowed; else notes first why targets are left alone."""
    try:
        rule.require(steps, name)
    except StepError:
        _tell_each([], notes, context)
        raise


def _rewrite(
    request: CompensateRequest,
    ground: Ground,
    programs: Sequence[Program],
    forces: Sequence[StatedForce],
    context: Context,
) -> tuple[list[Rewritten], Between | None]:
    """Compensates the programs held whole, and looks between their targets where that is asked."""
    if request.free_spin:
        require_free_spin(ground.model, ground.force)
    settings = [_settings(request, ground, force) for force in forces]
    if ground.split.asked:
        require_no_spin(ground.split, request.free_spin)
        reread = partial(read_job, ground.programs, ground.table)
        between = look_between(
            ground.model, programs, settings, ground.split, lambda data: reread(instead=data)
        )
        pairs = zip(between.programs, between.results, forces, strict=True)
        return [_rewritten(*pair, {}) for pair in pairs], between
    turned = cutter_axis(ground.cell, request.cutter) if request.free_spin else None
    made: list[Rewritten] = []
    past, every = 0, sum(map(len, programs))
    for program, force, setting in zip(programs, forces, settings, strict=True):
        if ground.model is None:
            made.append(_copied(program))
        elif turned is not None:
            result, spins = compensate_with_spins(ground.model, program, setting, turned)
            made.append(_rewritten(program, result, force, {"free_spin": spins}))
        else:
            progress = partial(_step_of_all, context, past, every)
            result = compensate(ground.model, program, settings=setting, progress=progress)
            made.append(_rewritten(program, result, force, {}))
        past += len(program)
    return made, None


def _step_of_all(context: Context, past: int, every: int, text: str, done: int, of: int) -> None:
    """Reports how far one of several programs is, as a part of all of them."""
    context.step(text, past + done, every)


def _copied(program: Program) -> Rewritten:
    """A program as it is."""
    n = len(program)
    counts = {"targets": n, "compensated": 0, "unchanged": n, "status": {}, "notes": []}
    data = write_program(program, unchanged(program))
    return Rewritten(program=program, result=None, data=data, counts=counts)


def _rewritten(
    program: Program, result: Compensation, force: StatedForce, more: Mapping[str, Any]
) -> Rewritten:
    summary = result.summary()
    pushed = {"force": force.document()} if force.uses else {}
    notes = [*summary["notes"], *unfollowed(program, result.replacement)]
    return Rewritten(
        program=program,
        result=result,
        data=write_program(program, result.replacement),
        counts={**summary, **pushed, **more, "notes": notes},
    )


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


def _compensate_in_blocks(
    request: CompensateRequest, ground: Ground, files: ProgramFiles, context: Context
) -> tuple[dict[str, Any], Steps]:
    """Writes the program that goes in blocks, if there is one."""
    from robotrue.compensation.stream import compensate_stream

    found, target = files.long, files.long_output
    if found is None or target is None or ground.model is None:
        return {}, Steps()

    def accept(total: Tally) -> None:
        notes = [place_in_file(found.name, str(note)) for note in (*found.notes, *total.notes)]
        _require_steps(ground.steps, total.steps, found.name, notes, context)

    force = StatedForce(wrench=np.asarray(ground.force))
    result = compensate_stream(
        ground.model,
        found,
        ground.folder / found.name,
        target,
        settings=_settings(request, ground, force),
        workers=request.workers,
        dask=request.dask,
        progress=context.step,
        accept=accept,
    )
    beside = "moves between points beside it and its own are not looked at for steps."
    remarks = [beside] if any(len(program.path) for program in files.programs) else []
    for text in (*remarks, *result.notes):
        context.note(place_in_file(found.name, text))
    context.inform(f"{found.name}: {result.blocks} blocks by {result.workers} at a time")
    frames = found.T_base_frame[found.judged[found.judged[:, 2] == Reason.NONE, 0]]
    source = Source(name=found.name, sha256=found.sha256, notes=found.notes, T_base_frame=frames)
    document = _finish(ground, source, target, result.sha256, result.summary(), force, context)
    return document, result.tally.steps


def _write(
    ground: Ground,
    program: Program,
    target: Path,
    force: StatedForce,
    made: Rewritten,
    context: Context,
) -> dict[str, Any]:
    """Writes a program that was held whole."""
    write_atomic(target, made.data)
    source = Source(
        name=program.name,
        sha256=sha256(program.data),
        notes=program.notes,
        T_base_frame=program.T_base_frame[program.frame[program.reason == Reason.NONE]],
    )
    counts = {"route": "whole", **made.counts}
    return _finish(ground, source, target, sha256(made.data), counts, force, context)


def _finish(
    ground: Ground,
    source: Source,
    target: Path,
    digest: str,
    counts: Mapping[str, Any],
    force: StatedForce,
    context: Context,
) -> dict[str, Any]:
    """Writes the identity of a written program, by its hash, and says what was done."""
    frame, document = ground.frame, {"source": source.name, **counts}
    notes = [
        *source.notes,
        *_frame_notes(source.T_base_frame, frame),
        *note_rigid_model(force, ground.model),
    ]
    for note in notes:
        context.note(place_in_file(source.name, note))
    if ground.model is not None or frame is not None:
        identity = ProgramIdentity(
            model=ground.used,
            compensated=ground.model is not None,
            part="" if frame is None else frame.name,
            made_from=source.name,
            made_from_sha256=source.sha256,
            provenance=ground.provenance,
        )
        write_identity(target, digest, identity)
        document |= {"model": ground.used.document(), "identity": str(identity_path(target))}
    if frame is not None:
        stated = frame.document()
        document["part"] = {key: stated[key] for key in PART}
    _tell(target, document, force, context)
    return {"output": str(target), **document, "notes": [*notes, *document["notes"]]}


def _tell(target: Path, document: Mapping[str, Any], force: StatedForce, context: Context) -> None:
    """Says what was done and which targets were left alone."""
    name = document["source"]
    context.inform(
        f"{name}: {document['compensated']} of {document['targets']} targets compensated, "
        f"written to {target}"
    )
    if not document["targets"]:
        missing = "it holds no target; give what it calls, or the folder with all of it."
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


def _together(documents: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The counts of a program of several files, and each file by itself."""
    status: Counter[str] = Counter()
    for document in documents:
        status.update(document["status"])
    return {
        "output": documents[0]["output"],
        **{k: sum(d[k] for d in documents) for k in ("targets", "compensated", "unchanged")},
        "status": dict(status),
        "notes": [place_in_file(d["source"], note) for d in documents for note in d["notes"]],
        "files": list(documents),
    }


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
