"""Make a robot program from CAM tool paths, in the registered part frame."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.compensation_request import ALLOW_STEPS, MAX_STEP, CompensateRequest
from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.operations.compensate import run as compensate
from robotrue.app.presentation import PlainResult, Table
from robotrue.app.request import InputFile, Item, Option, Output, Reference, Request
from robotrue.app.request_fields import OUTPUT, Page
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.provenance import Provenance, marked_document, merge, simulation_mark
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.planning.plan_defaults import LIFT_MM, STOCK_MM
from robotrue.program.compensation_defaults import BLEND_MM, MAX_SHIFT_MM, MAX_STEP_MM

if TYPE_CHECKING:
    from robotrue.app.report_pages import ProgramDocument
    from robotrue.cell.cell import Cell
    from robotrue.cell.part import PartFrame
    from robotrue.core.arrays import Array
    from robotrue.planning.machining import MachiningSettings
    from robotrue.program.identity import ProgramIdentity
    from robotrue.program.posts.machining_moves import JobSpeeds
    from robotrue.program.posts.post_description import Post
    from robotrue.program.posts.post_writer import WrittenProgram

HEAD: Final = "written by robotrue; drive it once slowly, without the spindle"
SUFFIXES: Final = (
    *(".src", ".mod", ".modx", ".prg", ".script", ".urscript", ".jbi", ".ls", ".pgx"),
    *(".mpf", ".spf", ".arc", ".h", ".nc", ".tap", ".cnc", ".ngc"),
)
"""Of programs in the languages that are read; a post may state others."""


class ProgramRequest(Request):
    """Tool paths to convert to a program, and the motion of the arm."""

    cell: Annotated[Reference, Item(noun="cell", also=("registration",), argument="CELL")]
    """cell.toml, preferably written by `register`."""
    toolpaths: Annotated[tuple[Path, ...], InputFile(argument="TOOLPATH...")]
    """APT/CL data or CSV, one per side."""
    output: Annotated[Path, Output(names=OUTPUT, what="a robot program", suffixes=SUFFIXES)]
    """Program to write; its suffix selects the language: .src is KRL, .mod RAPID, ..."""
    language: str | None = None
    """Name of the post processor, if the suffix does not determine it."""
    post: Annotated[Path | None, InputFile()] = None
    """Your own post description (TOML)."""
    model: Annotated[Reference | None, Item(noun="model")] = None
    """Also compensate the program with this model."""
    part: tuple[str, ...] = ()
    """Part frame, for all sides or one for each; default: of the same name."""
    mesh: Annotated[Path | None, InputFile()] = None
    """Part (STL): keep only points inside its largest contour."""
    passes: Annotated[tuple[str, ...], Option(names=("--pass",))] = ()
    """rough or finish, once for each tool path; default: finish, cut unchanged."""
    stock_mm: float = STOCK_MM
    """Stock of roughing passes along the tool axis."""
    margin_mm: float = 0.0
    """Margin outside the contour within which points are kept."""
    cutter: str | None = None
    """Axis of [tool] from spindle to tip: x, y, z, -x, -y, -z; default z."""
    lift_mm: float = LIFT_MM
    """Height over part and paths before and after each side."""
    home_deg: str | None = None
    """A1,..,A6 at the start and end of the job."""
    rapid_mm_per_s: float = 200.0
    """Speed of rapid points."""
    feed_mm_per_min: float | None = None
    """Feed of cutting points before the first stated feed."""
    blend_mm: float = BLEND_MM
    """Blending distance at corners; 0 stops at every point."""
    max_shift_mm: float = MAX_SHIFT_MM
    """With --model: do not compensate a target that would move further."""
    max_step_mm: Annotated[float, MAX_STEP] = MAX_STEP_MM
    allow_steps: Annotated[bool, ALLOW_STEPS] = False
    report: Page = None


@operation()
def run(request: ProgramRequest, context: Context) -> PlainResult:
    """Writes the program and reports the arm's motion on each side.

    Raises:
        ConfigurationError: An invalid name, limit, post or part frame.
        ModelMismatchError: An arm the language is not for, or a model of another arm.
        ReachError: A point out of reach, or no clear way between sides.
    """
    from robotrue.app.registered import provenance_of_file, provenance_used
    from robotrue.app.toolpath_sides import (
        choose_frames,
        choose_passes,
        identity_of_frame,
        note_frames,
        read_pass,
        sides_document,
    )
    from robotrue.core.surfaces import read_mesh
    from robotrue.planning.machining import job_moves, plan_machining
    from robotrue.program.posts import choose_post
    from robotrue.program.posts.post_writer import write_machining

    output, paths = context.output(request.output), request.toolpaths
    post = choose_post(request.output, name=request.language, file=request.post)
    cell, settings = _cell_and_settings(request, post, context)
    speeds = _read_speeds(request)
    mesh = None if request.mesh is None else read_mesh(request.mesh)
    frames = choose_frames(cell, paths, request.part)
    kinds = choose_passes(paths, request.passes)
    bound = (mesh, request.margin_mm * MM)
    passes = [
        read_pass(cell, path, frame, bound, kind, request.stock_mm * MM)
        for path, frame, kind in zip(paths, frames, kinds, strict=True)
    ]
    sides = [each.side for each in passes]
    job = plan_machining(cell, sides, settings, mesh=mesh)
    moves = job_moves(job, cell.robot, output.stem, speeds, words_of=post.words_of, remarks=(HEAD,))
    program = write_machining(post, moves, output.name)
    _require_own_files(program, output)
    notes = [*note_frames(cell, frames), *(n for s in sides for n in s.path.notes), *job.notes]
    notes += program.at_controller
    identity = identity_of_frame(cell, frames[0], paths[0])
    beside, made = _write_files(request, context, cell, frames[0], program, identity)
    origin = provenance_used(cell, None)
    if request.model is not None:
        origin = merge([origin, provenance_of_file(context.model_file(request.model))])
    document: ProgramDocument = {
        "output": str(output),
        **sides_document(job, frames, passes, speeds),
        "identity": beside,
        "compensation": made,
        "notes": notes,
    }
    _write_page(request, context, cell, document, origin)
    for note in notes:
        context.note(note)
    count = f"{len(sides)} side{'' if len(sides) == 1 else 's'}"
    context.wrote(f"{count}, {document['targets']} targets", output)
    return PlainResult(values={**document}, shown=(_sides_table(document),), provenance=origin)


def _sides_table(document: ProgramDocument) -> Table:
    """Returns the motion of the arm on each side."""
    return Table(
        title=f"program {Path(document['output']).name}",
        columns=(
            *("side", "points", "cut, mm", "time, s"),
            *("spin, deg", "to a limit, deg", "wrist, deg", "pass"),
        ),
        rows=tuple(
            (
                side["name"],
                str(side["points"]),
                f"{side['cut_mm']:.0f}",
                f"{side['duration_s']:.0f}",
                f"{side['spin_deg'][0]:.0f} to {side['spin_deg'][1]:.0f}",
                f"{side['limit_margin_deg']:.1f}",
                f"{side['wrist_angle_deg']:.1f}",
                side["pass"],
            )
            for side in document["sides"]
        ),
    )


def _write_page(
    request: ProgramRequest,
    context: Context,
    cell: Cell,
    document: ProgramDocument,
    origin: Provenance,
) -> None:
    from robotrue.app.report_pages import program_page

    if request.report is not None:
        page = program_page(cell, document, simulated=bool(simulation_mark(origin)))
        context.write(request.report, page, "report")


def _require_own_files(program: WrittenProgram, output: Path) -> None:
    """Refuses to write over a file of frames next to the program that is not of this program.

    Raises:
        ConfigurationError: There is one.
    """
    mark = f"robotrue {output.stem}.".encode()
    for name in list(program.files)[1:]:
        path = output.with_name(name)
        if path.stem == output.stem or not path.exists() or mark in read_bytes(path):
            continue
        raise ConfigurationError(
            f"{name} beside the program is not of it, and the program needs its own.",
            source=path,
            hint="write the program into a separate folder.",
        )


def _write_files(
    request: ProgramRequest,
    context: Context,
    cell: Cell,
    frame: PartFrame | None,
    program: WrittenProgram,
    identity: ProgramIdentity | None,
) -> tuple[object, Mapping[str, object] | None]:
    """Writes the files; returns the path of the identity, and what compensation made of them."""
    from robotrue.program.identity import identity_path, write_identity

    output = context.output(request.output)
    made: dict[str, object] | None = None
    if request.model is not None:
        made = _compensate(request, context, cell, frame, program, identity)
    first, *others = program.files
    written = [first] if made is None else []
    written += [name for name in others if made is None or not _holds_targets(program, name)]
    for name in written:
        write_atomic(output if name == first else output.with_name(name), program.files[name])
    for name in others:
        context.wrote("beside it", output.with_name(name))
    if made is not None:
        return made.get("identity"), made
    if identity is None:
        return None, None
    write_identity(output, program.files[first], identity)
    return str(identity_path(output)), None


def _holds_targets(program: WrittenProgram, name: str) -> bool:
    """True if compensation also writes this file, because it contains targets."""
    from robotrue.program.lang import languages

    first = next(iter(program.files))
    return any(name in each.name_companions(first) for each in languages().values())


def _cell_and_settings(
    request: ProgramRequest, post: Post, context: Context
) -> tuple[Cell, MachiningSettings]:
    """The cell, and how the sides are to be driven.

    Raises:
        ConfigurationError: A name that the language does not take, an invalid limit or home.
        ModelMismatchError: An arm of another maker than those of the post.
    """
    import numpy as np

    from robotrue.cell.cell import cutter_axis
    from robotrue.cell.config import read_cell
    from robotrue.compensation.steps import StepRule
    from robotrue.planning.machining import MachiningSettings
    from robotrue.program.posts.post_writer import require_name
    from robotrue.robot.spin import SpinSettings

    StepRule(max_mm=request.max_step_mm, allow=request.allow_steps)
    require_name(post, request.output.stem)
    if not 0.0 <= request.stock_mm <= 100.0:
        raise ConfigurationError(
            f"--stock-mm is {request.stock_mm:g} mm, expected 0 to 100.", hint="--stock-mm 1"
        )
    if not request.margin_mm >= 0.0:
        raise ConfigurationError(f"--margin-mm is {request.margin_mm:g} mm, expected 0 or more.")
    path = context.cell_file(request.cell)
    cell = read_cell(path)
    if post.stated.makers and cell.robot.maker not in post.stated.makers:
        raise ModelMismatchError(
            f"{cell.robot.name} is of maker {cell.robot.maker!r}; post {post.stated.name!r} writes "
            f"{post.stated.title}, for arms of {', '.join(post.stated.makers)}.",
            source=path,
            hint="a suffix of -o for this arm's controller; [robot] maker states the maker.",
        )
    settings = MachiningSettings(
        spin=SpinSettings(cutter=cutter_axis(cell, request.cutter)),
        lift=request.lift_mm * MM,
        home=np.empty(0) if request.home_deg is None else _home(request.home_deg),
    )
    return cell, settings


def _read_speeds(request: ProgramRequest) -> JobSpeeds:
    from robotrue.program.posts.machining_moves import JobSpeeds

    feed = request.feed_mm_per_min
    return JobSpeeds(
        rapid=request.rapid_mm_per_s * MM,
        feed=float("nan") if feed is None else feed * MM / 60.0,
        blend=request.blend_mm * MM,
    )


def _home(text: str) -> Array:
    from robotrue.core.arrays import parse_number_list

    values = parse_number_list(text)
    if values.size != 6:
        raise ConfigurationError(
            f"--home-deg {text!r}, expected six angles A1..A6 in deg.",
            hint="--home-deg 0,-90,90,0,0,0",
        )
    return values * DEG


def _compensate(
    request: ProgramRequest,
    context: Context,
    cell: Cell,
    frame: PartFrame | None,
    program: WrittenProgram,
    identity: ProgramIdentity | None,
) -> dict[str, object]:
    """Compensates the program as ``robotrue compensate`` does, from a temporary file."""
    from robotrue.calibration.model import identity_of
    from robotrue.calibration.nominal import NominalModel
    from robotrue.program.identity import write_identity
    from robotrue.store.model_file import read_model

    path = context.model_file(request.model) if request.model is not None else Path()
    stored = read_model(path).cell.robot
    if identity_of(NominalModel(robot=stored)) != identity_of(NominalModel(robot=cell.robot)):
        raise ModelMismatchError(
            f"{cell.robot.name} of the cell and {stored.name} of the model are not the same arm.",
            source=path,
            hint="register and calibrate with one cell file.",
        )
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / request.output.name
        for name, data in program.files.items():
            write_atomic(plain.with_name(name), data)
        if identity is not None:
            write_identity(plain, program.files[plain.name], identity)
        asked = CompensateRequest(
            model=request.model,
            program=(plain,),
            output=request.output,
            cell=None if cell.part is None else request.cell,
            part=None if frame is None else frame.name,
            max_shift_mm=request.max_shift_mm,
            max_step_mm=request.max_step_mm,
            allow_steps=request.allow_steps,
        )
        made = compensate(asked, context)
    return marked_document(made.document(), made.provenance)
