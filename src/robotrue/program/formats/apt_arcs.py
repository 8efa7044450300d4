"""Arcs of APT and CL data as points: straight lines that leave the arc by no more than a tolerance.

Two ways of writing an arc are read. ``CIRCLE/ x,y,z, i,j,k, r`` before a ``GOTO`` turns by the
right-hand rule about (i, j, k) from the point before to that of the GOTO; a different height along
the axis makes it a helix. ``INDIRV/`` with ``TLON,GOFWD/ (CIRCLE/ ..),ON,(LINE/ ..)`` leaves the
point before in the direction given and ends at the end of the line.
"""

from __future__ import annotations

import math
import re
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.program.formats.apt_statements import (
    LARGEST,
    AptStatement,
    is_number,
    numbers,
    to_number,
)

MISS: Final = 0.02 * MM
"""m by which start and end may miss the printed circle; files print 3 to 6 decimals."""
_SAME: Final = 2e-6
"""m; an arc that ends nearer to its start is a whole turn."""
_ROUND: Final = re.compile(
    r"\(?(CIRCLE|CYLNDR)/([^()]*?)\)?,ON,(?:2,INTOF,)?\(?LINE/([^()]*)\)?", re.IGNORECASE
)


class Circle(NamedTuple):
    """A circle with a sense.

    Attributes:
        centre: (3,) m.
        axis: (3,) unit vector; the tool turns by the right-hand rule about it.
        radius: m.
        line: Of its statement.
    """

    centre: Array
    axis: Array
    radius: float
    line: int


def circle_of(statement: AptStatement, unit: float, source: str) -> Circle:
    """Returns the circle of ``CIRCLE/ x,y,z,i,j,k,r``.

    Raises:
        FormatError: Other than seven numbers. Longer records exist whose sense of rotation differs
            between systems; guessing it would cut the wrong half of the circle.
    """
    values = numbers(statement, source)
    if len(values) != 7:
        raise FormatError(
            f"CIRCLE/ with {len(values)} numbers, expected 7: centre, axis, radius. Longer records "
            "do not turn the same way in all systems.",
            source=source,
            line=statement.line,
            hint="post circles as points (linear moves only).",
        )
    axis = np.array(values[3:6])
    length, radius = float(np.linalg.norm(axis)), values[6] * unit
    if not (0.99 <= length <= 1.01 and radius > 0.0):
        raise FormatError(
            f"CIRCLE/ with an axis of length {length:g} and a radius of {values[6]:g}, expected a "
            "unit vector and a radius above 0.",
            source=source,
            line=statement.line,
        )
    return Circle(np.array(values[:3]) * unit, axis / length, radius, statement.line)


def directed_circle(
    statement: AptStatement,
    start: Array,
    tangent: Array | None,
    tool: Array,
    unit: float,
    source: str,
) -> tuple[Circle, Array]:
    """Returns the circle of ``TLON,GOFWD/`` and the end point (3,) m.

    Args:
        statement: The statement.
        start: (3,) m, where the tool is.
        tangent: (3,) of ``INDIRV/``, the direction it leaves in.
        tool: (3,) tool axis; a circle of four numbers lies across it.
        unit: m per unit of the file.
        source: File, for messages.

    Raises:
        FormatError: Another form of the statement, or no direction.
    """
    text = re.sub(r"\s+", "", statement.text).partition("/")[2]
    match = _ROUND.fullmatch(text)
    fields = [] if match is None else [*match[2].split(","), *match[3].split(",")]
    wanted = 0 if match is None else (4 if match[1].upper() == "CIRCLE" else 7) + 6
    if len(fields) != wanted or not wanted or not all(map(is_number, fields)):
        raise FormatError(
            f"{statement.text[:60]!r} is not the arc (CIRCLE/ x,y,z,r),ON,(LINE/ x,y,z, xe,ye,ze).",
            source=source,
            line=statement.line,
            hint="post circles as points (linear moves only).",
        )
    if tangent is None:
        raise FormatError(
            "an arc without INDIRV/ before it: its direction is not known.",
            source=source,
            line=statement.line,
        )
    values = [to_number(field) for field in fields]
    if max(map(abs, values)) > LARGEST:
        raise FormatError(
            f"the arc holds a number beyond {LARGEST:g}.", source=source, line=statement.line
        )
    centre, end = np.array(values[:3]) * unit, np.array(values[-3:]) * unit
    axis = tool if wanted == 10 else np.array(values[3:6])
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    radius = values[wanted - 7] * unit
    sense = float(axis @ np.cross(start - centre, tangent))
    if abs(sense) < 1e-6 * radius * float(np.linalg.norm(tangent)):
        raise FormatError(
            "INDIRV/ points along the radius of the arc: its direction is not known.",
            source=source,
            line=statement.line,
        )
    return Circle(centre, axis * math.copysign(1.0, sense), radius, statement.line), end


def arc_points(circle: Circle, start: Array, end: Array, tolerance: float, source: str) -> Array:
    """Returns points (k, 3) m after ``start`` up to and with ``end``.

    The chord between two points leaves the arc by ``tolerance`` m at most. Start and end at the
    same place make a whole turn.

    Raises:
        FormatError: Start or end miss the circle by more than 0.02 mm.
    """
    x, height, miss = _across(circle, start)
    y, rise, gap = _across(circle, end)
    for name, off in (("starts", miss), ("ends", gap)):
        if abs(off) > MISS:
            raise FormatError(
                f"the arc {name} {abs(off) / MM:.3f} mm off its circle of radius "
                f"{circle.radius / MM:.3f} mm, at most {MISS / MM:g} mm is allowed.",
                source=source,
                line=circle.line,
                hint="post circles as points (linear moves only).",
            )
    other = np.cross(circle.axis, x)
    turn = math.atan2(float(other @ y), float(x @ y)) % (2.0 * math.pi)
    if turn * circle.radius < _SAME:
        turn = 2.0 * math.pi
    step = 2.0 * math.acos(max(1.0 - tolerance / circle.radius, 0.0))
    count = max(math.ceil(turn / step), 1)
    share = np.arange(1, count + 1) / count
    angle = share * turn
    points: Array = (
        circle.centre
        + (height + share * (rise - height))[:, None] * circle.axis
        + circle.radius * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * other)
    )
    points[-1] = end
    return points


def _across(circle: Circle, point: Array) -> tuple[Array, float, float]:
    """Direction from the axis to a point, height along the axis, distance minus radius."""
    apart = point - circle.centre
    height = float(apart @ circle.axis)
    across = apart - height * circle.axis
    length = float(np.linalg.norm(across))
    return across / max(length, 1e-12), height, length - circle.radius
