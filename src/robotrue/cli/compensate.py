"""``robotrue compensate``: a program in, the program that lands on target out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from robotrue.app.force_options import read_force_options
from robotrue.app.job_outputs import job_outputs
from robotrue.app.outputs import check_output
from robotrue.app.registered import opened, provenance_used
from robotrue.calibration.identity import identity_of
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.cell import Cell
from robotrue.cell.cutter_axis import cutter_axis
from robotrue.cell.frame_table import frame_table
from robotrue.cell.part import PartFrame
from robotrue.cli.console import emit_json, remark, say, say_mark
from robotrue.cli.free_spin import require_free, sentences, spun
from robotrue.cli.long_program import ALONE, Staff, compensated_in_blocks, outlined
from robotrue.cli.split import (
    NOT_SPLIT,
    Between,
    SplitOptions,
    looked_between,
    require_no_spin,
    rereader,
)
from robotrue.cli.steps import StepRule, say_steps
from robotrue.compensation.compensate import compensate
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.result import Compensation, unchanged
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.stance import sentence, start_joints
from robotrue.compensation.stated_force import StatedForce, note_rigid_model, state_forces
from robotrue.compensation.steps import Steps, job_steps, joined
from robotrue.core.arrays import Array, IntArray
from robotrue.core.files import sha256, write_atomic
from robotrue.core.identity import ModelIdentity
from robotrue.core.progress import Progress, unheard
from robotrue.core.provenance import marked_document, provenance_from
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, StepError
from robotrue.program.formats import read_job, unfollowed, write_program
from robotrue.program.identity import (
    ProgramIdentity,
    identity_path,
    require_compensable,
    write_identity,
)
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.program.stream import Outline
from robotrue.robot.statics import NO_LOAD

Seen: TypeAlias = tuple[Program, IntArray, Array]
"""A program with the status (n,) and the shift (n, 3) m of its targets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What is asked of ``robotrue compensate``.

    Attributes:
        model: Model file or cell.
        programs: Program files of one job, or its folder.
        output: File or folder to write.
        registered: Cell with the frames that are wanted.
        part: Part frame the program runs in.
        wrench: ``FX,FY,FZ[,MX,MY,MZ]``.
        force: Description of the process force along the path.
        cutter: Axis of the tool from spindle to tip.
        start: ``A1,..,A6`` in deg, where the arm is before the first target.
        free_spin: Choose the rotation about the tool axis.
        axis_targets: Compensate axis targets, too.
        max_shift_mm: Largest correction.
        split: What is asked between the targets.
        staff: Who does long programs.
        steps: What is allowed between targets left alone and compensated ones.
    """

    model: Path
    programs: tuple[Path, ...]
    output: Path
    registered: Path | None = None
    part: str | None = None
    wrench: str | None = None
    force: Path | None = None
    cutter: str | None = None
    start: str | None = None
    free_spin: bool = False
    axis_targets: bool = False
    max_shift_mm: float = 10.0
    split: SplitOptions = NOT_SPLIT
    staff: Staff = ALONE
    steps: StepRule = field(default_factory=StepRule)

    @property
    def folder(self) -> Path:
        """Where the programs lie."""
        return self.programs[0] if self.programs[0].is_dir() else self.programs[0].parent

    def why_whole(self, model: ErrorModel | None) -> str:
        """What asks for the whole program at once; empty if nothing does."""
        asks = [
            (self.force is not None, "--force"),
            (self.free_spin, "--free-spin"),
            (bool(self.split), self.split.named),
            (model is None, "no model"),
            (
                model is not None and model.mean_tables(NO_LOAD) is None,
                "a model without flat tables",
            ),
        ]
        return ", ".join(what for asked, what in asks if asked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """What a request rests on: its files opened, its frame chosen."""

    cell: Cell
    model: ErrorModel | None
    frame: PartFrame | None
    used: ModelIdentity
    stated: Array | DescribedForce
    table: FrameTable
    home: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """The programs held whole, the one that goes in blocks, and where each is written."""

    programs: tuple[Program, ...]
    long: Outline | None
    outputs: tuple[Path, ...]
    long_output: Path | None


def run(request: Request, *, as_json: bool) -> None:
    """Writes the compensated program and says what became of each target."""
    document = compensated(request)
    say_mark(provenance_from(document["provenance"]))
    if as_json:
        emit_json(document)


def compensated(request: Request, *, told: Progress = unheard) -> dict[str, Any]:
    """Writes the compensated program; returns the counts as JSON values.

    Args:
        request: What is asked.
        told: How far it is, in targets or blocks.
    """
    ground = _ground(request)
    job = _job(request, ground)
    forces = state_forces(ground.stated, job.programs)
    rewritten, between, seen = _rewritten(request, ground, job, forces, told)
    steps = job_steps(seen) if seen else Steps()
    _require_steps(request, job, steps, [document for _, document in rewritten])
    # The longest work comes first: while it can still fail, nothing stands written.
    long, stepped = _in_blocks(request, ground, job, told)
    steps = joined([steps, stepped])
    documents = [
        _whole(ground, *each)
        for each in zip(job.programs, job.outputs, forces, rewritten, strict=True)
    ]
    if job.long is not None:
        documents.insert(job.long.place, long)
    document = documents[0] if len(documents) == 1 else _together(documents)
    if ground.model is not None:
        document = {**document, "steps": request.steps.document(steps)}
        say_steps(document["steps"], steps)
    document = marked_document(document, provenance_used(ground.cell, ground.model))
    return document if between is None else {**document, "between_targets": between.told()}


def _require_steps(
    request: Request, job: Job, steps: Steps, documents: Sequence[Mapping[str, Any]]
) -> None:
    """Passes if steps are small or allowed; else says first why targets are left alone."""
    try:
        request.steps.require(steps, request.programs[0].name)
    except StepError:
        for program, document in zip(job.programs, documents, strict=True):
            for note in program.notes:
                remark(program.name, note)
            for note in document["notes"]:
                remark(program.name, note)
        raise


def _ground(request: Request) -> Ground:
    read = [request.model, *request.programs, request.registered, request.force]
    check_output(request.output, [p for p in read if p is not None], folder=True)
    if not request.max_shift_mm > 0.0:
        raise ConfigurationError(
            f"--max-shift-mm is {request.max_shift_mm:g} mm, expected above 0.",
            hint="--max-shift-mm 10",
        )
    cell, model = opened(request.model, request.registered)
    frame = None if cell.part is None else cell.part.frame(request.part)
    if frame is not None:
        cell = replace(cell, T_base_frame=frame.T_base_part)
    elif request.part is not None:
        raise ConfigurationError(
            f"--part {request.part!r}, but the cell is not registered.",
            source=request.registered or request.model,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    return Ground(
        cell=cell,
        model=model,
        frame=frame,
        used=identity_of(model or NominalModel(robot=cell.robot)),
        stated=read_force_options(cell, request.wrench, request.force, request.cutter),
        table=frame_table(cell),
        home=start_joints(cell.robot, cell.controller.start, request.start),
    )


def _job(request: Request, ground: Ground) -> Job:
    """Reads the programs; none may be compensated already, or belong to another model."""
    given = list(request.programs)
    alone = len(given) == 1 and not given[0].is_dir()
    why = request.why_whole(ground.model)
    long = outlined(given[0], ground.table, request.staff, why_whole=why) if alone else None
    programs = read_job(given, ground.table) if long is None else long.companions
    files = [(program.name, sha256(program.data)) for program in programs]
    if long is not None:
        files.insert(long.place, (long.name, long.sha256))
    language = programs[0].dialect if long is None else long.dialect
    names = [name for name, _ in files]
    outputs = list(job_outputs(names, request.folder, request.output, language))
    known = [
        require_compensable(request.folder / name, digest, ground.used, copies=outputs[0].parent)
        for name, digest in files
    ]
    if ground.model is not None and not any(known):
        say(
            f"{', '.join(names[:3])}: no identity file beside; taken as not compensated before. "
            "A copy of a compensated program would be corrected twice."
        )
    long_output = None if long is None else outputs.pop(long.place)
    return Job(programs=tuple(programs), long=long, outputs=tuple(outputs), long_output=long_output)


def _rewritten(
    request: Request,
    ground: Ground,
    job: Job,
    forces: Sequence[StatedForce],
    told: Progress,
) -> tuple[list[tuple[bytes, Mapping[str, Any]]], Between | None, list[Seen]]:
    """Bytes and counts of every program held whole, what was seen between targets, the targets."""
    if request.free_spin:
        require_free(ground.model, ground.stated)
    if request.split:
        require_no_spin(request.split, request.free_spin)
        guards = [_settings(request, ground, pushed) for pushed in forces]
        reread = rereader(list(request.programs), ground.table)
        between = looked_between(ground.model, job.programs, guards, request.split, reread)
        made = between.written([pushed.uses and pushed.document() for pushed in forces])
        both = zip(between.programs, between.results, strict=True)
        return list(made), between, [(one, made.status, made.shift) for one, made in both]
    turned = cutter_axis(ground.cell, request.cutter) if request.free_spin else None
    every = sum(map(len, job.programs))
    made, seen, past = [], [], 0
    for program, pushed in zip(job.programs, forces, strict=True):
        part = partial(_of_all, told, past, every)
        data, document, result = _compensated_whole(request, ground, program, pushed, turned, part)
        made.append((data, document))
        if result is not None:
            seen.append((program, result.status, result.shift))
        past += len(program)
    return made, None, seen


def _of_all(told: Progress, past: int, every: int, text: str, done: int, of: int) -> None:
    """Tells how far one of several programs is, as a part of all of them."""
    told(text, past + done, every)


def _in_blocks(
    request: Request, ground: Ground, job: Job, told: Progress
) -> tuple[dict[str, Any], Steps]:
    """Writes the program that goes in blocks, if there is one."""
    found, target = job.long, job.long_output
    if found is None or target is None or ground.model is None:
        return {}, Steps()
    pushed = StatedForce(wrench=np.asarray(ground.stated))
    in_use = found.T_base_frame[found.judged[found.judged[:, 2] == Reason.NONE, 0]]
    beside = "moves between points beside it and its own are not looked at for steps."
    notes = [*_frame_notes(in_use, ground.frame), *note_rigid_model(pushed, ground.model)]
    for note in [*([beside] if any(len(p.path) for p in job.programs) else []), *notes]:
        remark(found.name, note)
    settings = _settings(request, ground, pushed)
    digest, document, steps = compensated_in_blocks(
        ground.model, found, request.folder / found.name, target, settings, request.staff,
        request.steps, told,
    )  # fmt: skip
    made = _finished(ground, (found.name, found.sha256), target, digest, document, pushed)
    return {**made, "notes": [*found.notes, *notes, *made["notes"]]}, steps


def _whole(
    ground: Ground,
    program: Program,
    target: Path,
    force: StatedForce,
    made: tuple[bytes, Mapping[str, Any]],
) -> dict[str, Any]:
    """Writes a program that was held whole."""
    data, document = made
    in_use = program.T_base_frame[program.frame[program.reason == Reason.NONE]]
    notes = [
        *program.notes,
        *_frame_notes(in_use, ground.frame),
        *note_rigid_model(force, ground.model),
    ]
    for note in notes:
        remark(program.name, note)
    write_atomic(target, data)
    source = (program.name, sha256(program.data))
    document = {"route": "whole", **document}
    told = _finished(ground, source, target, sha256(data), document, force)
    return {**told, "notes": [*notes, *told["notes"]]}


def _together(documents: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The counts of a job of several files, and each file by itself."""
    status: Counter[str] = Counter()
    for document in documents:
        status.update(document["status"])
    return {
        "output": documents[0]["output"],
        **{k: sum(d[k] for d in documents) for k in ("targets", "compensated", "unchanged")},
        "status": dict(status),
        "notes": [note for document in documents for note in _placed(document)],
        "files": list(documents),
    }


def _placed(document: Mapping[str, Any]) -> list[str]:
    """The notes of one file of several, each with its name."""
    name = document["source"]
    return [n if n.startswith(f"{name}:") else f"{name}: {n}" for n in document["notes"]]


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
    ground: Ground,
    source: tuple[str, str],
    target: Path,
    digest: str,
    document: Mapping[str, Any],
    force: StatedForce,
) -> dict[str, Any]:
    """Writes the identity of a written program (by name and hash) and says what was done."""
    frame = ground.frame
    if ground.model is not None or frame is not None:
        made = ProgramIdentity(
            model=ground.used,
            compensated=ground.model is not None,
            part="" if frame is None else frame.name,
            made_from=source[0],
            made_from_sha256=source[1],
            provenance=provenance_used(ground.cell, ground.model),
        )
        write_identity(target, digest, made)
        document = {**document, **_identity_document(made, frame, target)}
    document = {"source": source[0], **document}
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


def _compensated_whole(
    request: Request,
    ground: Ground,
    program: Program,
    force: StatedForce,
    turned: Array | None,
    told: Progress,
) -> tuple[bytes, Mapping[str, Any], Compensation | None]:
    if ground.model is None:
        n = len(program)
        counts = {"targets": n, "compensated": 0, "unchanged": n, "status": {}, "notes": []}
        return write_program(program, unchanged(program)), counts, None
    settings = _settings(request, ground, force)
    if turned is None:
        result, won = compensate(ground.model, program, settings=settings, progress=told), {}
    else:
        result, spins = spun(ground.model, program, settings, turned)
        won = {"free_spin": spins}
    summary = {**result.summary(), **({"force": force.document()} if force.uses else {}), **won}
    summary["notes"] = [*summary["notes"], *unfollowed(program, result.replacement)]
    return write_program(program, result.replacement), summary, result


def _settings(request: Request, ground: Ground, force: StatedForce) -> CompensationSettings:
    return CompensationSettings(
        load=ground.cell.payload,
        wrench=force.wrench,
        home=ground.home,
        axis_targets=request.axis_targets,
        max_shift=request.max_shift_mm * MM,
        covariance=True,
    )


def _tell(name: str, target: Path, document: Mapping[str, Any], force: StatedForce) -> None:
    """Says on stderr what was done and which targets were left alone."""
    say(
        f"{name}: {document['compensated']} of {document['targets']} targets compensated, "
        f"written to {target}"
    )
    if not document["targets"]:
        remark(name, "it holds no target; give what it calls, or the folder with all of it.")
    before, after = (document.get(f"predicted_error_{k}_um") for k in ("before", "after"))
    if before and after:
        say(
            f"predicted error {before['mean']:.0f} um mean, {before['max']:.0f} um max before; "
            f"the inversion leaves {after['max']:.3f} um"
        )
    sigma = document.get("predicted_sigma_um")
    if sigma:
        say(f"expected scatter about the target (1 sigma, 3-D): {sigma['mean']:.0f} um")
    stance = document.get("configuration")
    stood = [] if stance is None else [sentence(stance)]
    for text in [*stood, *force.sentences(), *sentences(document.get("free_spin"))]:
        say(text)
    for note in document["notes"]:
        say(f"note: {note}")
