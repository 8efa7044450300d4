"""Reads the lines of a KRL file in program order: which point is moved to, and how.

Lines that are a motion to a plain aggregate never come here; the scanner has already sorted them.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.program.formats.camrob import CALL
from robotrue.program.formats.krl_flow import BASE, ON_ROBOT, TOOL, Flow
from robotrue.program.formats.krl_frames import Frames, read_fdat, with_settings
from robotrue.program.formats.krl_scan import (
    INLINE_ARC,
    INLINE_LIN,
    INLINE_PTP,
    INLINE_SPLINE,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
)
from robotrue.program.formats.krl_story import Called, Definition, ParsedKrl
from robotrue.program.program import Motion, Reason

MOTION_OF: Final = {
    INLINE_PTP: Motion.PTP,
    INLINE_LIN: Motion.LIN,
    INLINE_SPLINE: Motion.SPLINE,
    INLINE_ARC: Motion.ARC_END,
}
_MOTION: Final = re.compile(r"\s*S?(PTP|LIN|CIRC|SPL)(_REL)?(?!\w)", re.IGNORECASE)
_WORD: Final = re.compile(r"\s*(\$?\w+)")
_REFERENCE: Final = re.compile(r"(\$?[A-Za-z_]\w*)(?:\s*\[([^\]]*)\])?((?:\s*\.\s*[A-Za-z_]\w*)*)")
_DEFINE: Final = re.compile(
    r"\s*+(?:(?:GLOBAL|DECL|CONST)\s++)*(?:(\w++)\s++)?(\$?\w++)\s*+(?:\[([^\]]*+)\])?"
    r"((?:\s*+\.\s*+\w++)*+)\s*+=(?!=)\s*+",
    re.IGNORECASE,
)
_BAS: Final = re.compile(r"\s*BAS\s*\(\s*#(\w+)\s*(?:,\s*(\w+)\s*)?", re.IGNORECASE)
_WITH: Final = re.compile(r"\$(?:BASE|TOOL|IPO_MODE)\s*=", re.IGNORECASE)
_MEMBER: Final = re.compile(r"(?:\b(\w++)\s*+(?=[\[{}]))?+(?:(\[[^\[\]{}]*+\])\s*+)?+([{}])")
_LAST: Final = re.compile(r"\b(\w++)\s*+(\[[^\[\]]*+\])?+\s*+$")
_CALL: Final = re.compile(r"\s*(\w+)\s*\(")
_CALLED: Final = re.compile(r"\b(\w++)\s*+\(")
_STARTED: Final = re.compile(r"\s*(?:GLOBAL\s+)?(INTERRUPT|TRIGGER)\b", re.IGNORECASE)
_HANDLER: Final = re.compile(r"\bDO\s+(\w+)\s*\(", re.IGNORECASE)
_GLOBAL: Final = re.compile(
    r"\s*(?:DECL\s+GLOBAL|GLOBAL\s+DECL|GLOBAL)\s+(?!DEF|INTERRUPT|DECL)\w+\s+([^=]+)",
    re.IGNORECASE,
)
_GIVEN_NAME: Final = re.compile(r"\b(\w++)\s*+(?:\[[^\[\]]*+\])?+\s*+(?:,|$)")
_LABEL: Final = re.compile(r"\s*(\w+)\s*:\s*$")
_GOTO: Final = re.compile(r"\s*GOTO\s+(\w+)", re.IGNORECASE)
_STRING: Final = re.compile(r'"[^"]*"')
_MOST_SEARCHED: Final = 50_000
"""Elements that moves to a computed one may mean, in all; with more, none is compensated."""
_POINT_TYPES: Final = ("e6pos", "pos", "frame", "e6axis", "axis")
_OTHER_TYPES: Final = ("fdat", "pdat", "ldat", "load", "int", "real", "bool", "char", "signal")
_COLUMN: Final = {"base": BASE, "tool": TOOL}
_LOOP: Final = {"for": "endfor", "while": "endwhile", "loop": "endloop", "repeat": "until"}
_LOOP_END: Final = set(_LOOP.values())
_SILENT: Final = {"ext", "extfct", "import", "end", "endfct", "enddat", "struc", "enum"}


def _first_aggregates(found: Scan) -> IntArray:
    """Returns (l + 1,) how many aggregates stand before each line, and at last how many in all."""
    first = np.zeros(len(found.line_kind) + 1, np.int64)
    np.cumsum(np.bincount(found.agg_line, minlength=len(first) - 1), out=first[1:])
    return first


def _clean(text: str | None) -> str:
    return re.sub(r"\s+", "", text or "").lower()


class KrlWalk:
    """One reading of a main file and the data file beside it."""

    def __init__(self, scans: list[Scan], names: list[str], frames: Frames) -> None:
        self.scans, self.names, self.frames = scans, names, frames
        self.beside: set[str] = set()
        self.scope = frames.scope
        self.flow = Flow(frames.table.harmless_routines)
        self._storing = False
        self.first = [_first_aggregates(found) for found in scans]
        self.story = ParsedKrl([], defaultdict(list), {}, [], {}, [], [], False, [], {}, [], set())
        self._current: dict[str, dict[tuple[str, str], Definition]] = defaultdict(dict)
        self._variables: dict[str, Array] = {}
        self._absent: set[str] = set()
        self._searched = 0

    def data_file(self, file: int) -> None:
        """Reads declarations only."""
        self._storing = True
        self.scope.enter(self.names[file])
        for line in np.flatnonzero(self.scans[file].line_kind == STATEMENT).tolist():
            code = self._code(file, line)
            match = _WORD.match(code)
            word = match[1].lower() if match else ""
            shared = _GLOBAL.match(code)
            if shared:
                names = _GIVEN_NAME.findall(shared[1].strip())
                self.story.shared.update(self.scope.name(name) for name in names)
            if word == "defdat":
                self.story.has_def = True
            elif word not in _SILENT and "=" in code:
                self._assign(file, line, code)
        self._storing = False

    def main_file(self, file: int) -> None:
        """Reads every statement in program order."""
        for line in np.flatnonzero(self.scans[file].line_kind == STATEMENT).tolist():
            self.scope.reach(line)
            self._statement(file, line, self._code(file, line))

    def _code(self, file: int, line: int) -> str:
        code = self.scans[file].code(line)
        return (
            _STRING.sub(lambda m: '"' + " " * (len(m[0]) - 2) + '"', code) if '"' in code else code
        )

    def _statement(self, file: int, line: int, code: str) -> None:
        match = _WORD.match(code)
        word = match[1].lower() if match else ""
        if word in ("def", "deffct", "global") and re.search(r"\bDEF(FCT)?\b", code, re.I):
            self._define(line, code)
            return
        if "(" in code and word not in ("bas", *_SILENT):
            self._note_calls(line, code)
        motion = _MOTION.match(code)
        if motion and not re.match(r"\s*[=(\[.]", code[motion.end() :]):
            self._motion(file, line, code, motion)
        elif word == "bas":
            self._bas(line, code)
        elif word == "defdat":
            self.story.has_def = True
        elif word in _SILENT:
            pass
        elif word == "spline":
            self.flow.save()
            self._with(file, line, code)
        elif word == "endspline":
            self.flow.restore(line)
        elif self._control(line, word, code):
            self._barrier(line)
            self._taint(line, code)
        elif _DEFINE.match(code):
            self._assign(file, line, code)
        elif word not in ("decl", "wait", "halt", *_POINT_TYPES, *_OTHER_TYPES):
            self._other(file, line, code)

    def _other(self, file: int, line: int, code: str) -> None:
        call, label = _CALL.match(code), _LABEL.match(code)
        if call and call[1].lower() == "cr_process_file":
            self._camrob(file, line)
        if label:
            self.flow.label(line, label[1].lower())
        if call or label:
            self._barrier(line)
        self._taint(line, code)

    def _camrob(self, file: int, line: int) -> None:
        match = CALL.search(self.scans[file].code(line))
        if match and match[1].lower() in self.beside:
            first, last = (int(match[2]), int(match[3])) if match[2] else (1, -1)
            self.story.called_files.append(Called(line, match[1], first, last))
        else:
            name = match[1] if match else "a file named elsewhere"
            self._note(line, file, f"the targets stand in {name}, which is not beside the program")

    def _note_calls(self, line: int, code: str) -> None:
        started = _STARTED.match(code)
        names = (_HANDLER if started else _CALLED).findall(code)
        self.story.spelled.update((name.lower(), name) for name in names)
        names = [name.lower() for name in names]
        if started:
            for name in names:
                self.flow.handler(name)
            if started[1].lower() == "trigger":
                self.flow.trigger(line, names)
        else:
            self.flow.call(line, names)

    def _define(self, line: int, code: str) -> None:
        if code.rstrip().endswith(":"):
            return  # ``def name():`` is Python's or URScript's
        self.story.has_def = True
        self._barrier(line)
        name = _CALLED.search(code)
        self.flow.start(line, name[1].lower() if name else "")

    def _control(self, line: int, word: str, code: str) -> bool:
        """Draws branches, loops and jumps; returns whether the line is control flow."""
        flow = self.flow
        if word in ("if", "switch"):
            flow.branch(line, opens=word == "if")
        elif word in ("else", "case", "default"):
            flow.alternative(line, other=word != "case")
        elif word in ("endif", "endswitch"):
            flow.join(line)
        elif word in _LOOP:
            flow.loop(line)
        elif word in _LOOP_END:
            flow.close_loop(line)
        elif word == "exit":
            flow.exit_loop(line)
        elif word == "return":
            flow.leave(line)
        elif word == "goto":
            to = _GOTO.match(code)
            flow.jump(line, to[1].lower() if to else "")
        elif word == "resume":
            flow.resume()
        else:
            return word in ("interrupt", "trigger")
        return True

    def _bas(self, line: int, code: str) -> None:
        match = _BAS.match(code)
        if not match:
            return
        what = match[1].lower()
        if what in ("tool", "base"):
            self._put(line, what, self.frames.number(what, line, match[2]))
        elif what == "ex_base":
            self._put(line, "base", self.frames.carried_number(line, match[2]))
        elif what in ("frames", "ptp_params", "cp_params"):
            self.flow.take_pending(line)

    def _assign(self, file: int, line: int, code: str) -> None:
        match = _DEFINE.match(code)
        if not match:
            return
        kind, variable = (match[1] or "").lower(), self.scope.name(match[2])
        index, path, rest = _clean(match[3]), _clean(match[4]).strip("."), code[match.end() :]
        if variable in ("$base", "$tool"):
            self._set_frame(file, line, variable[1:], path, rest)
        elif variable == "$ipo_mode":
            self._set(line, ON_ROBOT, self.frames.holder(rest))
        elif variable in ("base_data", "tool_data"):
            side = variable[:4]
            if index.isdecimal() and not path:
                new = self._resolve(file, line, side, rest)
                if self.flow.in_branch and new != self.frames.number(side, line, index):
                    what, cure = f"data {index} is set on one branch", "set it on every way"
                    new = self.frames.unknown(side, line, what, cure)
                self.frames.store(side, index, new)
            else:
                what, cure = "data is changed by an expression", "write it as numbers"
                self.frames.store(side, index, self.frames.unknown(side, line, what, cure))
        elif variable == "fdat_act":
            self._inline(line, path, rest)
        elif kind == "fdat":
            self.frames.fdat[variable] = read_fdat(rest)
        elif variable in ("load_data", "$load", "pdat_act", "ldat_act") or kind in _OTHER_TYPES:
            self._taint(line, rest)
        else:
            self._point(file, line, code, match.end(), variable, index, path)

    def _point(
        self, file: int, line: int, code: str, at: int, variable: str, index: str, path: str
    ) -> None:
        scan, first = self.scans[file], self.first[file]
        offset = int(scan.line_start[line])
        aggs = range(int(first[line]), int(first[line + 1]))
        opened = [int(scan.agg_open[agg]) - offset for agg in aggs]
        for agg, here, member in zip(aggs, opened, _members(code, at, opened, path), strict=True):
            inner = path if here == at else member
            definition = Definition(file, agg, variable, index, inner)
            self.story.definitions.append(definition)
            self._current[variable][index, inner] = definition
            if scan.agg_flag[agg] & NOT_CONSTANT:
                self.story.flags[file, agg] = Reason.EXPRESSION
            if here == at:
                values = self._values(file, agg)
                before = self._variables.get(variable, values)
                if self.flow.in_branch and not np.array_equal(before, values):
                    values = np.full(6, np.nan)
                self._variables[variable] = values
        rest = code[at:]
        if aggs:
            tail = code[int(scan.agg_close[aggs[-1]]) - offset + 1 :].strip()
            if rest.startswith("{") and (not tail or tail.startswith(("}", ","))):
                return
            rest = tail
        self._variables.pop(variable, None)
        self.story.tainted.setdefault((variable, path), line)
        self._taint(line, rest)

    def _values(self, file: int, agg: int) -> Array:
        scan = self.scans[file]
        values = np.full(6, np.nan)
        for token in range(int(scan.agg_token[agg]), int(scan.agg_token[agg + 1])):
            if scan.tok_component[token] < 6:
                values[scan.tok_component[token]] = scan.tok_value[token]
        return values

    def _resolve(self, file: int, line: int, side: str, rest: str) -> int:
        first = self.first[file]
        aggs = range(int(first[line]), int(first[line + 1]))
        if rest.startswith("{") and len(aggs) >= 1:
            scan = self.scans[file]
            agg = next(a for a in aggs if scan.agg_open[a] >= scan.line_start[line])
            tail = rest[rest.find("}") + 1 :].strip()
            if not tail:
                return self.frames.aggregate(side, line, self._values(file, agg))
        return self.frames.expression(side, line, rest, self._variables)

    def _set_frame(self, file: int, line: int, side: str, path: str, rest: str) -> None:
        if path:
            what, cure = "is changed by a single component", "write the whole frame as numbers"
            index = self.frames.unknown(side, line, what, cure)
        else:
            index = self._resolve(file, line, side, rest)
        self._put(line, side, index)

    def _inline(self, line: int, path: str, rest: str) -> None:
        frames = self.frames
        inline = read_fdat(rest)
        if path or not rest.startswith("{"):
            named = self.scope.name(rest.strip())
            inline = frames.fdat.get(named, read_fdat("")) if not path else inline
        if not self._storing:
            self.flow.pend(line, *frames.inline_frames(line, inline))

    def _with(self, file: int, line: int, code: str) -> None:
        """Puts in force what a WITH clause sets for its motion or spline block."""
        scan, aggs = self.scans[file], range(*self.first[file][line : line + 2].tolist())
        opened = {int(scan.agg_open[a]) - int(scan.line_start[line]): a for a in aggs}
        for side, text, place in with_settings(code):
            if side == "ipo_mode":
                self._set(line, ON_ROBOT, self.frames.holder(text))
            elif text.startswith("{"):
                here = opened.get(place)
                values = np.full(6, np.nan) if here is None else self._values(file, here)
                self._put(line, side, self.frames.aggregate(side, line, values))
            else:
                index = self.frames.expression(side, line, text, self._variables)
                self._put(line, side, index)

    def _put(self, line: int, side: str, index: int) -> None:
        self._set(line, _COLUMN[side], index)

    def _set(self, line: int, column: int, value: int) -> None:
        if not self._storing:
            self.flow.set(line, (column, value))

    def _barrier(self, line: int) -> None:
        self.story.sequence.append((line, -1, False))

    def _taint(self, line: int, code: str) -> None:
        closed = code.rfind("]") + 1  # a bracket behind it is not closed: it holds no index
        for name, _, path in _REFERENCE.findall(code[:closed] + code[closed:].replace("[", "(")):
            self.story.tainted.setdefault((self.scope.name(name), _clean(path).strip(".")), line)

    def _motion(self, file: int, line: int, code: str, match: re.Match[str]) -> None:
        kind, relative = match[1].upper(), match[2] is not None
        operands, end = self._operands(file, line, code, match.end(), 2 if kind == "CIRC" else 1)
        if "$" in code[end:] and _WITH.search(code, end):
            self.flow.save()
            self._with(file, line, " " * end + code[end:])
            self.flow.restore(line + 1)
        motion = {"PTP": Motion.PTP, "LIN": Motion.LIN, "SPL": Motion.SPLINE}.get(kind)
        if kind == "CIRC" and len(operands) < 2:
            self._note(line, file, "CIRC with one point; it is not compensated")
            self.story.flags |= dict.fromkeys(operands[0] if operands else (), Reason.INCOMPLETE)
        used: list[list[tuple[int, int]]] = []
        for number, operand in enumerate(operands):
            how = motion if motion is not None else (Motion.ARC_VIA, Motion.ARC_END)[number]
            for key in operand:
                self.story.uses[key].append((line, how))
                if relative:
                    self.story.flags[key] = Reason.RELATIVE
            if not operand:
                self.story.lost.append((line, how))
            used.append(operand)
            single = len(operand) == 1 and operand[0][0] == file and not relative
            agg = operand[0][1] if single else -1
            if how is not Motion.ARC_VIA:
                self.story.sequence.append((line, agg, False))
            elif agg >= 0:
                self.story.sequence.append((line, agg, True))
        if not operands:
            self._barrier(line)
        if len(used) == 2 and all(used):
            self.story.arcs.extend(
                (via, last)
                for via in used[0]
                for last in (used[1] if len(used[0]) == 1 or len(used[1]) == 1 else ())
            )
            if len(used[0]) > 1 and len(used[0]) == len(used[1]):
                self.story.arcs.extend(zip(used[0], used[1], strict=True))

    def _operands(
        self, file: int, line: int, code: str, at: int, most: int
    ) -> tuple[list[list[tuple[int, int]]], int]:
        """Returns the stored or inline points each operand may be, and where the tail starts."""
        found: list[list[tuple[int, int]]] = []
        while len(found) < most:
            at += len(code[at:]) - len(code[at:].lstrip())
            keys, end = self._operand(file, line, code, at)
            rest = code[end:].lstrip()
            if rest[:1] in (":", "+", "-", "*", "/", "("):
                stop = re.search(r",|\bC_|\bWITH\b", code[end:], re.IGNORECASE)
                tail = end + stop.start() if stop else len(code)
                self._taint(line, code[at:tail])
                extra = [
                    (file, a)
                    for a in range(int(self.first[file][line]), int(self.first[file][line + 1]))
                    if at
                    <= int(self.scans[file].agg_open[a] - self.scans[file].line_start[line])
                    < tail
                ]
                keys, end = extra, tail
                for key in keys:
                    self.story.flags[key] = Reason.EXPRESSION
                self.story.notes.append(
                    f"{self.names[file]}:{line + 1}: the target is computed; it is not compensated."
                )
            found.append(keys)
            comma = code[end:].lstrip()
            if not comma.startswith(",") or len(found) == most:
                return found, end
            at = code.index(",", end) + 1
        return found, at

    def _operand(
        self, file: int, line: int, code: str, at: int
    ) -> tuple[list[tuple[int, int]], int]:
        scan = self.scans[file]
        if code[at : at + 1] == "{":
            for agg in range(int(self.first[file][line]), int(self.first[file][line + 1])):
                if int(scan.agg_open[agg] - scan.line_start[line]) == at:
                    if scan.agg_flag[agg] & NOT_CONSTANT:
                        self.story.flags[file, agg] = Reason.EXPRESSION
                    return [(file, agg)], int(scan.agg_close[agg] - scan.line_start[line]) + 1
            self._note(line, file, "the target is not a list of components; it is not compensated")
            return [], len(code)
        match = _REFERENCE.match(code, at)
        if not match:
            return [], at
        variable, index, path = (
            self.scope.name(match[1]),
            _clean(match[2]),
            _clean(match[3]).strip("."),
        )
        stored = self._current.get(variable, {})
        if index and not re.fullmatch(r"\d+(,\d+)*", index):
            self._searched += len(stored)
            if self._searched <= _MOST_SEARCHED:
                keys = [(d.file, d.agg) for (_, p), d in stored.items() if p == path]
            else:
                keys = []
                self.story.tainted.setdefault((variable, path), line)
        else:
            one = stored.get((index, path))
            keys = [] if one is None else [(one.file, one.agg)]
        if not keys and not variable.startswith("$") and variable not in self._absent:
            self._absent.add(variable)
            self._note(
                line,
                file,
                f"{match[0].strip()} is computed, or no file of this program gives it a value; "
                "it is not compensated (if it stands in a .dat, give that, too)",
            )
        return keys, match.end()

    def _note(self, line: int, file: int, text: str) -> None:
        self.story.notes.append(f"{self.names[file]}:{line + 1}: {text}.")


def _members(code: str, at: int, places: Iterable[int], outer: str) -> Iterator[str]:
    """Yields the member path of each aggregate of a structure: ``{fCnC {`` gives ``fcnc``.

    Args:
        code: A line.
        at: Where its value begins.
        places: Where the aggregates open, in order.
        outer: Path of the value.
    """
    stack: list[str] = []
    braces = _MEMBER.finditer(code, at)
    brace = next(braces, None)
    for here in places:
        while brace is not None and brace.end() <= here:
            if brace[3] == "{":
                stack.append(((brace[1] or "") + _clean(brace[2])).lower())
            elif stack:
                stack.pop()
            at, brace = brace.end(), next(braces, None)
        last = _LAST.search(code, at, here)
        names = [outer, *stack[1:], last[1].lower() + _clean(last[2]) if last else ""]
        yield ".".join(name for name in names if name)
