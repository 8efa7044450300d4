"""The sides of a part from tool paths: each with its part frame, inside the part's contour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypedDict

import numpy as np

from robotrue.app.registered import provenance_used
from robotrue.cell.cell import Cell
from robotrue.cell.part import PartFrame
from robotrue.core.files import read_bytes, sha256
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.planning.machining import MachiningJob, Side
from robotrue.planning.tool_axis import Posed
from robotrue.program.contour import Contour, contour_of, keep_inside, side_direction
from robotrue.program.formats.toolpaths import read_toolpath
from robotrue.program.identity import ProgramIdentity
from robotrue.program.outline import area
from robotrue.program.posts.machining_moves import JobSpeeds
from robotrue.program.toolpath import cut_length, duration, leave_stock

PASSES: Final = ("rough", "finish")
MOST_DRAWN: Final = 500
"""Points of a pass that a page draws."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SidePass:
    """One tool path as it is cut.

    Attributes:
        side: The path in its part frame.
        kind: ``rough`` or ``finish``.
        stock: m that it leaves along the tool axis.
        contour: That bounds it; None without a mesh.
    """

    side: Side
    kind: str
    stock: float
    contour: Contour | None


def choose_passes(paths: Sequence[Path], named: Sequence[str]) -> tuple[str, ...]:
    """Returns the pass of each tool path: as named, or ``finish`` where none is.

    Raises:
        ConfigurationError: Another word, not one for each, or roughing after finishing.
    """
    if not named:
        return ("finish",) * len(paths)
    wrong = [word for word in named if word not in PASSES]
    if wrong or len(named) != len(paths):
        what = f"--pass {wrong[0]!r}" if wrong else f"--pass is given {len(named)} times"
        raise ConfigurationError(
            f"{what} for {len(paths)} tool path{'' if len(paths) == 1 else 's'}.",
            hint="rough or finish, once for each, in order.",
        )
    late = [k for k, word in enumerate(named) if word == "rough" and "finish" in named[:k]]
    if late:
        before = paths[named.index("finish")].name
        raise ConfigurationError(
            f"{paths[late[0]].name} is roughed after {before} is finished: roughing would push a "
            "finished part.",
            hint="all roughing passes first.",
        )
    return tuple(named)


def read_pass(
    cell: Cell,
    path: Path,
    frame: PartFrame | None,
    contour: tuple[TriangleMesh | None, float],
    kind: str,
    stock: float,
) -> SidePass:
    """Returns one tool path as it is cut, in its part frame.

    Args:
        cell: Its base, where there is no part frame.
        path: File of the tool path.
        frame: Part frame.
        contour: Part whose largest contour bounds the points (None: all are kept), and m by which
            they may lie outside.
        kind: ``rough`` or ``finish``.
        stock: m that a roughing pass leaves along the tool axis.
    """
    found = read_toolpath(path)
    mesh, margin = contour
    bound = None if mesh is None else contour_of(mesh, side_direction(found))
    if kind == "rough":
        found = leave_stock(found, stock)
    if bound is not None:
        found = keep_inside(found, bound, margin=margin)
    T = cell.T_base_frame if frame is None else frame.T_base_part
    return SidePass(
        side=Side(path=found, T_base_part=T),
        kind=kind,
        stock=stock if kind == "rough" else 0.0,
        contour=bound,
    )


def choose_frames(
    cell: Cell, paths: Sequence[Path], parts: Sequence[str]
) -> list[PartFrame | None]:
    """Returns the part frame of each side: named, of the file's name, or the only one; None: none.

    Raises:
        ConfigurationError: Names that are missing, or not one for each side.
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
    """Returns notes on the part frames, one sentence each."""
    if cell.part is None:
        return ["the cell is not registered; its [base] is used as the part frame."]
    doubtful = {f.name: f.verdict for f in frames if f is not None and f.verdict != "GO"}
    notes = [
        f"part frame {name!r} is {verdict}: do not cut with it."
        for name, verdict in doubtful.items()
    ]
    if cell.part.identity.kind != "nominal":
        notes.append(
            f"the part frame was registered with {cell.part.identity}: only a program compensated "
            "by that model is accurate."
        )
    return notes


def identity_of_frame(cell: Cell, frame: PartFrame | None, path: Path) -> ProgramIdentity | None:
    """Returns the identity of the program's frame; None for a frame that was never probed."""
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


class ContourDocument(TypedDict):
    """The outer boundary of a part's shadow along the tool axis, and what cuts inside it."""

    direction: list[float]
    across: list[list[float]]
    area_mm2: float
    outlines_mm: list[list[list[float]]]
    size_mm: list[float]
    cuts_mm: list[list[float]]


class UnknownWord(TypedDict):
    """A statement of a tool path whose meaning is not known."""

    line: int
    text: str


SideDocument = TypedDict(
    "SideDocument",
    {
        "name": str,
        "source": str,
        "part": str | None,
        "operations": list[str],
        "points": int,
        "rapid_points": int,
        "cut_mm": float,
        "duration_s": float,
        "branch": int,
        "spin_deg": list[float],
        "limit_margin_deg": float,
        "wrist_angle_deg": float,
        "unknown_words": list[UnknownWord],
        "pass": str,
        "stock_mm": float,
        "contour": ContourDocument | None,
    },
)
"""Returns the arm's motion on a side, as JSON values."""


class SidesDocument(TypedDict):
    """A job of tool paths as JSON values."""

    targets: int
    sides: list[SideDocument]


def sides_document(
    job: MachiningJob,
    frames: Sequence[PartFrame | None],
    passes: Sequence[SidePass],
    speeds: JobSpeeds,
) -> SidesDocument:
    """Returns the job as JSON values: mm, deg, s; keys as in the reference."""
    moves = sum(len(each) for each in job.moves)
    return {
        "targets": sum(len(side.path) for side in job.sides) + moves,
        "sides": [
            _side_document(side, frame, speeds, found)
            for side, frame, found in zip(job.sides, frames, passes, strict=True)
        ],
    }


def _side_document(
    side: Posed, frame: PartFrame | None, speeds: JobSpeeds, found: SidePass
) -> SideDocument:
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
        "pass": found.kind,
        "stock_mm": found.stock / MM,
        "contour": _contour_document(found),
    }


def _contour_document(found: SidePass) -> ContourDocument | None:
    """The largest contour with the points that cut inside it, in its plane; None without one."""
    bound, path = found.contour, found.side.path
    if bound is None:
        return None
    cuts = path.position[path.cutting] @ bound.across.T
    return {
        "direction": bound.direction.tolist(),
        "across": bound.across.tolist(),
        "area_mm2": sum(abs(area(outline)) for outline in bound.outlines) / MM**2,
        "outlines_mm": [np.round(outline / MM, 4).tolist() for outline in bound.outlines],
        "size_mm": (np.ptp(np.concatenate(bound.outlines), axis=0) / MM).tolist(),
        "cuts_mm": np.round(cuts[:: max(len(cuts) // MOST_DRAWN, 1)] / MM, 3).tolist(),
    }
