"""Inputs of a compensation: model, cell, part frame, force, and the programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.context import Context
from robotrue.app.force_options import read_force_options
from robotrue.app.outputs import check_output, require_suffix
from robotrue.app.registered import open_model, provenance_used
from robotrue.app.reporting import place_in_file
from robotrue.app.stated_conditions import model_under
from robotrue.calibration.model import ErrorModel, identity_of
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.cell import Cell, frame_table
from robotrue.cell.part import PartFrame
from robotrue.compensation.between_targets import SplitOptions
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.settings import is_on_table
from robotrue.compensation.stance import start_joints
from robotrue.compensation.steps import StepRule
from robotrue.core.arrays import Array
from robotrue.core.conditions import EXTERNAL_AXES
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.provenance import Provenance
from robotrue.errors import ConfigurationError
from robotrue.program.identity import require_compensable
from robotrue.program.lang import find_language, languages
from robotrue.program.program import FrameTable
from robotrue.program.program_file import ProgramFile, open_job


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """Opened inputs of a request: its files, frame, and rules, all checked.

    Attributes:
        programs: Files of one program, or its folder.
        folder: Where the programs lie.
        output: File or folder to write.
        cell: Whose frames, tool and payload hold.
        model: Error of the arm; None changes nothing.
        frame: Part frame the program runs in.
        used: The model, for identity files.
        provenance: Of the model and the part frame.
        force: (6,) N, N m for all targets, empty for none; or a description.
        table: What programs name but do not hold.
        home: (6,) rad before the first target; empty where none is stated.
        steps: What steps are allowed.
        split: Request between the targets.
    """

    programs: tuple[Path, ...]
    folder: Path
    output: Path
    cell: Cell
    model: ErrorModel | None
    frame: PartFrame | None
    used: ModelIdentity
    provenance: Provenance
    force: Array | DescribedForce
    table: FrameTable
    home: Array
    steps: StepRule
    split: SplitOptions


def open_ground(request: CompensateRequest, context: Context) -> Ground:
    """Returns what a request names, opened.

    Raises:
        ConfigurationError: An invalid limit, a part without a registered cell.
    """
    if not request.max_shift_mm > 0.0:
        raise ConfigurationError(
            f"--max-shift-mm is {request.max_shift_mm:g} mm, expected above 0.",
            hint="--max-shift-mm 10",
        )
    steps = StepRule(max_mm=request.max_step_mm, allow=request.allow_steps)
    ground, registered = _ground_files(request, context)
    cell, model = open_model(ground, registered)
    used = identity_of(model or NominalModel(robot=cell.robot))
    stated = (request.temperature_degC, request.time_s, request.e1_mm)
    model = model_under(model, *stated, context)
    if model is not None:
        model.require_axes(cell.controller.external)
    frame = None if cell.part is None else cell.part.frame(request.part)
    if frame is not None:
        cell = replace(cell, T_base_frame=frame.T_base_part)
    elif request.part is not None:
        raise ConfigurationError(
            f"--part {request.part!r}, but the cell is not registered.",
            source=registered or ground,
            hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
        )
    programs = context.program_files(request.program)
    return Ground(
        programs=programs,
        folder=programs[0] if programs[0].is_dir() else programs[0].parent,
        output=context.program_output(request.output),
        cell=cell,
        model=model,
        frame=frame,
        used=used,
        provenance=provenance_used(cell, model),
        force=read_force_options(cell, request.wrench, request.force, request.cutter),
        table=frame_table(cell),
        home=start_joints(cell.robot, cell.controller.start, request.start),
        steps=steps,
        split=SplitOptions(
            tolerance_um=request.split_um, limit=request.split_limit, deviation=request.deviation
        ),
    )


def _ground_files(request: CompensateRequest, context: Context) -> tuple[Path, Path | None]:
    """The model or cell, and the additional cell with the requested frames.

    Raises:
        ConfigurationError: None is stated, or three.
    """
    stated = {
        context.model_file: request.model,
        context.cell_file: request.cell,
        context.registration_file: request.registration,
    }
    paths = [find(each) for find, each in stated.items() if each is not None]
    if not 0 < len(paths) < 3:
        raise ConfigurationError(
            f"{len(paths)} of model, cell and registration are stated, expected one, or a model "
            "with one of the others.",
            hint='{"program": ..., "model": ...}',
        )
    return paths[0], paths[1] if len(paths) > 1 else None


def _why_whole(request: CompensateRequest, ground: Ground) -> str:
    """Returns the option that needs the whole program in memory; empty if none does."""
    model = ground.model
    asks = {
        "--force": request.force is not None,
        "--free-spin": request.free_spin,
        ground.split.named: ground.split.asked,
        "no model": model is None,
        "--e1-mm": request.e1_mm is not None,
        "a model without flat tables": model is not None and model.mean_tables() is None,
        "a rotary table": model is not None and _has_table(model, ground.table),
    }
    return ", ".join(what for what, asked in asks.items() if asked)


def _has_table(model: ErrorModel, table: FrameTable) -> bool:
    """Returns whether the model has errors of axes that carry work frames."""
    external = np.full((1, EXTERNAL_AXES), np.nan)
    external[0, [axis.number - 1 for axis in table.external if not axis.carries_robot]] = 0.0
    return is_on_table(model, external)


def _refuse_second_place(request: CompensateRequest, files: Sequence[ProgramFile]) -> None:
    """Refuses --e1-mm with a program that states E1 itself.

    Raises:
        ConfigurationError: It does.
    """
    if request.e1_mm is None:
        return
    for file in files:
        external = None if file.held is None else file.held.external
        if external is not None and np.isfinite(external[:, 0]).any():
            raise ConfigurationError(
                f"--e1-mm is {request.e1_mm:g} mm, and the targets state E1.",
                source=file.name,
                hint="leave --e1-mm out.",
            )


def open_programs(
    request: CompensateRequest, ground: Ground, context: Context
) -> tuple[tuple[ProgramFile, ...], list[Path]]:
    """Returns the files of a request, a long one in outline, and where each is written.

    Raises:
        FormatError: A file that cannot be read.
        ModelMismatchError: A program that is compensated already, or belongs to another model.
    """
    first = ground.programs[0].name
    files = open_job(
        ground.programs,
        ground.table,
        several=request.dask is not None or request.workers not in (None, 1),
        why_whole=partial(_why_whole, request, ground),
        note=lambda text: context.note(place_in_file(first, text)),
    )
    _refuse_second_place(request, files)
    names = [file.name for file in files]
    outputs = job_outputs(
        names, ground.folder, ground.output, files[0].dialect, whole=ground.programs[0].is_dir()
    )
    known = [
        require_compensable(
            ground.folder / file.name, file.sha256, ground.used, copies=outputs[0].parent
        )
        for file in files
    ]
    if ground.model is not None and not any(known):
        context.inform(
            f"{', '.join(names[:3])}: no identity file; assumed to be uncompensated. "
            "A copy of a compensated program would be corrected twice."
        )
    return files, outputs


def job_outputs(
    names: Sequence[str], folder: Path, output: Path, language: str, *, whole: bool
) -> list[Path]:
    """Returns the file that each file of a job is written to.

    A folder takes all of them under their own names. A file is the first; a companion that belongs
    to it by its name takes its new name, others keep theirs next to it, since programs name them.

    Args:
        names: Of the files of the job, the program first.
        folder: Where they were read.
        output: A file, or a folder that exists.
        language: Name of their dialect.
        whole: The job is a folder: an output that does not exist and has no suffix is a folder.

    Raises:
        ConfigurationError: A file that is read, no folder, or one name for two files.
    """
    if output.is_dir() or (whole and not output.suffix and not output.exists()):
        paths = [output / name for name in names]
        for folder in dict.fromkeys(path.parent for path in paths):
            folder.mkdir(parents=True, exist_ok=True)
    else:
        _require_language(output, names[0], language)
        paths = [output]
        beside = {each.lower() for each in find_language(language).name_companions(names[0])}
        for name in map(Path, names[1:]):
            alike = name.stem.lower() == Path(names[0]).stem.lower() and name.name.lower() in beside
            paths.append(output.with_name(output.stem + name.suffix if alike else name.name))
    originals = [folder / name for name in names]
    for path in paths:
        _require_other(path, originals, several=len(names) > 1)
    twice = [path for k, path in enumerate(paths) if path in paths[:k]]
    if twice:
        raise ConfigurationError(
            f"two files of the job, {', '.join(names)}, would be written to {twice[0].name}.",
            source=output,
            hint="a folder after -o: every file keeps its name there.",
        )
    return paths


def _require_language(output: Path, source: str, language: str) -> None:
    """Refuses a name with the suffix of another language than the program's, or of no program."""
    own = find_language(language)
    kin = [each for each in languages().values() if own.family and each.family == own.family]
    suffixes = [suffix for each in kin or [own] for suffix in each.suffixes]
    usual = Path(source).suffix.lower()
    what = f"a program in {own.name}, as {source} is,"
    require_suffix(output, what, tuple(dict.fromkeys([usual, *own.table_suffixes, *suffixes])))


def _require_other(path: Path, originals: Sequence[Path], *, several: bool) -> None:
    try:
        check_output(path, originals)
    except ConfigurationError as cause:
        if not several or not path.exists() or path.is_dir():
            raise
        raise ConfigurationError(
            cause.message,
            source=path,
            hint="another folder after -o: every file of the job keeps its name there.",
        ) from cause
