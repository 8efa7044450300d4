"""Frames and tools from files that controllers save: KUKA, Yaskawa, Fanuc.

``$config.dat``: ``BASE_DATA[n]={X ..}`` and ``TOOL_DATA[n]={X ..}``; a base that
``MACHINE_FRAME_DAT`` puts on another machine than the robot is not in the robot's frame and is left
out. ``TOOL.CND``: the first six numbers behind ``//TOOL n``. ``UFRAME.CND``: ``////BUSER`` behind
``//UFRAME n``, in the base frame unless ``///BASICFRM`` says otherwise. ``SYSFRAME.VA``: the
positions of group 1 in ``$MNUFRAME`` and ``$MNUTOOL``. Binary files (``.SV``, ``.VR``) and the
pulse ratios in ``ALL.PRM`` are not read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.program import FrameTable

BESIDE: Final = {
    "krl": ("$config.dat",),
    "jbi": ("TOOL.CND", "UFRAME.CND"),
    "fanuc_ls": ("SYSFRAME.VA",),
}
"""Names under which they lie beside a program of each dialect, in any case."""
HELD: Final = frozenset(name.lower() for names in BESIDE.values() for name in names)

_SAME: Final = 1e-6
"""m and rad; a frame that differs by less is the one printed with fewer digits."""
_NUMBER: Final = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d+)?"
_KUKA: Final = re.compile(
    r"^[ \t]*(?:DECL[ \t]+)?(?:FRAME[ \t]+)?(BASE|TOOL)_DATA[ \t]*"
    r"\[[ \t]*(\d{1,9})[ \t]*\][ \t]*=[ \t]*"
    r"\{(?:[ \t]*FRAME[ \t]*:)?([^{}]*)\}",
    re.IGNORECASE | re.MULTILINE,
)
_KUKA_PART: Final = re.compile(rf"[ \t]*([XYZABC])[ \t]+({_NUMBER})[ \t]*", re.IGNORECASE)
_ON_MACHINE: Final = re.compile(
    r"^[ \t]*MACHINE_FRAME_DAT[ \t]*\[[ \t]*(\d{1,9})[ \t]*\][ \t]*=[ \t]*\{[ \t]*"
    r"MACH_DEF_INDEX[ \t]+(\d{1,9})",
    re.IGNORECASE | re.MULTILINE,
)
_CND: Final = re.compile(r"^//(TOOL|UFRAME)[ \t]+(\d{1,9})[ \t]*$", re.IGNORECASE)
_SIX: Final = re.compile(rf"{_NUMBER}(?:[ \t]*,[ \t]*{_NUMBER}){{5}}")
_BASIC: Final = re.compile(r"^/+BASICFRM[ \t]+(.*)$", re.IGNORECASE)
_BASE_FRAME: Final = 16
"""Second value of ``BASICFRM`` of a user frame in the base frame."""
_VA: Final = re.compile(r"^\[\*SYSTEM\*\]\$MNU(FRAME|TOOL)\b(?!NUM)", re.MULTILINE)
_VA_ONE: Final = re.compile(
    r"\[[ \t]*1[ \t]*,[ \t]*(\d{1,9})[ \t]*\][ \t]*=(?>[^\[]*?Group[ \t]*:[ \t]*1\b)[^\[]*?"
    + r"\s++".join(rf"{letter}[ \t]*+:[ \t]*+({_NUMBER})" for letter in "XYZWPR"),
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerFile:
    """What one file holds.

    Attributes:
        name: File name.
        bases: Work frames (4, 4) in the robot base, by number.
        tools: Tools (4, 4) on the flange, by number.
        notes: What it holds and cannot be used, one sentence each.
    """

    name: str
    bases: dict[str, Array] = field(default_factory=dict)
    tools: dict[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_controller_file(name: str, data: bytes) -> ControllerFile | None:
    """Returns the frames of a file, told by its content; None if it is none that is known.

    Raises:
        FormatError: A frame of which not all six numbers can be read, with its line.
    """
    text = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    if re.search(r"^[ \t]*DEFDAT[ \t]+\$CONFIG\b", text, re.IGNORECASE | re.MULTILINE):
        return _kuka(name, text)
    if _VA.search(text):
        return _fanuc(name, text)
    if any(_CND.match(line) for line in text.split("\n")[:64]):
        return _yaskawa(name, text)
    return None


def with_files_beside(path: Path, dialect: str, given: FrameTable) -> tuple[FrameTable, list[str]]:
    """Returns the table with what files beside a program hold, and what to say of it.

    What the cell says goes before what a file says.

    Raises:
        FormatError: A file that cannot be read.
    """
    bases, tools = dict(given.bases), dict(given.tools)
    notes: list[str] = []
    wanted = {name.lower() for name in BESIDE.get(dialect, ())}
    folder = sorted(path.parent.iterdir()) if wanted and path.parent.is_dir() else []
    for beside in folder:
        if beside.name.lower() not in wanted or beside.name == path.name or not beside.is_file():
            continue
        found = read_controller_file(beside.name, read_bytes(beside))
        if found is None:
            continue
        notes += found.notes
        for side, have, new in (("base", bases, found.bases), ("tool", tools, found.tools)):
            notes += _differing(side, beside.name, have, new)
            have.update({key: matrix for key, matrix in new.items() if key not in have})
    return replace(given, bases=bases, tools=tools), notes


def _differing(
    side: str, name: str, have: Mapping[str, Array], new: Mapping[str, Array]
) -> list[str]:
    out = []
    for key, matrix in new.items():
        if key in have and not np.allclose(have[key], matrix, rtol=0.0, atol=_SAME):
            away = float(np.linalg.norm(have[key][:3, 3] - matrix[:3, 3])) / MM
            out.append(
                f"{side} {key} of the cell is used; that of {name} lies {away:.3f} mm from it."
            )
    return out


def _kuka(name: str, text: str) -> ControllerFile:
    out = ControllerFile(name=name)
    notes = []
    machine = {int(n): int(m) for n, m in _ON_MACHINE.findall(text)}
    for match in _KUKA.finditer(text):
        side, number = match[1].upper(), str(int(match[2]))
        parts = [_KUKA_PART.fullmatch(part) for part in match[3].split(",")]
        values = {part[1].upper(): float(part[2]) for part in parts if part}
        if len(values) != 6 or len(parts) != 6 or not np.isfinite([*values.values()]).all():
            raise _unread(name, text, match.start(), f"{side}_DATA[{number}]")
        if side == "BASE" and machine.get(int(number), 0) > 1:
            notes.append(
                f"{name}: base {number} stands on machine {machine[int(number)]}, not on the "
                "floor; give it in cell.toml, with the external axis that carries it."
            )
            continue
        xyz, abc = ([values[letter] for letter in word] for word in ("XYZ", "ABC"))
        (out.bases if side == "BASE" else out.tools)[number] = _pose(xyz, abc)
    return ControllerFile(name=name, bases=out.bases, tools=out.tools, notes=tuple(notes))


def _yaskawa(name: str, text: str) -> ControllerFile:
    out = ControllerFile(name=name)
    notes: list[str] = []
    current: tuple[str, str] | None = None
    elsewhere = False
    for line in text.split("\n"):
        head = _CND.match(line)
        basic = _BASIC.match(line)
        if head:
            current, elsewhere = (head[1].upper(), str(int(head[2]))), False
        elif basic:
            values = [part.strip() for part in basic[1].split(",")]
            told = values[1] if len(values) > 1 else ""
            elsewhere = told.isdecimal() and int(told[:9]) != _BASE_FRAME
        elif current is not None:
            kind, number = current
            inside = line.strip()
            if kind == "UFRAME":
                if not re.match(r"/+BUSER\b", inside, re.IGNORECASE):
                    continue
                inside = re.sub(r"^/+BUSER[ \t]*=?", "", inside, flags=re.IGNORECASE).strip()
            elif not inside or inside.startswith("/"):
                continue
            if not _SIX.fullmatch(inside) or not _finite(inside.split(",")):
                raise _unread(name, text, text.index(line), f"//{kind} {number}")
            current = None
            if elsewhere:
                notes.append(
                    f"{name}: user frame {number} is given in another frame than the base; give "
                    "it in cell.toml."
                )
                continue
            numbers = [float(part) for part in inside.split(",")]
            matrix = _pose(numbers[:3], numbers[:2:-1])
            (out.bases if kind == "UFRAME" else out.tools)[number] = matrix
    return ControllerFile(name=name, bases=out.bases, tools=out.tools, notes=tuple(notes))


def _fanuc(name: str, text: str) -> ControllerFile:
    out = ControllerFile(name=name)
    for match in _VA.finditer(text):
        end = text.find("\n[*", match.end())
        section = text[match.end() : end if end >= 0 else len(text)]
        for one in _VA_ONE.finditer(section):
            if not _finite(one.groups()[1:]):
                at = match.end() + one.start()
                raise _unread(name, text, at, f"$MNU{match[1].upper()}[1,{one[1]}]")
            numbers = [float(one[i]) for i in range(2, 8)]
            matrix = _pose(numbers[:3], numbers[:2:-1])
            side = out.bases if match[1].upper() == "FRAME" else out.tools
            side[str(int(one[1]))] = matrix
    if not out.bases and not out.tools:
        raise FormatError(
            "no position of group 1 in $MNUFRAME or $MNUTOOL.",
            source=name,
            line=1,
            hint="save the frames as ASCII (SYSFRAME.VA), not the binary SYSFRAME.SV.",
        )
    return out


def _finite(numbers: Sequence[str]) -> bool:
    return bool(np.isfinite([float(number) for number in numbers]).all())


def _pose(xyz: list[float], abc: list[float]) -> Array:
    return pose_from_xyz_abc(np.array(xyz) * MM, np.array(abc) * DEG)


def _unread(name: str, text: str, place: int, what: str) -> FormatError:
    return FormatError(
        f"{what} has not six finite numbers.",
        source=name,
        line=text.count("\n", 0, place) + 1,
        hint="save the file from the controller again.",
    )
