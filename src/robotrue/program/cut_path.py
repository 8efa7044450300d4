"""The path of the tool through a program in the robot's base, and checks of a force along it.

Feed at a target is the direction in which the tool passes it: on a straight move that of arrival,
where the next move continues within 30 deg the tangent of the circle through the three points, on
an arc the tangent of the arc. Targets are processed in file order; points that no motion uses are
left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Protocol

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.program.program import Motion, Program
from robotrue.program.target_poses import target_poses

CORNER: Final = 30.0 * DEG
"""Between two straight moves that turn by less the path is taken as round."""
STILL: Final = 1e-9
"""m; moves shorter than this have no direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPath(Columns):
    """n targets as a tool path in base. NaN where a pose or a direction is not known.

    Attributes:
        T_base_tool: (n, 4, 4).
        tool_axis: (n, 3) unit vector in base from the tip to the spindle.
        feed_direction: (n, 3) unit vector in base; NaN where the tool does not feed.
        feeding: (n,) reached by a straight move, an arc or a spline; not by a joint move.
        feed: (n,) m/s of the move to the target; infinite for a rapid, NaN where it is not known.
        along: (n,) m of feeding moves from the first target on; joint moves have no length here.
        motion: (n,) :class:`~robotrue.program.program.Motion`.
        line: (n,) one-based line of the target in its file.
        name: Of the file.
    """

    T_base_tool: Annotated[Array, Column("n 4 4", unit="m", nan=True)]
    tool_axis: Annotated[Array, Column("n 3", nan=True)]
    feed_direction: Annotated[Array, Column("n 3", nan=True)]
    feeding: Annotated[BoolArray, Column("n")]
    feed: Annotated[Array, Column("n", unit="m/s", nan=True, inf=True)]
    along: Annotated[Array, Column("n", unit="m", nan=True)]
    motion: Annotated[IntArray, Column("n")]
    line: Annotated[IntArray, Column("n")]
    name: str = ""

    def __len__(self) -> int:
        return len(self.T_base_tool)

    @property
    def cutting(self) -> BoolArray:
        """(n,) reached by a feeding move that is no rapid."""
        return np.asarray(self.feeding & ~np.isinf(self.feed))

    def path_frames(self) -> Array:
        """Returns R_base_path (n, 3, 3): x feed across the tool axis, y to its left, z tool axis.

        z points from the tip to the spindle, y = z x x is to the left of the feed seen from the
        spindle. NaN where the tool does not feed or moves along its own axis, as in a plunge.
        """
        z = self.tool_axis
        with np.errstate(invalid="ignore", divide="ignore"):
            x = self.feed_direction - np.sum(self.feed_direction * z, axis=1, keepdims=True) * z
            length = np.linalg.norm(x, axis=1, keepdims=True)
            x = np.where(length > np.sin(PLUNGE), x / length, np.nan)
        out: Array = np.stack([x, np.cross(z, x), z], axis=-1)
        out[np.isnan(out[:, 0, 0])] = np.nan
        return out


PLUNGE: Final = 1.0 * DEG
"""A feed nearer to the tool axis than this is a plunge: it has no side to push to."""


class ProcessForce(Protocol):
    """A force along a path: what a table, a rule or a model of milling must answer."""

    def wrench(self, path: CutPath) -> Array:
        """Returns (n, 6) N, N m on the tool, at the tool point, in base axes, linear first.

        Zero where the tool does not cut; never NaN.
        """
        ...


def cut_path(program: Program, *, cutter: Array, feed: Array | None = None) -> CutPath:
    """Returns the tool path of a program.

    Args:
        program: As read.
        feed: (n,) m/s, see :func:`~robotrue.program.formats.stated_feeds.stated_feeds`; not known
            if not given.
        cutter: (3,) the way from the spindle to the tip in the tool frame; normalised.

    Raises:
        ShapeError: A cutter axis of length zero.
        ConfigurationError: The robot carries the part: its poses are not those of the tool.
    """
    if program.held.any():
        raise ConfigurationError(
            "the robot carries the part past a fixed tool: process forces of a fixed tool are not "
            "computed.",
            source=program.name,
            line=int(program.line[np.argmax(program.held)]),
            hint="leave the process force out.",
        )
    length = float(np.linalg.norm(cutter))
    if not length > 0.0:
        raise ShapeError("cutter has length 0, expected a direction in the tool frame.")
    T = target_poses(program)
    T[~np.isfinite(T).all(axis=(1, 2))] = np.nan
    used = np.flatnonzero(program.motion != Motion.UNUSED)
    motion = np.asarray(program.motion[used])
    feeding = np.isin(motion, (Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.SPLINE))
    direction, step = _feed(T[used, :3, 3], motion, feeding)
    n = len(program)
    out_direction, out_feeding = np.full((n, 3), np.nan), np.zeros(n, dtype=np.bool_)
    out_along = np.full(n, np.nan)
    out_direction[used], out_feeding[used] = direction, feeding
    out_along[used] = np.cumsum(step)
    return CutPath(
        T_base_tool=T,
        tool_axis=-(T[:, :3, :3] @ (np.asarray(cutter) / length)),
        feed_direction=out_direction,
        feeding=out_feeding,
        feed=np.full(n, np.nan) if feed is None else feed,
        along=out_along,
        motion=program.motion,
        line=program.line,
        name=program.name,
    )


def _feed(position: Array, motion: IntArray, feeding: BoolArray) -> tuple[Array, Array]:
    """Unit feed direction (m, 3) at targets in order, and m of feeding path to each (m,)."""
    chord = np.diff(position, axis=0, prepend=np.full((min(len(position), 1), 3), np.nan))
    length = np.linalg.norm(chord, axis=1)
    length[~feeding | ~(length > STILL)] = np.nan
    arrive = chord / length[:, None]
    leave, ahead = np.roll(arrive, -1, axis=0), np.roll(length, -1)
    leave[-1:], ahead[-1:] = np.nan, np.nan
    tangent = arrive * ahead[:, None] + leave * length[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        smooth = np.sum(arrive * leave, axis=1) > np.cos(CORNER)
    straight = (motion == Motion.LIN) | (motion == Motion.SPLINE)
    onward = np.roll(straight, -1)
    via, end = motion == Motion.ARC_VIA, motion == Motion.ARC_END
    out = np.where(((straight & onward & smooth) | via)[:, None], tangent, arrive)
    arc = end & np.roll(via, 1)
    before = np.roll(tangent, 1, axis=0)
    on_arc = 2.0 * np.sum(arrive * before, axis=1, keepdims=True) * arrive - before
    out[arc] = on_arc[arc]
    step = np.where(np.isnan(length), 0.0, length)
    step = np.where(arc | via, _arc_steps(arrive, before, tangent, length, via), step)
    return _fill_directions(out, leave, feeding), step


def _arc_steps(arrive: Array, before: Array, tangent: Array, chord: Array, via: BoolArray) -> Array:
    """Length of arc (m,) over each chord of an arc, from the angle to the tangent at the via."""
    at_via = np.where(via[:, None], tangent, before)
    half = np.arccos(np.clip(np.sum(arrive * at_via, axis=1), -1.0, 1.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        stretch = np.where(half > 1e-6, half / np.sin(half), 1.0)
    return np.asarray(np.nan_to_num(chord * stretch))


def _fill_directions(direction: Array, leave: Array, feeding: BoolArray) -> Array:
    """Fills in directions: a target without a path takes that of its exit, else the last one."""
    lost = feeding & ~np.isfinite(direction[:, 0])
    direction[lost] = leave[lost]
    lost = feeding & ~np.isfinite(direction[:, 0])
    known = np.where(np.isfinite(direction[:, 0]) | ~feeding, np.arange(len(direction)), 0)
    last = np.maximum.accumulate(known) if len(known) else known
    direction[lost] = direction[last[lost]]
    direction[~feeding] = np.nan
    return direction
