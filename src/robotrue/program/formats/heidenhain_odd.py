"""The slow reader of conversational blocks: arcs, cycles, calls, and lines with parameters.

Straight lines with plain numbers are read compiled; all else comes here. ``CC`` and ``C`` make one
arc of two blocks; cycles that move the coordinates are followed only where they set zero.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from operator import itemgetter
from typing import Final

import numpy as np

from robotrue.program.formats.gcode_blocks import Findings
from robotrue.program.formats.gcode_vocabulary import (
    NAMED,
    Drive,
    Modal,
    Vocabulary,
    WordColumn,
)
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.program import Reason

_BLOCK: Final = re.compile(rb"[ \t]*+(?:N?\d++[ \t]*+)?+")
_PROGRAM: Final = re.compile(rb"(BEGIN|END)[ \t]+PGM\b.*?\b(MM|INCH)?[ \t]*$")
_MOVE: Final = re.compile(rb"(LN|LP|L|CR|CTP|CT|CP|CC|C)(?=[ \t]|$)")
_WORD: Final = re.compile(
    rb"(I?)([NT][XYZ]|[XYZABCUVWR])[ \t]*+(?:(" + WHOLE_NUMBER + rb")(?![\w.])|([+-]?Q[LRS]?\d++))"
)
_QUIET_WORD: Final = re.compile(
    rb"F(?:MAX|AUTO|Q[LR]?\d++|[UTZ]?[+-]?[\d.]++)?|M\d++|DR[+-]|M[BA] ?MAX\b"
    rb"|(?:M[BA]|LA|LEN|TDR)[+-]?[\d.]*"
)
_SIDE: Final = re.compile(rb"(?<!\w)R([0LR])(?=[ \t]|$)")
_CODE: Final = re.compile(rb"(?<![A-Z])M(\d{1,3})\b")
_SWITCHES: Final = (
    *(b"BLK FORM", b"TOOL DEF", b"STOP", b"END PGM", b"*", b"SPINDLE", b"?"),
    *(b"RND", b"CHF"),  # between two lines that are followed
)
_CYCLE: Final = re.compile(rb"CYCL[ \t]+DEF[ \t]+(\d{1,4})(?:\.(\d))?(.*)", re.DOTALL)
_SHIFTING: Final = {8: "a mirror", 10: "a rotation", 11: "a scale",
                    19: "a tilted plane", 26: "a scale"}  # fmt: skip
_DATUM: Final = "datum "
_DATUM_AXES: Final = "XYZABCUVW"
_DATUM_WORD: Final = re.compile(rb"(I?)([XYZABCUVW])[ \t]*([+-]?(?:Q\w*|[\d.]+))")
_TURNING: Final = re.compile(rb"\b(?:TURN|MOVE)\b")
_HARMLESS_CYCLES: Final = frozenset((9, 13, 32, 332, 239, 14, 20, 12))
_NUMBERED_PRESET: Final = re.compile(rb"Q339[ \t]*=[ \t]*[+]?(\d{1,6})\b")
_PARAMETER: Final = re.compile(rb"Q[LRS]?\d+[ \t]*=")
_JUMPS: Final = re.compile(rb"LBL\b|CALL\b|SEL\b|IF\b|FN[ \t]*(?:9|10|11|12)[ \t]*:|GOTO\b|%")
_PROGRAM_CALL: Final = re.compile(rb"CALL[ \t]+PGM\b|SEL\b|%")
_FUNCTION: Final = re.compile(rb"FUNCTION[ \t]+(RESET[ \t]+)?TCPM\b")
_NOT_ZERO: Final = re.compile(rb"[1-9Q]")


class ConversationalReader:
    """Reads odd blocks into :class:`.gcode_blocks.Findings`."""

    def __init__(self, vocabulary: Vocabulary, found: Findings) -> None:
        self.found = found
        self.begun = self.ended = False
        self._address = {name.encode(): k for name, k in vocabulary.columns.items() if k >= 0}
        self._pole: dict[int, tuple[int, int, float]] = {}
        self._user, self._shared = -1, False
        self._preset = self._every = False

    def take(self, block: int, first: int, text: bytes) -> None:
        """Takes a block without its comment; ``first`` is its first byte in the file."""
        text = text.upper().rstrip().removesuffix(b"~")
        match = _BLOCK.match(text)
        at = match.end() if match else 0
        rest = text[at:]
        program, move = _PROGRAM.match(rest), _MOVE.match(rest)
        if program:
            self._program(program)
        elif not self.begun and not move:
            return  # a head of words for people
        elif move:
            self._move(block, first, text, at, move)
        elif _CODE.match(rest):
            self._codes(block, first, rest)
        else:
            self._statement(block, first, rest)

    def _program(self, match: re.Match[bytes]) -> None:
        if match[1] == b"BEGIN":
            self.begun, self.found.inch = True, match[2] == b"INCH"
        else:
            self.ended = True

    def _statement(self, block: int, first: int, rest: bytes) -> None:
        function, cycle = _FUNCTION.match(rest), _CYCLE.match(rest)
        number = _NUMBERED_PRESET.search(rest) if self._preset else None
        if number:  # on the line after the cycle
            self._call_preset(block, number)
        if not rest or rest.startswith(_SWITCHES) or _PARAMETER.match(rest):
            return
        if function:
            self.found.set(block, Modal.TIP, 0 if function[1] else 1)
            if b"PATHCTRL VECTOR" in rest or b"REFPNT" in rest:
                self.found.told.append((first, "TCPM in a form that is not read"))
                self.found.shift(block, "TCPM", True)
        elif cycle:
            self._cycle(block, first, int(cycle[1]), cycle[2], cycle[3])
        elif rest.startswith(b"TOOL CALL"):
            self._tool(block, rest[9:].strip())
        elif rest.startswith(b"TRANS DATUM"):
            self._move_datum(block, first, "TRANS DATUM", rest[11:])
        elif rest.startswith((b"PLANE", b"TRANS")):
            kind = b" ".join(rest.split()[: 1 + rest.startswith(b"TRANS")]).decode("latin-1")
            self._shift(
                block, first, kind, kind + " .. moves the coordinates", b"RESET" not in rest
            )
            if _TURNING.search(rest):  # it drives the rotary axes, and with MOVE all others
                self.found.forget(block)
        elif rest.startswith((b"CYCL CALL", b"PATTERN", b"APPR", b"DEP", b"FC", b"FL")):
            side = _SIDE.search(rest)
            if rest.startswith((b"APPR", b"DEP")):
                self.found.set(block, Modal.SIDEWAYS, int(bool(side and side[1] != b"0")))
            self._own(block, first, rest)
        elif rest.startswith(b"FN") and not _JUMPS.match(rest):
            return
        else:
            what = rest[:30].decode("latin-1").strip()
            calls = "jumps" if _JUMPS.match(rest) else "is not known here"
            self.found.told.append((first, f"{what!r} {calls}: the modal state is uncertain"))
            self.found.barrier(block)
            if _JUMPS.match(rest) and not _PROGRAM_CALL.match(rest):
                self.found.jumps.append(block)

    def _own(self, block: int, first: int, rest: bytes) -> None:
        what = rest.split()[0].decode("latin-1")
        self.found.told.append((first, f"{what} makes its own moves"))
        self.found.forget(block)

    def _tool(self, block: int, rest: bytes) -> None:
        match = re.match(rb'"([^"]*)"|(\d+(?:\.\d)?)', rest)
        if match is None and not rest.startswith((b"S", b"Z", b"X", b"Y", b"F")) and rest:
            self.found.set(block, Modal.TOOL, -1)
        elif match is not None:
            named = (match[2] if match[1] is None else match[1]).decode("latin-1")
            self.found.set(block, Modal.TOOL, self.found.name("T" + named) + 1)
        axis = re.search(rb"(?<![\w\"])([XYZ])(?=[ \t]|$)", rest)
        if axis:
            self.found.set(block, Modal.PLANE, {b"Z": 0, b"Y": 1, b"X": 2}[axis[1]])
        self.found.forget(block)

    def _cycle(self, block: int, first: int, number: int, part: bytes, rest: bytes) -> None:
        if number == 7:
            self._move_datum(block, first, "CYCL DEF 7", rest if part != b"0" else b"")
        elif number in _SHIFTING and part == b"0":
            return
        elif number in _SHIFTING:
            on = bool(_NOT_ZERO.search(re.sub(rb"[XYZABC](?=[+-]|$|[ \t])", b"", rest)))
            if number == 8:
                on = bool(rest.strip())
            kind = str(number)
            kept = part != b"1" or b"IROT" in rest
            on = on or (kept and bool(self.found.shifts.get(kind)))
            self._shift(block, first, kind, f"CYCL DEF {number} is {_SHIFTING[number]}", on)
        elif number == 247:
            self.found.set(block, Modal.FRAME, NAMED - self.found.name("preset"))
            self._preset = True
            match = _NUMBERED_PRESET.search(rest)
            if match:
                self._call_preset(block, match)
        elif number not in _HARMLESS_CYCLES:
            self.found.told.append((first, f"CYCL DEF {number} is a cycle; it is not changed"))

    def _move_datum(self, block: int, first: int, named: str, words: bytes) -> None:
        """Follows for each axis whether its zero is moved; a line of a table may move all."""
        what = f"{named} is a datum shift"
        if b"#" in words or b"TABLE" in words or b"RESET" in words:
            for axis in _DATUM_AXES:
                self._shift(block, first, _DATUM + axis, what, b"RESET" not in words)
            return
        for step, axis, value in _DATUM_WORD.findall(words):
            on = bool(_NOT_ZERO.search(value))
            if on or not step:
                self._shift(block, first, _DATUM + axis.decode(), what, on)

    def _call_preset(self, block: int, match: re.Match[bytes]) -> None:
        named = self.found.name(f"preset {int(match[1])}")
        self.found.set(block, Modal.FRAME, NAMED - named)
        self._preset = False

    def _shift(self, block: int, first: int, kind: str, what: str, on: bool) -> None:
        if on and not self.found.shifts.get(kind):
            self.found.told.append((first, what))
        self.found.shift(block, kind, on)

    def _codes(self, block: int, first: int, rest: bytes) -> None:
        for match in _CODE.finditer(rest):
            code = int(match[1])
            if code in (128, 129):
                self.found.set(block, Modal.TIP, int(code == 128))
            elif code in (91, 92, 130, 114):
                self.found.told.append((first, f"M{code}: coordinates of another frame"))
                self.found.flag(block, Reason.UNKNOWN_FRAME)
                self.found.forget(block)
            elif code in (6, 89, 98, 99, 140, 118):
                self.found.forget(block)
                if code == 89 or (code == 99 and self._every):
                    self._every = True
                    what = "M89 calls the cycle at every point"
                    self._shift(block, first, "M89", what, code == 89)
                if code == 6:
                    self.found.changes.append(block)
                elif code != 118:
                    self._own(block, first, b"M%d" % code)
        if b"M118" in rest:
            self.found.silent.add(block)

    def _move(self, block: int, first: int, text: bytes, at: int, move: re.Match[bytes]) -> None:
        kind = move[1]
        words, reason, odd = self._words(block, first, text, at + move.end())
        if kind == b"CC":
            self._pole = {}
            self._user = -1
            if reason is None and not odd:
                self._pole = {k: words[k] for k in (0, 1, 2) if k in words}
            self.found.silent.add(block)
            return
        self._codes(block, first, text[at + move.end() :])
        sense = re.search(rb"DR([+-])", text[at:])
        if kind in (b"L", b"LN"):
            self.found.set(block, Modal.MOTION, Drive.LINE)
        elif kind in (b"C", b"CR") and sense:
            self.found.set(block, Modal.MOTION, Drive.LEFT if sense[1] == b"+" else Drive.RIGHT)
            if kind == b"C":
                self._use_pole(block, words)
        else:
            self.found.set(block, Modal.MOTION, Drive.OTHER)
            self.found.forget(block)
            words.setdefault(0, (-1, 0, np.nan))
            if kind in (b"LP", b"CP", b"CTP"):
                self._use_pole(block, {})
        if odd:
            comma = " (decimal commas: write points)" if re.match(r",\d", odd) else ""
            self.found.told.append((first + at, f"{odd!r} is not understood{comma}"))
            reason = reason or Reason.EXPRESSION
        if reason is not None:
            self.found.flag(block, reason)
        if kind != b"CR":
            words.pop(int(WordColumn.R), None)
        self.found.words += [(block, column, *word) for column, word in words.items()]

    def _use_pole(self, block: int, words: dict[int, tuple[int, int, float]]) -> None:
        """Uses the arc centre of the block before; a centre used twice cannot be moved."""
        if len(self._pole) < 2:
            return
        if self._user >= 0:
            if not self._shared:
                every, user = self.found.words, self._user
                at = bisect_left(every, user, key=itemgetter(0))
                arc = range(WordColumn.I, WordColumn.K + 1)
                every[at:] = [w for w in every[at:] if w[0] != user or w[1] not in arc]
            self._shared = True
            return
        self._user, self._shared = block, False
        for axis, word in self._pole.items():
            words[WordColumn.I + axis] = word

    def _words(
        self, block: int, first: int, text: bytes, at: int
    ) -> tuple[dict[int, tuple[int, int, float]], Reason | None, str]:
        """Returns the words by column, why they cannot be taken, and what is not understood."""
        words: dict[int, tuple[int, int, float]] = {}
        reason: Reason | None = None
        while at < len(text):
            if text[at] in b" \t":
                at += 1
                continue
            side = _SIDE.match(text, at)
            word = None if side else _WORD.match(text, at)
            quiet = None if side or word else _QUIET_WORD.match(text, at)
            match = side or word or quiet
            if match is None or match.end() == at:
                return words, Reason.EXPRESSION, text[at : at + 20].decode("latin-1")
            if side:
                self.found.set(block, Modal.SIDEWAYS, int(side[1] != b"0"))
            elif word:
                reason = self._word(first, word, words) or reason
            at = match.end()
        return words, reason, ""

    def _word(
        self, first: int, match: re.Match[bytes], words: dict[int, tuple[int, int, float]]
    ) -> Reason | None:
        name = match[2]
        column = int(WordColumn.R) if name == b"R" else self._address.get(name)
        if name in (b"U", b"V", b"W"):
            self.found.told.append((first, f"{name.decode()} moves an axis beside the six"))
            return Reason.EXTERNAL_AXIS
        if column is None:
            return None
        if match[1] or match[3] is None:
            words[column] = (-1, 0, np.nan)
            what = "an incremental coordinate" if match[1] else "a coordinate from a Q parameter"
            self.found.told.append((first, what))
            return Reason.RELATIVE if match[1] else Reason.EXPRESSION
        words[column] = (first + match.start(3), len(match[3]), float(match[3]))
        return None
