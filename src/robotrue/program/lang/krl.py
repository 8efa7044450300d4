"""KUKA KRL: ``.src`` programs and their ``.dat`` files.

What is read: inline, stored, array and structure points; PTP, LIN, CIRC and their S and SPL forms;
base and tool as the program sets them. Nothing but the numbers of targets is ever rewritten,
``$BASE``, ``$TOOL``, ``BASE_DATA``, ``TOOL_DATA`` and ``LOAD_DATA`` least of all.
:mod:`robotrue.program.formats.krl_write` defines how numbers are written.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import PurePath
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import inverse
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.controller_files import (
    NUMBER,
    ControllerFile,
    frame_of,
    print_abc,
    print_mm,
    unreadable_frame,
)
from robotrue.program.formats.stated_feeds import FLAGS, PLAIN, last_stated, target_lines
from robotrue.program.formats.text_lines import line_starts
from robotrue.program.insertion import Inserter
from robotrue.program.language import (
    Cutter,
    FrameFiles,
    FrameForm,
    Language,
    NamedBytes,
    TableForm,
)
from robotrue.program.program import FrameTable, Program, Replacement
from robotrue.program.target_poses import as_printed

_HEAD: Final = re.compile(
    rb"^(?:\xef\xbb\xbf)?[^\S\n]*+&ACCESS|^[^\S\n]*+(?:GLOBAL\s+)?DEF(?:DAT|FCT)?\s+\w",
    re.IGNORECASE | re.MULTILINE,
)
_MOTION: Final = re.compile(
    rb"^[^\S\n]*+S?(?:PTP|LIN|CIRC|SPL)(?:_REL)?\s*\{|=\s*\{\s*(?:E6POS|E6AXIS|POS|FRAME|AXIS)\s*:",
    re.IGNORECASE | re.MULTILINE,
)
_QUOTED: Final = re.compile(rb'"(?=([^"\r\n]+)")')
_CAMROB: Final = re.compile(rb"CR_PROCESS_FILE\s*\(\s*\Z", re.IGNORECASE)
_BEFORE: Final = 128
"""Bytes for a call and its blanks before the name it passes."""
_KUKA: Final = re.compile(
    r"^[ \t]*(?:DECL[ \t]+)?(?:FRAME[ \t]+)?(BASE|TOOL)_DATA[ \t]*"
    r"\[[ \t]*(\d{1,9})[ \t]*\][ \t]*=[ \t]*"
    r"\{(?:[ \t]*FRAME[ \t]*:)?([^{}]*)\}",
    re.IGNORECASE | re.MULTILINE,
)
_CONFIG: Final = re.compile(r"^[ \t]*DEFDAT[ \t]+\$CONFIG\b", re.IGNORECASE | re.MULTILINE)
_MACHINE: Final = re.compile(r"^[ \t]*DEFDAT[ \t]+\$MACHINE\b", re.IGNORECASE | re.MULTILINE)
_ROBROOT: Final = re.compile(
    r"^[ \t]*(?:DECL[ \t]+)?(?:FRAME[ \t]+)?\$ROBROOT[ \t]*=[ \t]*"
    r"\{(?:[ \t]*FRAME[ \t]*:)?([^{}]*)\}",
    re.IGNORECASE | re.MULTILINE,
)
_KUKA_PART: Final = re.compile(rf"[ \t]*([XYZABC])[ \t]+({NUMBER})[ \t]*", re.IGNORECASE)
_ON_MACHINE: Final = re.compile(
    r"^[ \t]*MACHINE_FRAME_DAT[ \t]*\[[ \t]*(\d{1,9})[ \t]*\][ \t]*=[ \t]*\{[ \t]*"
    r"MACH_DEF_INDEX[ \t]+(\d{1,9})",
    re.IGNORECASE | re.MULTILINE,
)
_SPEED: Final = re.compile(
    rb"^([^;\r\n]*?)(?:\$VEL\.CP[ \t]*=|\$VEL[ \t]*=|BAS[ \t]*\([ \t]*#(?:CP_PARAMS|VEL_CP)[ \t]*,)"
    rb"[ \t]*(?:" + PLAIN + rb"[ \t]*(?=[\r\n;,)]|C_|$))?",
    FLAGS,
)
_CARTESIAN: Final = re.compile(rb"[ \t]*S?(?:LIN|CIRC|PL)\b", re.IGNORECASE)


def _score(data: bytes) -> float:
    """1 for a KRL header with a motion or point, less for one of the two."""
    lower = data.lower()
    if not any(word in lower for word in (b"{", b"&access", b"def")):
        return 0.0
    python_like = re.search(rb"^[^\S\n]*+def\s+\w+\(.*\):", data, re.MULTILINE)
    head = bool(_HEAD.search(data)) and not python_like
    motion = bool(_MOTION.search(data))
    return 0.5 * motion + 0.5 * head


def _name_companions(name: str) -> tuple[str, ...]:
    """The ``.dat`` of a ``.src`` and the ``.src`` of a ``.dat``, in either case."""
    path = PurePath(name)
    other = "src" if path.suffix.lower() == ".dat" else "dat"
    return tuple(f"{path.stem}.{form}" for form in (other, other.upper(), other.capitalize()))


def _name_files(data: bytes) -> tuple[str, ...]:
    """The CAMRob files that a program hands to ``CR_PROCESS_FILE``."""
    if b'"' not in data:
        return ()
    names = [  # few quotes and many letters: the quotes are looked for
        quoted[1].decode("latin-1")
        for quoted in _QUOTED.finditer(data)
        if _CAMROB.search(data, max(0, quoted.start() - _BEFORE), quoted.start())
    ]
    return tuple(dict.fromkeys(name for name in names if not re.search(r"[/\\:]", name)))


def _read(files: NamedBytes, frames: FrameTable) -> tuple[Program, ...]:
    from robotrue.program.formats.krl_read import read_krl

    return read_krl(files, frames)


def _write(program: Program, replacement: Replacement) -> bytes:
    from robotrue.program.formats.camrob import write_camrob
    from robotrue.program.formats.krl_write import KrlSpans, write_krl

    if not isinstance(program.spans, KrlSpans):
        return write_camrob(program, replacement)
    return write_krl(*as_printed(program, replacement))


def _feeds(program: Program) -> Array:
    place, value, own = [], [], {}
    starts = line_starts(program.data)
    for match in _SPEED.finditer(program.data):
        said = float(match[2]) if match[2] else np.nan
        if _CARTESIAN.match(match[1]):
            own[int(np.searchsorted(starts, match.start(), side="right"))] = said
        else:
            place.append(match.start())
            value.append(said)
    feed = last_stated(program, place, value)
    lines = zip(program.line.tolist(), target_lines(program), strict=True)
    for row, (line, text) in enumerate(lines):
        feed[row] = own.get(line, feed[row]) if _CARTESIAN.match(text) else np.nan
    return feed


def _read_config(name: str, text: str) -> ControllerFile:
    """Reads the frames of a ``$config.dat``, without bases on another machine than the robot.

    Reads the robot's position in the world of a ``$machine.dat``.
    """
    if not _CONFIG.search(text):
        return _read_machine(name, text)
    out = ControllerFile(name=name)
    notes = []
    machine = {int(n): int(m) for n, m in _ON_MACHINE.findall(text)}
    for match in _KUKA.finditer(text):
        side, number = match[1].upper(), str(int(match[2]))
        frame = _read_aggregate(name, text, match, match[3], f"{side}_DATA[{number}]")
        if side == "BASE" and machine.get(int(number), 0) > 1:
            notes.append(
                f"{name}: base {number} is on machine {machine[int(number)]}, not on the floor; "
                "give it in cell.toml, with the external axis that carries it."
            )
            continue
        (out.bases if side == "BASE" else out.tools)[number] = frame
    return replace(out, notes=tuple(notes), declarations=True)


def _read_machine(name: str, text: str) -> ControllerFile:
    match = _ROBROOT.search(text)
    if match is None:
        return ControllerFile(name=name)
    frame = _read_aggregate(name, text, match, match[1], "$ROBROOT")
    return ControllerFile(name=name, T_base_world=inverse(frame))


def _read_aggregate(name: str, text: str, match: re.Match[str], inside: str, what: str) -> Array:
    """Returns the frame (4, 4) of ``X 1.0,Y 2.0,..,C 6.0``."""
    parts = [_KUKA_PART.fullmatch(part) for part in inside.split(",")]
    values = {part[1].upper(): float(part[2]) for part in parts if part}
    if len(values) != 6 or len(parts) != 6 or not np.isfinite([*values.values()]).all():
        raise unreadable_frame(name, text, match.start(), what)
    xyz, abc = ([values[letter] for letter in word] for word in ("XYZ", "ABC"))
    return frame_of(xyz, abc)


def _aggregate(xyz: Array, R: Array) -> str:
    values = zip("XYZABC", (*print_mm(xyz), *print_abc(R)), strict=True)
    return "{" + ",".join(f"{letter} {value}" for letter, value in values) + "}"


def _print_frame(xyz: Array, R: Array, name: str, number: int) -> str:
    values = _aggregate(xyz, R)
    return (
        f"; {name} in base, mm; R = Rz(A) Ry(B) Rx(C), deg\n"
        f"$BASE={values}\nBASE_DATA[{number}]={values}\n"
    )


def _print_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    values = _aggregate(xyz, R)
    return (
        f"; {name} in the flange, mm; R = Rz(A) Ry(B) Rx(C), deg\n"
        f"$TOOL={values}\nTOOL_DATA[{number}]={values}\n"
    )


def _print_move(T: Array) -> str:
    x, y, z = T[:3, 3] / MM
    a, b, c = abc_from_matrix(T[:3, :3]) / DEG
    return f"LIN {{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.5f},B {b:.5f},C {c:.5f}}}\n"


def _inserter() -> Inserter:
    from robotrue.program.formats.krl_insert import INSERTER

    return INSERTER


def _cutter() -> Cutter:
    from robotrue.program.formats.krl_chunks import CUTTER

    return CUTTER


LANGUAGE: Final = Language(
    name="krl",
    suffixes=(".src", ".dat", ".sub"),
    score=_score,
    looked_at=1 << 18,
    reader=_read,
    writer=_write,
    name_companions=_name_companions,
    name_files=_name_files,
    inserter=_inserter,
    cutter=_cutter,
    feeds=_feeds,
    frame_files=FrameFiles(
        names=("$config.dat", "$machine.dat"),
        recognise=lambda text: bool(_CONFIG.search(text) or _MACHINE.search(text)),
        read=_read_config,
    ),
    frame_form=FrameForm(
        name="krl",
        system="KUKA KRL",
        order="R = Rz(A) Ry(B) Rx(C), deg",
        frame=TableForm(first=1, last=128, print=_print_frame),
        tool=TableForm(first=1, last=128, print=_print_tool),
    ),
    print_move=_print_move,
    prints_attitude=True,
    steps_from_command=True,
    one_text=True,
)
