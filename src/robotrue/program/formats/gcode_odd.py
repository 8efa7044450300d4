"""The slow reader of blocks of G-code that hold more than addresses with numbers.

Keywords, assignments, comments in the middle, codes with a separate effect. An unknown word may be
any call: after it no setting is certain until the program states it again.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.program.formats.gcode_blocks import ALL, POINT, Findings
from robotrue.program.formats.gcode_jobs import list_offsets
from robotrue.program.formats.gcode_keywords import (
    CALLS,
    CANCELS,
    CYCLES,
    DRIVES,
    ENDING,
    HOMES,
    MACHINE,
    MOVING,
    OWN_MOVES,
    QUIET,
    QUIET_CODES,
    SETS,
    SHIFTS,
)
from robotrue.program.formats.gcode_vocabulary import (
    NAMED,
    UNCERTAIN,
    Modal,
    Vocabulary,
    WordColumn,
    address_table,
)
from robotrue.program.formats.number_text import WHOLE_NUMBER
from robotrue.program.program import Reason

_ASSIGNED: Final = re.compile(rb"([A-Z_$][A-Z0-9_$]*+(?:\[[^\[\]]*+\])?+)[ \t]*+=(?!=)[ \t]*+")
_FARTHEST: Final = 1e9
"""mm or deg; a frame beyond is none."""
_VALUE: Final = re.compile(rb"(" + WHOLE_NUMBER + rb")(?=[ \t]|$|[A-DF-Z_$])")
_NUMBERED: Final = re.compile(
    rb"([A-Z])[ \t]*+(" + WHOLE_NUMBER + rb")(?![=\[#_.\d])(?![ \t]*[=*/+-])"
)
_COMPUTED: Final = re.compile(rb"([A-Z])[ \t]*+[+-]?[#\[][^ \t]*+")
_KEYWORD: Final = re.compile(rb"([A-Z_$][A-Z_$][A-Z0-9_$]*+)[ \t]*+(\((?:[^()]|\([^()]*\))*+\)?)?+")
_LABEL: Final = re.compile(rb"(?:N\d+[ \t]*)?([A-Z_][A-Z0-9_]+):(?!=)")
_FLOW: Final = re.compile(rb"IF|ELSE|END|GOTO|WHILE|FOR|LOOP|REPEAT|UNTIL|CASE|DO")
_GOTO: Final = re.compile(rb"GOTO[BCFS]?[ \t]*(?:N?(\d{1,9})|([A-Z_]))?")
_PROGRAM: Final = re.compile(rb"(?::\d{1,8}|O?<[^<>]*>)[ \t]*")
_BLOCK_NUMBER: Final = re.compile(rb"N\d+[ \t]*(?=[/#])")
_FRAME: Final = re.compile(rb"\$P_UIFR\[(\d{1,2})\]$")
_PART: Final = re.compile(rb"(CTRANS|CROT)\(([^()]*)\)")
_NUMBER: Final = re.compile(WHOLE_NUMBER)
_GAP: Final = re.compile(rb"\s*+")
_LOCAL_ZERO: Final = re.compile(
    rb"(?:N\d+[ \t]*)?G0*52[ \t]*X("
    + WHOLE_NUMBER
    + rb")[ \t]*Y("
    + WHOLE_NUMBER
    + rb")[ \t]*Z("
    + WHOLE_NUMBER
    + rb")"
)
_POSITION: Final = re.compile(rb"[XYZ]")
_PRESET: Final = re.compile(rb"P(\d{1,3})")
_BASED: Final = re.compile(rb"'(?:B([01]{1,40})|H([0-9A-F]{1,10}))'")


class OddReader:
    """Reads odd blocks into :class:`.gcode_blocks.Findings`."""

    def __init__(self, vocabulary: Vocabulary, found: Findings) -> None:
        self._words, self.found = vocabulary, found

    def take(self, block: int, first: int, text: bytes) -> None:
        """Takes a block without its comment; ``first`` is its first byte in the file."""
        text = text.upper().rstrip()
        lead = len(text) - len(text.lstrip())
        if text[lead : lead + 1] in (b"%", b""):
            return
        number = _BLOCK_NUMBER.match(text, lead)
        if number is None and self._words.name == "fanuc_gcode":
            number = _PROGRAM.match(text, lead)
        lead = number.end() if number else lead
        if text[lead : lead + 1] == b"/":
            self._skippable(block, first, text, lead)
            return
        label = _LABEL.match(text, lead)
        if label:
            self.found.barrier(block)
            self.found.enter(block)
            self.found.jumps.append(block)
            self.found.told.append((first, "jumps may lead here: the modal state is uncertain"))
            lead = label.end()
        _Block(self, block, first, text, lead).read()

    @property
    def vocabulary(self) -> Vocabulary:
        """The control."""
        return self._words

    def _skippable(self, block: int, first: int, text: bytes, lead: int) -> None:
        """Marks what ``/`` blocks set as uncertain: a switch decides whether they run."""
        found, rest = self.found, lead + 1 + (text[lead + 1 : lead + 2].isdigit() and 1)
        shifts, moved, changes = dict(found.shifts), set(found.moved), len(found.changes)
        words, breaks = len(found.words), len(found.breaks)
        found.flag(block, Reason.INCOMPLETE)
        found.told.append((first, "a block with / may be skipped"))
        _Block(self, block, first, text, rest).read()
        columns = {word[1] for word in found.words[words:]} | set(found.lost.get(block, ()))
        if columns.intersection(ALL[len(POINT) :]):  # an orientation is known as a whole
            columns.update(ALL[len(POINT) :])
        found.forget(block, tuple(columns))
        if len(found.breaks) > breaks:
            found.moved |= moved
        elif (found.shifts, found.moved) != (shifts, moved):
            found.shifts, found.moved = shifts | {"skipped": True}, moved | {"skipped"}
            found.begun.add("skipped")
            found.ever_moved = True
        if len(found.changes) > changes:
            found.set(block, Modal.TOOL, UNCERTAIN)
        for group in Modal:
            if (block, group) in found.state:
                found.state[block, group] = UNCERTAIN


class _Block:
    def __init__(self, reader: OddReader, block: int, first: int, text: bytes, at: int) -> None:
        self._out, self._vocabulary = reader.found, reader.vocabulary
        self._block, self._first, self._text, self._at = block, first, text, at
        self._address = address_table(reader.vocabulary)
        self._found: list[tuple[int, int, int, int, float]] = []
        self._quiet = False
        self._keyword = False
        self._looked_for: dict[re.Pattern[bytes], re.Match[bytes] | None] = {}

    def read(self) -> None:
        """Reads the block to its end."""
        size = len(self._text)
        while self._at < size:
            if self._text[self._at] in b" \t\r\n":
                self._at += 1
                continue
            if self._vocabulary.signs[1] and self._text[self._at] == self._vocabulary.signs[1]:
                close = self._comment_end()
                if close < 0:
                    self._tell("a comment does not end")
                    self._out.barrier(self._block)
                    break
                self._at = close + 1
                continue
            if not (
                self._read_assignment()
                or self._read_numbered()
                or self._read_computed()
                or self._read_keyword()
            ):
                self._tell(f"{self._show_rest()} is not understood")
                self._out.barrier(self._block)
                self._out.flag(self._block, Reason.EXPRESSION)
                break
        if self._quiet:
            self._out.silent.add(self._block)
        once = {word[1]: word for word in self._found}
        if len(once) < len(self._found):
            self._out.flag(self._block, Reason.EXPRESSION)
            self._tell("an address occurs twice in a block")
        self._out.words += once.values()

    def _comment_end(self) -> int:
        """Returns the last byte of the comment here; people nest them, though controls do not."""
        depth, (_, opens, closes, _) = 0, self._vocabulary.signs
        for at in range(self._at, len(self._text)):
            depth += (self._text[at] == opens) - (self._text[at] == closes)
            if depth == 0:
                return at
        return self._text.rfind(bytes([closes]), self._at)

    def _anywhere(self, pattern: re.Pattern[bytes]) -> re.Match[bytes] | None:
        """Returns the first match in the block; it is looked for once."""
        if pattern not in self._looked_for:
            self._looked_for[pattern] = pattern.search(self._text)
        return self._looked_for[pattern]

    def _show_rest(self) -> str:
        return repr(self._text[self._at : self._at + 40].decode("latin-1").strip())

    def _tell(self, what: str) -> None:
        self._out.told.append((self._first + self._at, what))

    def _read_assignment(self) -> bool:
        match = _ASSIGNED.match(self._text, self._at)
        if match is None:
            return False
        name, value = match[1], _VALUE.match(self._text, match.end())
        based = _BASED.match(self._text, match.end()) if name in (b"STAT", b"TU") else None
        if based:
            self._at = based.end()
            number = float(int(based[1] or based[2], 2 if based[1] else 16))
            self._give(name, match.end(), based.end(), number)
            return True
        end = value.end() if value else self._computed_end(match.end())
        self._give(name, match.end(), end, None if value is None else float(value[1]))
        self._at = end
        return True

    def _computed_end(self, at: int) -> int:
        """End of an expression: a blank outside brackets, and outside an operator's reach."""
        depth, beyond = 0, at
        while at < len(self._text):
            c = self._text[at : at + 1]
            depth += (c in (b"(", b"[")) - (c in (b")", b"]"))
            if c in (b" ", b"\t") and depth <= 0:
                gap = None if beyond > at else _GAP.match(self._text, at)
                beyond = gap.end() if gap else beyond
                after = self._text[beyond : beyond + 1]
                if not (after in b"+-*/" and after) and self._text[at - 1] not in b"+-*/=":
                    break
            at += 1
        return at

    def _give(self, name: bytes, start: int, end: int, value: float | None) -> None:
        column = self._address.get(name)
        if column is not None:
            if column >= 0:
                self._word(column, start, end, value)
            if WordColumn.J1 <= column <= WordColumn.J6:  # the pose of that is not stated
                self._out.forget(self._block)
            return
        frame = _FRAME.match(name)
        if frame:
            number = int(frame[1])
            named = f"G{53 + number}" if 1 <= number <= 4 else f"G{500 + number}"
            matrix = _frame_of(self._text[start:end])
            self._out.frames.append((self._block, named if number else "G500", matrix))
        elif name.startswith(b"$P_") or name.startswith((b"$MC", b"$MN", b"$MA", b"$SC", b"$NT")):
            if value is not None and name.startswith((b"$SC", b"$P_SIM")):
                return
            self._tell(f"{name.decode('latin-1')} is set")
            self._out.shift(self._block, "frame variable", True)
        elif re.fullmatch(rb"[A-Z]\d{0,2}", name) and not re.fullmatch(
            rb"R\d+|F\d?|T\d?|H\d", name
        ):
            self._external(name, value)
        elif name.startswith(b"$TC_DP"):
            self._out.remarks.append(
                (self._first, "the program sets data of a tool; that of the cell is used")
            )
        elif name in (b"T", b"T1"):
            text = self._text[start:end].strip(b'" ')
            self._tool("T" + text.decode("latin-1"))
        elif name in (b"AR", b"AP", b"RP", b"TURN", b"ANG", b"RND", b"CHF", b"CHR", b"THETA"):
            self._tell(f"{name.decode()}= moves to its own point")
            self._out.flag(self._block, Reason.EXPRESSION)
            self._out.forget(self._block)

    def _external(self, name: bytes, value: float | None) -> None:
        if value != 0.0:
            self._tell(f"{name.decode()} moves an axis beside the six of the arm")
            self._out.flag(self._block, Reason.EXTERNAL_AXIS)

    def _word(self, column: int, start: int, end: int, value: float | None) -> None:
        if value is None:
            counted = self._text[start:end].startswith(b"IC(")
            self._out.flag(self._block, Reason.RELATIVE if counted else Reason.EXPRESSION)
            self._tell("IC counts from the point before" if counted else "a coordinate is computed")
            self._found.append((self._block, column, -1, 0, np.nan))
            return
        token = _NUMBER.match(self._text, start)
        size = end - start if token is None else token.end() - start
        self._found.append((self._block, column, self._first + start, size, value))

    def _read_numbered(self) -> bool:
        match = _NUMBERED.match(self._text, self._at)
        if match is None:
            return False
        letter, value = match[1], float(match[2])
        if letter in b"GM":
            self._code(f"{letter.decode()}{value:g}")
        elif letter == b"T":
            self._tool(f"T{value:g}")
        elif letter == b"D":
            if value == 0.0:
                self._tool("D0")
        elif letter in self._address:
            if self._address[letter] >= 0:
                self._word(self._address[letter], match.start(2), match.end(2), value)
        elif letter == b"L" and self._vocabulary.name == "sinumerik":
            self._call(match[0].strip().decode("latin-1"))
        elif letter not in b"PQLR" and not self._quiet:
            self._external(letter, value)
        self._at = match.end()
        return True

    def _code(self, code: str) -> None:
        known = self._vocabulary.codes.get(code)
        if known is not None:
            if known[0] >= 0:
                self._out.state[self._block, known[0]] = known[1]
        elif code in MACHINE:
            self._machine()
        elif code in HOMES:
            self._quiet |= code != "M6"
            self._out.forget(self._block)
            if code == "M6":
                self._out.changes.append(self._block)
        elif code in QUIET_CODES:
            self._quiet = True
        elif code == "G54.1" and self._vocabulary.name == "fanuc_gcode":
            match = self._anywhere(_PRESET)
            named = self._out.name(f"G54.1 P{int(match[1])}" if match else "G54.1")
            self._out.set(self._block, Modal.FRAME, NAMED - named)
        elif code in ENDING and not self._anywhere(_POSITION):
            self._out.shift(self._block, ENDING[code], False)
            self._out.forget(self._block)
        elif code == "G52" and self._set_local_zero():
            return
        elif code in MOVING:
            if code == "G10":
                for _, offset in list_offsets(self._text):
                    self._out.frames.append((self._block, offset, None))
            self._quiet = True
            if code == "G92":
                self._out.anchors.append(self._block)
            self._tell(f"{code} moves or turns the coordinates")
            self._out.shift(self._block, MOVING[code], True)
            self._out.forget(self._block)
        elif code in ("G66", "G66.1", "G67"):
            self._call_at_points(code, "" if code == "G67" else "P")
        elif code in CALLS:
            self._call(code)
        else:
            self._tell(f"{code} is not known here")
            self._out.barrier(self._block)
            self._out.flag(self._block, Reason.EXPRESSION)

    def _set_local_zero(self) -> bool:
        """Reads a local zero of three constants as a work frame; False for any other."""
        match = _LOCAL_ZERO.fullmatch(self._text.strip())
        numbers = match.groups() if match else ()
        sure = all(b"." in each or float(each) == 0.0 for each in numbers)
        if not numbers or not sure or self._vocabulary.name != "fanuc_gcode":
            return False
        x, y, z = (float(each) for each in numbers)
        named = f"G52 of line {self._block + 1}"
        self._out.local.append((self._block, named, (x, y, z)))
        self._out.set(self._block, Modal.FRAME, NAMED - self._out.name(named))
        self._out.shift(self._block, "local", False)
        if any((x, y, z)):  # a work frame here, but not in a program that is called
            self._out.moved.add("local")
            self._out.begun.add("local")
            self._out.ever_moved = True
        self._out.forget(self._block, POINT)  # the angles are about the same axes
        self._quiet, self._at = True, len(self._text)
        return True

    def _call(self, what: str) -> None:
        if what == "M99":
            self._out.rounds.append(self._block)
        else:
            self._tell(f"{what} calls another program: the modal state after it is uncertain")
        # beside M98 coordinates are a move, beside G65 arguments
        self._quiet |= what not in ("M98", "M198")
        self._out.barrier(self._block)

    def _call_at_points(self, what: str, called: str) -> None:
        """Takes what is called behind every point from here on: a cycle, a program, or nothing."""
        on = "cycle" if called.startswith(CYCLES) else "program"
        for kind in ("cycle", "program"):
            named = f"{kind} at points"
            if kind == "program" and (named in self._out.moved or (called and on == kind)):
                self._out.moved.add(named)
                self._out.barrier(self._block)
            self._out.shift(self._block, named, bool(called) and on == kind)
        if called:
            self._tell(f"{what} makes its own moves at every point")
        self._out.forget(self._block)
        self._quiet, self._at = True, len(self._text)

    def _machine(self) -> None:
        self._tell("coordinates of the machine")
        self._out.flag(self._block, Reason.UNKNOWN_FRAME)
        self._out.forget(self._block)

    def _tool(self, name: str) -> None:
        self._out.set(self._block, Modal.TOOL, self._out.name(name) + 1)

    def _read_computed(self) -> bool:
        """``X#101``, ``Z[#1+2]``; ``#100=5`` moves nothing."""
        if self._text[self._at : self._at + 1] == b"#":
            self._at = len(self._text)
            self._quiet = True
            return True
        match = _COMPUTED.match(self._text, self._at)
        if match is None:
            return False
        column = self._address.get(match[1])
        if column is None or match[1] in b"GM":
            self._call("a computed word")
        elif column >= 0:
            self._word(column, match.start(), match.end(), None)
        self._at = match.end()
        return True

    def _read_keyword(self) -> bool:
        match = _KEYWORD.match(self._text, self._at)
        if match is None:
            return False
        word, arguments = match[1], match[2]
        self._at = match.end()
        if word in SETS:
            group, value = SETS[word]
            self._out.set(self._block, group, value)
            if group == Modal.TIP:
                self._out.shift(self._block, "transformation", False)
                self._out.forget(self._block)
        elif word in DRIVES:
            self._out.set(self._block, Modal.MOTION, DRIVES[word])
        elif word == b"SUPA":
            self._machine()
        elif word in SHIFTS or word in CANCELS:
            self._shift(word, arguments)
        elif word == b"MCALL":
            self._call_at_points("MCALL", self._text[self._at :].strip().decode("latin-1"))
        elif word.startswith(OWN_MOVES) and word not in QUIET:
            self._tell(f"{word.decode('latin-1')} makes its own moves")
            self._quiet = True
            self._out.forget(self._block)
            self._at = len(self._text)
        elif word in (b"DEF", b"EXTERN", b"PROC", b"MSG", b"FGROUP", b"WORKPIECE"):
            self._quiet, self._at = True, len(self._text)
        elif word not in QUIET:
            self._tell(f"{word.decode('latin-1')} may call or skip anything: the modal state "
                "after it is uncertain")  # fmt: skip
            self._quiet, self._at = True, len(self._text)
            self._out.barrier(self._block)
            if _FLOW.match(word):
                self._out.jumps.append(self._block)
            for number, named in _GOTO.findall(self._text):
                if not named:
                    self._out.targets.add(int(number or -1))
        return True

    def _shift(self, word: bytes, arguments: bytes | None) -> None:
        rest = (arguments or b"").strip(b"() \t") + self._text[self._at :].strip()
        if not rest and word in CANCELS:
            self._out.shift(self._block, CANCELS[word], False)
        else:
            kind = SHIFTS.get(word) or CANCELS[word]
            self._tell(f"{word.decode()} moves, turns or scales the coordinates")
            self._out.shift(self._block, kind, True)
        self._out.forget(self._block)
        self._quiet, self._at = True, len(self._text)


def _frame_of(text: bytes) -> Array | None:
    """Returns CTRANS(..):CROT(..) as a matrix (4, 4); None if it is anything else."""
    parts = text.replace(b" ", b"").split(b":")
    out = np.eye(4)
    for part in parts:
        match = _PART.fullmatch(part)
        values = None if match is None else _named_numbers(match[2])
        if match is None or values is None:
            return None
        if match[1] == b"CTRANS":
            step = pose(np.eye(3), values * MM)
        else:
            step = pose(matrix_from_abc(values[::-1] * DEG), np.zeros(3))
        out = out @ step
    return out


def _named_numbers(text: bytes) -> Array | None:
    """Returns x, y, z of ``X,1.0,Y,2.0,Z,3.0``; None if it is anything else or beyond bounds."""
    fields = text.split(b",")
    out = np.zeros(3)
    for name, value in zip(fields[::2], fields[1::2], strict=False):
        if name not in (b"X", b"Y", b"Z") or not _NUMBER.fullmatch(value):
            return None
        out[b"XYZ".index(name)] = float(value)
    return out if len(fields) % 2 == 0 and np.abs(out).max() < _FARTHEST else None
