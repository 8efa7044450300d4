"""What programs of blocks in one job do to each other: numbered zero offsets, shifts in force."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from robotrue.program.formats.gcode_blocks import Blocks
from robotrue.program.formats.numbered_frames import list_changed_frames

Files = Sequence[tuple[str, bytes]]
_OFFSET: Final = re.compile(rb"\bG10[^\r\n]*?\bL(20?)[^\r\n]*?\bP0*(\d{1,3})\b", re.IGNORECASE)
_FRAME: Final = re.compile(rb"\$P_UIFR\s*\[\s*(\d{0,3})", re.IGNORECASE)
_NAMED: Final = re.compile(
    rb"(?im)^[ \t]*(?:0+[ \t]+)?(?:BEGIN[ \t]+PGM|PROC)[ \t]+([\w\-]+)|^%_N_(\w+?)_[MS]PF\b"
)
_NUMBER: Final = re.compile(rb"(?im)^[ \t]*O0*(\d{1,8})\b")


def list_changed_offsets(files: Files) -> list[Mapping[tuple[str, str], str]]:
    """Returns for each program what the others change of the control's zero offsets."""
    own = [list_changed_frames([each], (b"G10", b"$P_UIFR"), _list_offsets) for each in files]
    return [
        {key: what for n, each in enumerate(own) if n != k for key, what in each.items()}
        for k in range(len(files))
    ]


def _list_offsets(line: bytes) -> list[tuple[str, str]]:
    text = line.partition(b";")[0]
    out = []
    for kind, number in _OFFSET.findall(text):
        first = int(number)
        names = range(54, 60) if not first else (53 + first,)
        out += [f"G{n}" for n in names] if kind == b"2" else [f"G54.1 P{first}"]
    for number in _FRAME.findall(text):
        chosen = (int(number),) if number else range(1, 100)
        out += [f"G{53 + n}" if n <= 4 else f"G{500 + n}" for n in chosen]
    return [("base", name) for name in out]


def list_shifted_calls(files: Files, found: Sequence[Blocks]) -> dict[int, str]:
    """Returns the programs that others call while coordinates are shifted, with a sentence each.

    A program that is called by such a one is called so, too.
    """
    called = [_pattern(*each) for each in files]
    out: dict[int, str] = {}
    waiting = list(range(len(files)))
    while waiting:
        k = waiting.pop()
        for block, moved in found[k].findings.breaks:
            if not (moved or k in out):
                continue
            text = found[k].data[int(found[k].first[block]) : int(found[k].end[block])]
            for each, pattern in enumerate(called):
                if each != k and each not in out and pattern.search(text):
                    out[each] = (
                        f"{files[k][0]} may call it in line {found[k].line(block)} while the "
                        "coordinates are moved, turned or scaled"
                    )
                    waiting.append(each)
    return out


def _pattern(name: str, data: bytes) -> re.Pattern[bytes]:
    """Returns what a call of a program contains: its name, that in it, or its O number."""
    stem = re.split(r"[\\/]", name)[-1].partition(".")[0]
    names = {re.escape(stem.encode())} if stem else set()
    head = data[:4096]
    names |= {re.escape(match[1] or match[2]) for match in _NAMED.finditer(head)}
    words = [rb"\b" + each + rb"\b" for each in names]
    for match in _NUMBER.finditer(head):
        words += [rb"\b[PO]0*%b\b" % match[1], rb"\bP\d{1,4}%b\b" % match[1].zfill(4)]
    return re.compile(b"|".join(words) or rb"(?!)", re.IGNORECASE)
