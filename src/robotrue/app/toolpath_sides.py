"""The sides of a part from tool paths: each with its part frame, inside the part's contour."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.app.registered import provenance_used
from robotrue.cell.cell import Cell
from robotrue.cell.part import PartFrame
from robotrue.core.files import read_bytes, sha256
from robotrue.core.mesh import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.planning.machining import MachiningJob, Side
from robotrue.planning.tool_axis import Posed
from robotrue.program.contour import contour_of, keep_inside, side_direction
from robotrue.program.formats.krl_machining import KrlSpeeds
from robotrue.program.formats.toolpaths import read_toolpath
from robotrue.program.identity import ProgramIdentity
from robotrue.program.toolpath import cut_length, duration


def read_side(
    cell: Cell, path: Path, frame: PartFrame | None, mesh: TriangleMesh | None, margin: float
) -> Side:
    """Returns one tool path in its part frame.

    Args:
        cell: Its base, where there is no part frame.
        path: File of the tool path.
        frame: Part frame.
        mesh: Part whose largest contour bounds the points; None: all points are kept.
        margin: m, how far outside the contour points are kept.
    """
    found = read_toolpath(path)
    if mesh is not None:
        found = keep_inside(found, contour_of(mesh, side_direction(found)), margin=margin)
    return Side(path=found, T_base_part=cell.T_base_frame if frame is None else frame.T_base_part)


def choose_frames(
    cell: Cell, paths: Sequence[Path], parts: Sequence[str]
) -> list[PartFrame | None]:
    """Returns the part frame of each side: named, of the file's name, or the only one; None: none.

    Raises:
        ConfigurationError: Names that are not there, or not one for each side.
    """
    if len(parts) not in (0, 1, len(paths)):
        raise ConfigurationError(
            f"--part is given {len(parts)} times for {len(paths)} tool "
            f"path{'' if len(paths) == 1 else 's'}.",
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


def note_frames(cell: Cell, frames: Sequence[PartFrame | None]) -> list[str]:
    """Returns what is to be said of the part frames, one sentence each."""
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


def identity_of_frame(cell: Cell, frame: PartFrame | None, path: Path) -> ProgramIdentity | None:
    """Returns whose frame the program stands in; a frame that nobody touched: no model's, None."""
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


def sides_document(
    job: MachiningJob, frames: Sequence[PartFrame | None], speeds: KrlSpeeds
) -> dict[str, object]:
    """Returns the job as JSON values: mm, deg, s; keys as in the reference."""
    moves = sum(len(each) for each in job.moves)
    return {
        "targets": sum(len(side.path) for side in job.sides) + moves,
        "sides": [
            _side_document(side, frame, speeds)
            for side, frame in zip(job.sides, frames, strict=True)
        ],
    }


def _side_document(side: Posed, frame: PartFrame | None, speeds: KrlSpeeds) -> dict[str, object]:
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
