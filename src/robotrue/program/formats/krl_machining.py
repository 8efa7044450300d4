"""A KRL program that follows tool paths in part coordinates. KRL text; no geometry but A, B, C.

``$TOOL`` is set once, ``$BASE`` before every side: the registered frame of the part. Joint moves
are axis targets with exact stops. Points that cut are ``LIN`` with ``C_DIS`` (``$APO.CDIS``) as
long as cutting goes on, with exact stops at its ends; rapid points are ``LIN`` at the rapid speed,
since the CAM system drew them straight. Positions have four decimals of a millimetre, angles five
of a degree, frames as many as they need. Statements of the tool path that move nothing stand as
comments where they stood; ``STOP`` also halts, ``DELAY/ s`` also waits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.compensation_defaults import BLEND_MM
from robotrue.program.toolpath import FASTEST, Toolpath

LONGEST_NAME: Final = 24
_COMMENT: Final = 100
_WAIT: Final = re.compile(r"DELAY\s*/\s*(\d++\.?+\d*+|\.\d++)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class SideMoves:
    """One side: how to get there, and its path.

    Attributes:
        axes: (k, 6) rad, controller's axes, driven one after the other before the path.
        path: In the part frame.
        rotation: (n, 3, 3) of the tool frame in the part.
        T_base_part: (4, 4), ``$BASE``.
    """

    axes: Array
    path: Toolpath
    rotation: Array
    T_base_part: Array

    def __post_init__(self) -> None:
        """Freezes the arrays."""
        object.__setattr__(self, "axes", frozen(self.axes, (None, 6), "axes"))
        shape = (len(self.path), 3, 3)
        object.__setattr__(self, "rotation", frozen(self.rotation, shape, "rotation"))
        object.__setattr__(self, "T_base_part", frozen(self.T_base_part, (4, 4), "T_base_part"))


@dataclass(frozen=True, slots=True, kw_only=True)
class KrlSpeeds:
    """What a tool path does not say.

    Attributes:
        rapid: m/s of rapid points.
        feed: m/s of points that cut before any feed is stated; NaN refuses them.
        joint: Per cent of the axis speeds, for joint moves.
        blend: m, ``$APO.CDIS``; 0 stops at every point.
    """

    rapid: float = 0.2
    feed: float = np.nan
    joint: int = 10
    blend: float = BLEND_MM * MM

    def __post_init__(self) -> None:
        """Refuses what the controller would.

        Raises:
            ConfigurationError: A speed or blend out of range.
        """
        feed = 1e-3 if np.isnan(self.feed) else self.feed
        if not (0.0 < self.rapid <= FASTEST and 0.0 < feed <= FASTEST):
            raise ConfigurationError(
                f"rapid {self.rapid / MM:g} mm/s, feed {self.feed / MM:g} mm/s: expected above 0 "
                f"and at most {FASTEST / MM:g} mm/s."
            )
        if not 1 <= self.joint <= 100 or not 0.0 <= self.blend <= 0.1:
            raise ConfigurationError(
                f"joint speed {self.joint} %, blend {self.blend / MM:g} mm: expected 1 to 100 % "
                "and 0 to 100 mm."
            )


def require_name(name: str) -> None:
    """Passes for a name a KRL program may have.

    Raises:
        ConfigurationError: Another one.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > LONGEST_NAME:
        raise ConfigurationError(
            f"program name {name!r}: KRL allows up to {LONGEST_NAME} letters, digits and "
            "underscores, a letter first.",
            hint="another file name, e.g. job.src.",
        )


def machining_program(
    name: str,
    T_flange_tool: Array,
    sides: Sequence[SideMoves],
    last: Array,
    speeds: KrlSpeeds,
    *,
    remarks: Sequence[str] = (),
) -> bytes:
    """Returns the ``.src`` file.

    Args:
        name: Name of the program, up to 24 letters, digits and underscores.
        T_flange_tool: (4, 4), ``$TOOL``.
        sides: In the order they are cut.
        last: (k, 6) rad, controller's axes, driven after the last side.
        speeds: Rapid, joint and default feed.
        remarks: Comments for the head.

    Raises:
        ConfigurationError: A name KRL does not allow.
        FormatError: A point that cuts without a feed, with its line.
    """
    require_name(name)
    lines = ["&ACCESS RVP", f"DEF {name}()", *(_comment(text) for text in remarks)]
    lines += ["BAS(#INITMOV,0)", f"BAS(#VEL_PTP,{speeds.joint})"]
    lines.append(f"$TOOL={{{frame_text(T_flange_tool)}}}")
    lines.append(f"$APO.CDIS={speeds.blend / MM:.3f}")
    for side in sides:
        lines += _side(side, speeds)
    lines += [f"PTP {_axis_target(axes)}" for axes in last]
    return ("\r\n".join([*lines, "END", ""])).encode("ascii")


def frame_text(transform: Array) -> str:
    """Returns ``X .. C`` of a frame in mm and deg, exact to a picometre and 1e-11 rad."""
    values = [*(transform[:3, 3] / MM), *(abc_from_matrix(transform[:3, :3]) / DEG)]
    return ",".join(
        f"{letter} {_short(value)}" for letter, value in zip("XYZABC", values, strict=True)
    )


def _short(value: float) -> str:
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0.0" if text in ("0", "-0") else text if "." in text else f"{text}.0"


def _side(side: SideMoves, speeds: KrlSpeeds) -> list[str]:
    path = side.path
    lines = [_comment(f"side {path.name} ({_file(path.source)}), {len(path)} points")]
    lines += [f"PTP {_axis_target(axes)}" for axes in side.axes]
    lines.append(f"$BASE={{{frame_text(side.T_base_part)}}}")
    targets = _targets(path.position, side.rotation)
    cutting = path.cutting
    blends = np.append(cutting[:-1] & cutting[1:], False) & (speeds.blend > 0.0)
    remarks, halts = _remarks(path)
    blends[[k - 1 for k in halts if k]] = False
    feeds = _feeds(path, speeds)
    operation, speed = -1, ""
    for k, (target, feed, blend) in enumerate(zip(targets, feeds, blends, strict=True)):
        lines += remarks.get(k, ())
        if path.operation[k] != operation:
            operation = int(path.operation[k])
            lines.append(_comment(f"operation {path.operations[operation]}"))
        text = f"$VEL.CP={feed:.6f}"
        if text != speed:
            speed = text
            lines.append(text)
        lines.append(f"LIN {target} C_DIS" if blend else f"LIN {target}")
    return [*lines, *remarks.get(len(path), ())]


def _targets(position: Array, rotation: Array) -> Iterator[str]:
    """Targets as aggregates; B within +-90 deg, A and C within +-180 deg."""
    xyz = np.round(position / MM, 4) + 0.0  # no -0.0000
    abc = np.round(abc_from_matrix(rotation) / DEG, 5) + 0.0
    for (x, y, z), (a, b, c) in zip(xyz.tolist(), abc.tolist(), strict=True):
        yield f"{{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.5f},B {b:.5f},C {c:.5f}}}"


def _feeds(path: Toolpath, speeds: KrlSpeeds) -> Array:
    """Speeds (n,) m/s of every point."""
    feed = np.where(path.rapid, speeds.rapid, np.where(np.isnan(path.feed), speeds.feed, path.feed))
    bad = np.flatnonzero(~np.isfinite(feed))
    if len(bad):
        raise FormatError(
            "this point cuts and no feed is stated before it.",
            source=path.source,
            line=int(path.line[bad[0]]),
            hint="FEDRAT/ in the CL data, or --feed-mm-per-min.",
        )
    return np.asarray(feed)


def _remarks(path: Toolpath) -> tuple[dict[int, list[str]], list[int]]:
    """Lines to stand before each point, and the points before which the arm stands still."""
    out: dict[int, list[str]] = {}
    halts: list[int] = []
    for remark in path.remarks:
        lines = out.setdefault(remark.before, [])
        lines.append(_comment(f"{remark.line}: {remark.text}"))
        wait = _WAIT.fullmatch(remark.text)
        if remark.text.upper() == "STOP":
            lines.append("HALT")
        elif wait:
            lines.append(f"WAIT SEC {float(wait[1]):.3f}")
        if wait or remark.text.upper() == "STOP":
            halts.append(remark.before)
    return out, halts


def _comment(text: str) -> str:
    plain = text.encode("ascii", "replace").decode("ascii")
    return f"; {plain[:_COMMENT]}"


def _file(source: str) -> str:
    return re.split(r"[/\\]", source)[-1]


def _axis_target(axes: Array) -> str:
    degrees = np.round(np.asarray(axes) / DEG, 4) + 0.0
    return "{" + ",".join(f"A{i + 1} {value:.4f}" for i, value in enumerate(degrees)) + "}"
