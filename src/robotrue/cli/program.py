"""``robotrue program``: tool paths of a CAM system in, a program in the registered cell out."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.app.registered import provenance_of_file, provenance_used
from robotrue.calibration.identity import identity_of
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cell.cutter_axis import cutter_axis
from robotrue.cell.part import PartFrame
from robotrue.cli.compensate import Request, compensated
from robotrue.cli.console import count, emit_json, emit_table, say, say_mark
from robotrue.cli.steps import StepRule
from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.core.mesh import TriangleMesh, read_mesh
from robotrue.core.provenance import Provenance, marked_document, merge
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.planning.lifts import Side
from robotrue.planning.machining import (
    MachiningJob,
    MachiningSettings,
    job_program,
    plan_machining,
)
from robotrue.planning.tool_axis import Posed
from robotrue.program.contour import contour_of, keep_inside, side_direction
from robotrue.program.formats.krl_machining import Speeds, require_name
from robotrue.program.formats.toolpaths import read_toolpath
from robotrue.program.identity import ProgramIdentity, identity_path, write_identity
from robotrue.program.toolpath import Toolpath, cut_length, duration
from robotrue.robot.spin import SpinSettings
from robotrue.store.model_file import read_model

HEAD: Final = "written by robotrue; drive it once slowly, without the spindle"


def run(
    cell_path: Path,
    paths: Sequence[Path],
    output: Path,
    *,
    model_path: Path | None,
    parts: Sequence[str],
    mesh_path: Path | None,
    margin_mm: float,
    cutter: str | None,
    lift_mm: float,
    home_deg: str | None,
    rapid_mm_per_s: float,
    feed_mm_per_min: float | None,
    blend_mm: float,
    max_shift_mm: float,
    steps: StepRule,
    report: Path | None,
    as_json: bool,
) -> None:
    """Writes the program and says what each side asks of the arm."""
    sources = [p for p in (cell_path, model_path, mesh_path, *paths) if p is not None]
    for target in [p for p in (output, report) if p is not None]:
        check_output(target, sources)
    require_name(output.stem)
    if not 0.0 <= margin_mm < np.inf:
        raise ConfigurationError(f"--margin-mm is {margin_mm:g} mm, expected 0 or more.")
    cell = read_cell(cell_path)
    if cell.robot.maker != "kuka":
        raise ModelMismatchError(
            f"{cell.robot.name} is of maker {cell.robot.maker!r}; programs are written in KRL, for "
            "KUKA controllers.",
            source=cell_path,
        )
    settings = MachiningSettings(
        spin=SpinSettings(cutter=cutter_axis(cell, cutter)),
        lift=lift_mm * MM,
        home=np.empty(0) if home_deg is None else _home(home_deg),
    )
    speeds = Speeds(
        rapid=rapid_mm_per_s * MM,
        feed=np.nan if feed_mm_per_min is None else feed_mm_per_min * MM / 60.0,
        blend=blend_mm * MM,
    )
    mesh = None if mesh_path is None else read_mesh(mesh_path)
    frames = _frames(cell, paths, parts)
    sides = [
        Side(path=_side(path, mesh, margin_mm * MM), T_base_part=_pose(cell, frame))
        for path, frame in zip(paths, frames, strict=True)
    ]
    job = plan_machining(cell, sides, settings, mesh=mesh)
    data = job_program(job, cell.robot, output.stem, speeds, remarks=(HEAD,))
    notes = [*_frame_notes(cell, frames), *(n for s in sides for n in s.path.notes), *job.notes]
    identity = _identity(cell, frames[0], paths[0])
    document: dict[str, Any] = {"output": str(output), **summary(job, frames, speeds)}
    if model_path is None:
        write_atomic(output, data)
        if identity is not None:
            write_identity(output, data, identity)
        beside = None if identity is None else str(identity_path(output))
        document |= {"identity": beside, "compensation": None}
    else:
        document |= _with_model(
            model_path, cell_path, cell, frames[0], data, identity, output, max_shift_mm, steps
        )
    origin = _origin(cell, model_path)
    document = marked_document({**document, "notes": notes}, origin)
    say_mark(origin)
    if report is not None:
        from robotrue.cli.program_page import program_page

        write_atomic(report, program_page(cell, document).encode())
        say(f"report written to {report}")
    for note in notes:
        say(f"note: {note}")
    say(f"{count(len(sides), 'side')}, {document['targets']} targets written to {output}")
    if as_json:
        emit_json(document)
    else:
        _show(document, origin)


def _side(path: Path, mesh: TriangleMesh | None, margin: float) -> Toolpath:
    """One file, inside the largest contour of the part where a mesh is given."""
    found = read_toolpath(path)
    if mesh is None:
        return found
    return keep_inside(found, contour_of(mesh, side_direction(found)), margin=margin)


def _frames(cell: Cell, paths: Sequence[Path], parts: Sequence[str]) -> list[PartFrame | None]:
    """The part frame of each side: named, of the same name as the file, or the only one."""
    if len(parts) not in (0, 1, len(paths)):
        raise ConfigurationError(
            f"--part is given {len(parts)} times for {count(len(paths), 'tool path')}.",
            hint="once for all, or once for each, in order.",
        )
    if cell.part is None:
        if parts:
            raise ConfigurationError(
                f"--part {parts[0]!r}, but the cell is not registered.",
                source=cell.source or None,
                hint="robotrue register CELL|MODEL POINTS -o CELL_OUT.",
            )
        return [None] * len(paths)
    if parts:
        named = list(parts) * (len(paths) if len(parts) == 1 else 1)
        return [cell.part.frame(name) for name in named]
    stems = [path.stem for path in paths]
    return [cell.part.frame(name if name in cell.part.names else None) for name in stems]


def _pose(cell: Cell, frame: PartFrame | None) -> Array:
    return cell.T_base_frame if frame is None else frame.T_base_part


def _frame_notes(cell: Cell, frames: Sequence[PartFrame | None]) -> list[str]:
    if cell.part is None:
        return ["the cell is not registered; its [base] was taken for the part frame."]
    doubtful = {f.name: f.verdict for f in frames if f is not None and f.verdict != "GO"}
    notes = [
        f"part frame {name!r} is {verdict}: do not cut before it is not."
        for name, verdict in doubtful.items()
    ]
    if cell.part.identity.kind != "nominal":
        notes.append(
            f"the part frame was registered with {cell.part.identity}: only the program "
            "compensated by that model lands where it says."
        )
    return notes


def _identity(cell: Cell, frame: PartFrame | None, path: Path) -> ProgramIdentity | None:
    """Whose frame the program stands in; a frame that nobody touched binds it to no model."""
    if cell.part is None or frame is None:
        return None
    return ProgramIdentity(
        model=cell.part.identity,
        compensated=False,
        part=frame.name,
        made_from=path.name,
        made_from_sha256=sha256(read_bytes(path)),
        provenance=provenance_used(cell, None),
    )


def _origin(cell: Cell, model_path: Path | None) -> Provenance:
    """Of the part frame, and of the model that compensates."""
    return merge([provenance_used(cell, None), provenance_of_file(model_path)])


def _home(text: str) -> Array:
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if values.size != 6 or not np.isfinite(values).all():
        raise ConfigurationError(
            f"--home-deg {text!r}, expected six angles A1..A6 in deg.",
            hint="--home-deg 0,-90,90,0,0,0",
        )
    return values * DEG


def _with_model(
    model_path: Path,
    cell_path: Path,
    cell: Cell,
    frame: PartFrame | None,
    data: bytes,
    identity: ProgramIdentity | None,
    output: Path,
    max_shift_mm: float,
    steps: StepRule,
) -> dict[str, Any]:
    """Compensates the program as ``robotrue compensate`` would, from a file of its own."""
    stored = read_model(model_path).cell.robot
    if identity_of(NominalModel(robot=stored)) != identity_of(NominalModel(robot=cell.robot)):
        raise ModelMismatchError(
            f"{cell.robot.name} of the cell and {stored.name} of the model are not the same arm.",
            source=model_path,
            hint="register and calibrate with one cell file.",
        )
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / output.name
        write_atomic(plain, data)
        if identity is not None:
            write_identity(plain, data, identity)
        request = Request(
            model=model_path,
            programs=(plain,),
            output=output,
            registered=None if cell.part is None else cell_path,
            part=None if frame is None else frame.name,
            max_shift_mm=max_shift_mm,
            steps=steps,
        )
        made = compensated(request)
    return {"identity": made.get("identity"), "compensation": made}


def summary(
    job: MachiningJob, frames: Sequence[PartFrame | None], speeds: Speeds
) -> dict[str, Any]:
    """Returns the job as JSON values: mm, deg, s; keys as in the reference."""
    moves = sum(len(each) for each in job.moves)
    return {
        "targets": sum(len(side.path) for side in job.sides) + moves,
        "sides": [
            _side_document(side, frame, speeds)
            for side, frame in zip(job.sides, frames, strict=True)
        ],
    }


def _side_document(side: Posed, frame: PartFrame | None, speeds: Speeds) -> dict[str, Any]:
    path = side.path
    return {
        "name": path.name,
        "source": path.source,
        "part": None if frame is None else frame.name,
        "operations": list(path.operations),
        "points": len(path),
        "rapid_points": int(path.rapid.sum()),
        "cut_mm": cut_length(path) / MM,
        "duration_s": duration(path, rapid=speeds.rapid, feed=speeds.feed),
        "branch": side.branch,
        "spin_deg": [side.spin.min() / DEG, side.spin.max() / DEG],
        "limit_margin_deg": side.limit_margin / DEG,
        "wrist_angle_deg": side.wrist_angle / DEG,
        "unknown_words": [
            {"line": remark.line, "text": remark.text}
            for remark in path.remarks
            if not remark.known
        ],
    }


def _show(document: dict[str, Any], origin: Provenance) -> None:
    rows = [
        [
            side["name"],
            str(side["points"]),
            f"{side['cut_mm']:.0f}",
            f"{side['duration_s']:.0f}",
            f"{side['spin_deg'][0]:.0f} to {side['spin_deg'][1]:.0f}",
            f"{side['limit_margin_deg']:.1f}",
            f"{side['wrist_angle_deg']:.1f}",
        ]
        for side in document["sides"]
    ]
    emit_table(
        f"program {Path(document['output']).name}",
        (
            "side",
            "points",
            "cut, mm",
            "time, s",
            "spin, deg",
            "to a limit, deg",
            "wrist, deg",
        ),
        rows,
        provenance=origin,
    )
