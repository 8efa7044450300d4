"""Reads the lines of a KRL file in program order: which point is moved to, and how.

Lines that are a motion to a plain aggregate never come here; the scanner has already sorted them.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.program.formats.camrob import CALL
from robotrue.program.formats.krl_flow import BASE, ON_ROBOT, TOOL
from robotrue.program.formats.krl_frames import DeferredFrame, Frames, read_fdat, with_settings
from robotrue.program.formats.krl_operands import (
    Called,
    Definition,
    KrlPoints,
    MotionStatement,
    members,
    without_blanks,
)
from robotrue.program.formats.krl_scan import (
    INLINE_ARC,
    INLINE_LIN,
    INLINE_PTP,
    INLINE_SPLINE,
    NOT_CONSTANT,
    STATEMENT,
    Scan,
)
from robotrue.program.formats.krl_stored_data import StoredData
from robotrue.program.formats.krl_values import KrlCall, VariableChange, split_calls
from robotrue.program.program import Motion, Reason

MOTION_OF: Final = {
    INLINE_PTP: Motion.PTP,
    INLINE_LIN: Motion.LIN,
    INLINE_SPLINE: Motion.SPLINE,
    INLINE_ARC: Motion.ARC_END,
}
_MOTION: Final = re.compile(r"\s*S?(PTP|LIN|CIRC|SPL)(_REL)?(?!\w)", re.IGNORECASE)
_WORD: Final = re.compile(r"\s*(\$?\w+)")
_DEFINE: Final = re.compile(
    r"\s*+(?:(?:GLOBAL|DECL|CONST)\s++)*(?:(\w++)\s++)?(\$?\w++)\s*+(?:\[([^\]]*+)\])?"
    r"((?:\s*+\.\s*+\w++)*+)\s*+=(?!=)\s*+",
    re.IGNORECASE,
)
_BAS: Final = re.compile(r"\s*BAS\s*\(\s*#(\w+)\s*(?:,\s*(.*\S)\s*)?\)", re.IGNORECASE)
_DECLARED: Final = re.compile(
    r"\s*+(?:(?:GLOBAL|DECL|CONST)\s++)*(?!FDAT|PDAT|LDAT)\w++\s++([^=]+)$", re.IGNORECASE
)
_COUNTED: Final = re.compile(r"\s*FOR\s+(\w+)\s*=", re.IGNORECASE)
_WITH: Final = re.compile(r"\$(?:BASE|TOOL|IPO_MODE)\s*=", re.IGNORECASE)
_CALL: Final = re.compile(r"\s*(\w+)\s*\(")
_CALLED: Final = re.compile(r"\b(\w++)\s*+\(")
_STARTED: Final = re.compile(r"\s*(?:GLOBAL\s+)?(INTERRUPT|TRIGGER)\b", re.IGNORECASE)
_HANDLER: Final = re.compile(r"\bDO\s+(\w+)\s*\(", re.IGNORECASE)
_FRAMES_STARTED: Final = re.compile(r"\bDO\s+\$(BASE|TOOL)\b", re.IGNORECASE)
_FRAMES_HANDED: Final = re.compile(r"(?:^|,)\s*\$(BASE|TOOL)\s*(?=,|$)", re.IGNORECASE)
_GLOBAL: Final = re.compile(
    r"\s*(?:DECL\s+GLOBAL|GLOBAL\s+DECL|GLOBAL)\s+(?!DEF|INTERRUPT|DECL)\w+\s+([^=]+)",
    re.IGNORECASE,
)
_GIVEN_NAME: Final = re.compile(r"\b(\w++)\s*+(?:\[[^\[\]]*+\])?+\s*+(?:,|$)")
_LABEL: Final = re.compile(r"\s*(\w+)\s*:\s*$")
_COMMENT: Final = re.compile(r'(?:[^;"]|"[^"]*"?)*')
_GOTO: Final = re.compile(r"\s*GOTO\s+(\w+)", re.IGNORECASE)
_STRING: Final = re.compile(r'"[^"]*"')
_POINT_TYPES: Final = ("e6pos", "pos", "frame", "e6axis", "axis")
_OTHER_TYPES: Final = ("fdat", "pdat", "ldat", "load", "int", "real", "bool", "char", "signal")
COLUMN: Final = {"base": BASE, "tool": TOOL}
_LOOP: Final = {"for": "endfor", "while": "endwhile", "loop": "endloop", "repeat": "until"}
_LOOP_END: Final = set(_LOOP.values())
_SILENT: Final = {"ext", "extfct", "import", "end", "endfct", "enddat", "struc", "enum"}


class KrlWalk(KrlPoints):
    """One reading of a main file and the data file next to it.

    Attributes:
        beside: CAMRob files there are.
        deferred: Frames whose value is known when everything has been read.
        derived: Points set from others: (line, variable, component, new value).
        main: The file whose statements are read, -1 if none is.
    """

    def __init__(self, scans: list[Scan], names: list[str], frames: Frames) -> None:
        super().__init__(scans, names, frames)
        self.beside: set[str] = set()
        self.deferred: list[DeferredFrame] = []
        self.derived: list[tuple[int, str, str, str]] = []
        self.main = -1
        self._storing = False
        self._stored, self._calls = StoredData(), list[int]()
        frames.may_differ = self._may_differ

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
                self.values.shared.update(self.scope.name(name) for name in names)
            if word == "defdat":
                self.story.has_def = True
            elif word not in _SILENT and "=" in code:
                self._assign(file, line, code)
        self._storing = False

    def outside_file(self, name: str, data: bytes) -> None:
        """Reads the variables of a data file of the controller, which is never written."""
        self.scope.enter(name)
        for text in data.decode("latin-1").splitlines():
            code = _COMMENT.match(text)
            match = _DEFINE.match(code[0]) if code else None
            if code is None or match is None or match[2].startswith("$") or match[4]:
                continue
            variable = match[2].lower()
            if (match[1] or "").lower() == "fdat":
                self.frames.fdat.setdefault(variable, read_fdat(code[0][match.end() :]))
            index = without_blanks(match[3])
            self.values.declare(variable, index, code[0][match.end() :].strip())
            self.values.shared.add(variable)

    def main_file(self, file: int) -> None:
        """Reads every statement in program order."""
        self.main = file
        self._state_computed(file)
        lines = np.flatnonzero(self.scans[file].line_kind == STATEMENT).tolist()
        self._stored.add((line, self._code(file, line)) for line in lines)
        for line in lines:
            self.scope.reach(line)
            self._statement(file, line, self._code(file, line))

    def _may_differ(self, side: str, number: str, line: int) -> bool:
        begin = self.values.begin_of(line)
        return self._stored.may_differ(side, number, line, begin, self._calls)

    def _state_computed(self, file: int) -> None:
        """Makes plain motions to aggregates with expressions statements, which are read as text."""
        scan = self.scans[file]
        computed = scan.agg_line[(scan.agg_flag & NOT_CONSTANT) > 0]
        if len(computed):
            kind = np.array(scan.line_kind)
            kind[computed] = STATEMENT
            self.scans[file] = replace(scan, line_kind=kind)

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
        if word == "while":
            self.flow.loop(2 * line)
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
            self.flow.save(2 * line)
            self._with(file, line, code)
        elif word == "endspline":
            self.flow.restore(2 * line)
        elif self._control(line, word, code):
            self._barrier(line)
            self.taint(line, code)
        elif _DEFINE.match(code):
            self._assign(file, line, code)
        elif word in ("decl", *_POINT_TYPES, *_OTHER_TYPES):
            declared = _DECLARED.match(code)
            if declared:
                names = _GIVEN_NAME.findall(declared[1].strip())
                self.values.declare_local(line, [name.lower() for name in names])
        elif word not in ("wait", "halt"):
            self._other(file, line, code)

    def _other(self, file: int, line: int, code: str) -> None:
        call, label = _CALL.match(code), _LABEL.match(code)
        if call and call[1].lower() == "cr_process_file":
            self._camrob(file, line)
        if label:
            self.flow.label(2 * line, label[1].lower())
        if call or label:
            self._barrier(line)
        self.taint(line, code)

    def _camrob(self, file: int, line: int) -> None:
        match = CALL.search(self.scans[file].code(line))
        if match and match[1].lower() in self.beside:
            first, last = (int(match[2]), int(match[3])) if match[2] else (1, -1)
            self.story.called_files.append(Called(line, match[1], first, last))
        else:
            name = match[1] if match else "a file named elsewhere"
            self.note(line, file, f"the targets are in {name}, which is not next to the program")

    def _note_calls(self, line: int, code: str) -> None:
        started = _STARTED.match(code)
        names = (_HANDLER if started else _CALLED).findall(code)
        routines = [self.scope.routine(name, line) for name in names]
        self.story.spelled.update(zip(routines, names, strict=True))
        if started:
            self.values.handlers.update(routines)
            for name in routines:
                self.flow.handler(name)
            if started[1].lower() == "trigger":
                self.flow.trigger(2 * line, self._routines_to_follow(routines))
            return
        if any(map(self.scope.has_routine, routines)):
            self._calls.append(line)
        followed = self._routines_to_follow(routines)
        node = self.flow.call(2 * line, followed) if followed else -1
        for called, arguments in split_calls(code):
            routine = self.scope.routine(called, line)
            if routine in followed:  # it may be handed over by reference
                self._lose_frames(line, _FRAMES_HANDED.findall(",".join(arguments)))
            self.values.calls.append(KrlCall(line, node, routine, arguments))

    def _lose_frames(self, line: int, sides: list[str]) -> None:
        """Enters that BASE or TOOL are unknown from here on: code that is not read may set them."""
        for side in sides:
            what, cure = "may be set by a routine or trigger here", "set it again after this line"
            self._put(line, side.lower(), self.frames.unknown(side.lower(), line, what, cure))

    def _routines_to_follow(self, routines: list[str]) -> list[str]:
        """Returns the routines that may change something: of the job, or not known."""
        known = self.scope.has_routine
        return [name for name in routines if known(name) or not self.flow.is_harmless(name)]

    def _define(self, line: int, code: str) -> None:
        if code.rstrip().endswith(":"):
            return  # ``def name():`` is Python's or URScript's
        self.story.has_def = True
        self._barrier(line)
        match = _CALLED.search(code)
        name = self.scope.routine(match[1], line) if match else ""
        self.flow.start(2 * line, name)
        inside = code[match.end() :].rpartition(")")[0] if match else ""
        self.values.begin_routine(line, name, inside)

    def _control(self, line: int, word: str, code: str) -> bool:
        """Draws branches, loops and jumps; returns whether the line is control flow."""
        flow, at = self.flow, 2 * line
        if word in ("if", "switch"):
            flow.branch(at, opens=word == "if")
        elif word in ("else", "case", "default"):
            flow.alternative(at, other=word != "case")
        elif word in ("endif", "endswitch"):
            flow.join(at)
        elif word == "while":
            flow.loop_condition(at)
        elif word in _LOOP:
            flow.loop(at)
        elif word in _LOOP_END:
            flow.close_loop(at)
        elif word == "exit":
            flow.exit_loop(at)
        elif word == "return":
            flow.leave(at)
        elif word == "goto":
            to = _GOTO.match(code)
            flow.jump(at, to[1].lower() if to else "")
        elif word not in ("interrupt", "trigger", "resume"):
            return False
        counted = _COUNTED.match(code) if word == "for" else None
        if counted:
            self.values.change(counted[1].lower(), VariableChange(line, "", "", None))
        if word in ("interrupt", "trigger"):
            self._lose_frames(line, _FRAMES_STARTED.findall(code))
        if word == "resume":
            self.flow.resume()
            self.values.resumes = True
        return True

    def _bas(self, line: int, code: str) -> None:
        match = _BAS.match(code)
        if not match:
            return
        what = match[1].lower()
        if what in ("tool", "base"):
            self._put(line, what, self._index_number(what, line, match[2] or ""))
        elif what == "ex_base":
            self._put(line, "base", self.frames.carried_number(line, match[2]))
        elif what in ("frames", "ptp_params", "cp_params"):
            self.flow.take_pending(2 * line)

    def _index_number(self, side: str, line: int, number: str) -> int:
        """Returns the index of a numbered frame; a computed number is resolved later."""
        number = number.strip()
        if number.isdecimal() or not number:
            return self.frames.number(side, line, number or None)
        return self._defer(side, line, number, numbered=True)

    def _defer(self, side: str, line: int, text: str, *, numbered: bool = False) -> int:
        """Returns the index of a frame that is resolved after the whole job is read."""
        index = self.frames.reserve(side)
        stored = self.frames.stored_numbers()
        self.deferred.append(DeferredFrame(side, index, line, text, numbered, stored))
        return index

    def _expression(self, side: str, line: int, text: str) -> int:
        """Returns the index of the right side of ``$BASE=`` or ``$TOOL=``, not an aggregate."""
        index = self.frames.find_expression(side, line, text)
        return self._defer(side, line, text) if index is None else index

    def _assign(self, file: int, line: int, code: str) -> None:
        match = _DEFINE.match(code)
        if not match:
            return
        kind, variable = (match[1] or "").lower(), self.scope.name(match[2])
        index, path, rest = (
            without_blanks(match[3]),
            without_blanks(match[4]).strip("."),
            code[match.end() :],
        )
        if not variable.startswith("$"):
            self._keep(line, match[2].lower(), index, path, rest)
        if variable in ("$base", "$tool"):
            self._set_frame(file, line, variable[1:], path, rest)
        elif variable == "$ipo_mode":
            self._set(line, ON_ROBOT, self.frames.holder(rest))
        elif variable in ("base_data", "tool_data"):
            side = variable[:4]
            if index.isdecimal() and not path:
                new = self._resolve(file, line, side, rest)
                if self.flow.in_branch and new != self.frames.number(side, line, index):
                    what, cure = f"data {index} is set on one branch", "set it on every path"
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
            self.taint(line, rest)
        else:
            if not self._storing:
                variable = self.values.key(match[2].lower(), line)
            self._point(file, line, code, match.end(), variable, index, path)

    def _keep(self, line: int, name: str, index: str, path: str, rest: str) -> None:
        """Remembers what a statement or a data list gives a variable."""
        if self._storing:
            self.values.declare(name, index, rest.strip())
        else:
            self.values.change(name, VariableChange(line, index, path, rest.strip()))

    def _point(
        self, file: int, line: int, code: str, at: int, variable: str, index: str, path: str
    ) -> None:
        scan, first = self.scans[file], self.first[file]
        offset = int(scan.line_start[line])
        aggs = range(int(first[line]), int(first[line + 1]))
        opened = [int(scan.agg_open[agg]) - offset for agg in aggs]
        for agg, here, member in zip(aggs, opened, members(code, at, opened, path), strict=True):
            inner = path if here == at else member
            definition = Definition(file, agg, variable, index, inner)
            self.story.definitions.append(definition)
            self.current[variable][index, inner] = definition
            if scan.agg_flag[agg] & NOT_CONSTANT:
                self.story.flags[file, agg] = Reason.EXPRESSION
        if aggs and self.values.leaves_routine(variable):
            self.story.tainted.setdefault((variable, path), line)
        rest = code[at:]
        if aggs:
            tail = code[int(scan.agg_close[aggs[-1]]) - offset + 1 :].strip()
            if rest.startswith("{") and (not tail or tail.startswith(("}", ","))):
                return
            rest = tail
        if self._storing or aggs:
            self.story.tainted.setdefault((variable, path), line)
            self.taint(self.scope.store if self._storing else line, rest)
        else:
            self.derived.append((line, variable, path, rest))

    def _resolve(self, file: int, line: int, side: str, rest: str) -> int:
        first = self.first[file]
        aggs = range(int(first[line]), int(first[line + 1]))
        if rest.startswith("{") and len(aggs) >= 1:
            scan = self.scans[file]
            agg = next(a for a in aggs if scan.agg_open[a] >= scan.line_start[line])
            tail = rest[rest.find("}") + 1 :].strip()
            if not tail:
                return self.frames.aggregate(side, line, self.values_of(file, agg))
        return self._expression(side, line, rest)

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
            self.flow.pend(2 * line + 1, *frames.inline_frames(line, inline))

    def _with(self, file: int, line: int, code: str) -> None:
        """Applies the settings of a WITH clause to its motion or spline block."""
        scan, aggs = self.scans[file], range(*self.first[file][line : line + 2].tolist())
        opened = {int(scan.agg_open[a]) - int(scan.line_start[line]): a for a in aggs}
        for side, text, place in with_settings(code):
            if side == "ipo_mode":
                self._set(line, ON_ROBOT, self.frames.holder(text))
            elif text.startswith("{"):
                here = opened.get(place)
                values = np.full(6, np.nan) if here is None else self.values_of(file, here)
                self._put(line, side, self.frames.aggregate(side, line, values))
            else:
                self._put(line, side, self._expression(side, line, text))

    def _put(self, line: int, side: str, index: int) -> None:
        self._set(line, COLUMN[side], index)

    def _set(self, line: int, column: int, value: int) -> None:
        if not self._storing:
            self.flow.put(2 * line + 1, column, value)

    def _barrier(self, line: int) -> None:
        self.story.sequence.append((line, -1, False))

    def _motion(self, file: int, line: int, code: str, match: re.Match[str]) -> None:
        kind, relative = match[1].upper(), match[2] is not None
        operands, end = self.operands(file, line, code, match.end(), 2 if kind == "CIRC" else 1)
        if "$" in code[end:] and _WITH.search(code, end):
            self.flow.save(2 * line)
            self._with(file, line, " " * end + code[end:])
            self.flow.restore(2 * line + 2)
        self.motions.append(MotionStatement(file, line, kind, relative, operands))
