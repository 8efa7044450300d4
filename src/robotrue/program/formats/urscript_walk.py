"""Reads the statements of a UR script in order: points, motions, the tool, frames of poses."""

from __future__ import annotations

import re
from array import array
from collections.abc import Container
from dataclasses import dataclass, field
from typing import Final

from robotrue.program.formats.control_flow import ControlFlow
from robotrue.program.formats.number_table import NumberTable
from robotrue.program.formats.stored_points import ParsedPoints, Variable, Variables
from robotrue.program.formats.urscript_scan import AXES, POSE, Routine, arguments
from robotrue.program.program import Motion, Reason

POINT: Final = 0
JOINTS: Final = 1
NOTHING: Final = 2
FRAME: Final = 3
"""Kinds of points: pose, axes, a motion to no literal, a pose that is a tool or a frame."""
LITERALS: Final = ((POSE, POINT, "pose"), (AXES, JOINTS, "joints"))
UNKNOWN: Final = -1
BASE: Final = -2
"""Frames that are no point: computed, and the robot's base."""
TOOL: Final = "tool"
FOREIGN: Final = "routine in no script"
"""What ran since the tool was set: number of the call, from 1."""
_MOVES: Final = {
    "movel": (Motion.LIN,),
    "movep": (Motion.LIN,),
    "movej": (Motion.PTP,),
    "movec": (Motion.ARC_VIA, Motion.ARC_END),
}
_ASSIGNED: Final = re.compile(
    rb"\s*+(?:(global|local)\s++)?([A-Za-z_]\w*+)\s*+(\[[^\]]*+\])?+\s*+=(?!=)\s*+"
)
_CALL: Final = re.compile(rb"\s*([A-Za-z_]\w*)\s*\(")
_CALLED: Final = re.compile(rb"(?<!\w)\d*+([A-Za-z_]\w*+)\s*+\(")
_ASKED: Final = re.compile(rb"(?<![\w.])([A-Za-z_]\w*+)\s*+\(")
_BUILT_IN: Final = re.compile(
    r"(?:get|is|str|to|pose|modbus|rtde|socket|read|write|request|path_offset|conveyor|encoder|zero|"
    r"screw_driving|interpolate|wrench|point|undo|watchdog|track_conveyor|force_mode|freedrive_mode|"
    r"end_force|end_freedrive|end_teach|end_screw|teach_mode|bin|binary|integer|list|struct)(?:_\w+)?|"
    r"(?:opti)?move[a-z]|servo[a-z]|speed[a-z]|stop[jl]|stop_conveyor_tracking|(?:enter|exit)_critical|"
    r"set_(?:analog|base_acc|configurable|conveyor|digital|euromap|flag|gp|gravity|input_actions|"
    r"payload|runstate|safety_mode|standard|target_payload|tool_(?:analog|comm|digital|output|"
    r"voltage)|watchdog)\w*|tool_contact"
)
"""Functions of the controller that do not set the tool."""
_OTHERS: Final = frozenset(
    """while if elif and or not xor return acos asin atan atan2 ceil floor cos sin tan d2r r2d exp
    log pow sqrt norm random abs min max length inv size make_list transpose sleep sync popup
    textmsg powerdown assert position_deviation_warning rpc_factory reset_revolution_counter
    unlock_protective_stop force eval debug run thread join kill in_deadband sign
    protective_stop high_holding_torque_enable high_holding_torque_disable""".split()
)
_KEYWORD: Final = re.compile(rb"\s*(while|if|elif|else|return|break|end|run|halt)\b")
_NAME: Final = re.compile(rb"[A-Za-z_]\w*+$")
_WORDS: Final = re.compile(rb"(?<![\w.])[A-Za-z_]\w*+")
_NAMED: Final = re.compile(rb"(?:pose|q|pose_via|pose_to)\s*=\s*")
_FRAMED: Final = re.compile(rb"pose_trans\s*\(")
_INLINE: Final = re.compile(
    rb"\s*+(move[lpj])\s*+\((?:\s*+pose_trans\s*+\(\s*+([A-Za-z_]\w*+|" + POSE.pattern
    + rb")\s*+,\s*+)?+(" + POSE.pattern + rb")(?(2)\s*+\))\s*+(?:,[^()]*+)?+\)\s*+"
)  # fmt: skip
"""A whole motion to a literal, as a post writes it: word, frame, literal."""
_SOLVED: Final = re.compile(rb"get_inverse_kin\s*\(")
_OWN_TOOL: Final = re.compile(rb"tcp\w*\s*=")
_SOLVED_WITH_TOOL: Final = 4
"""Arguments of get_inverse_kin that leave the tool what it is; a fifth names another."""
_NESTED: Final = 20
"""Calls inside each other that are followed."""
_ADDED: Final = re.compile(rb"pose_add\s*\(")
_MOTION: Final = re.compile(
    rb"(?<!\w)((?:optimove|move|servo|speed|jog)[a-z]?(?:_\w+)?|tool_contact_move)\s*\("
)
_MAYBE: Final = re.compile(rb"\b(?:and|or)\b")
"""What may keep a function behind it from being called."""
_CARRYING: Final = b"track_conveyor_"
_CARRIED: Final = re.compile(rb"(?<!\w)" + _CARRYING + rb"\w+\s*\(")


@dataclass(slots=True)
class ParsedScript(ParsedPoints):
    """What the walk collects; the setting of a use is the frame's number in ``frames``.

    Attributes:
        frames: Points that are frames, ``BASE`` or ``UNKNOWN``.
        tools: Points or ``UNKNOWN``, by the version set; the first is the one at the start.
        asked: First byte that names each frame and tool, for sentences.
        outside: Name and first byte of the calls of routines that are neither here nor the
            controller's own.
    """

    frames: dict[int, int] = field(default_factory=lambda: {BASE: 0})
    tools: list[int] = field(default_factory=lambda: [BASE])
    asked: dict[tuple[str, int], int] = field(default_factory=dict)
    outside: list[tuple[str, int]] = field(default_factory=list)


class ScriptWalk:
    """One reading of a script.

    Args:
        code: Without comments.
        routines: It consists of.
        harmless: Routines in no script that leave the tool alone, in lower case.
    """

    def __init__(self, code: bytes, routines: list[Routine], harmless: Container[str] = ()) -> None:
        self._harmless = harmless
        self.code, self.course = code, ControlFlow()
        self.table = NumberTable(code, (tuple(range(6)), tuple(range(6))), b"#")
        self.story, self.variables = ParsedScript(), Variables()
        self._at, self._scope, self._routines = 0, "", routines
        self._shares = False
        self._own = {routine.name for routine in routines if routine.name}
        self._threads = {routine.name for routine in routines if routine.parallel}
        self._blocks: list[str] = []
        self._literal_frames: dict[bytes, int] = {}
        self._given = 0  # literals given to variables
        self._named_frame: tuple[object, int] = None, UNKNOWN  # of the state it is for
        self._tools: dict[int, int] = {}
        self.moves = 0

    def all(self) -> None:
        """Reads every routine, the statements outside of all first."""
        for routine in self._routines:
            self._at += 1
            self._scope, self._blocks, self._shares = routine.name, [], routine.around
            self.course.start(self._at, routine.name, handler=routine.parallel)
            for name in routine.parameters:
                self.variables.declare(self._scope, name, "parameter").outside = True
            count, statements = 0, routine.statements
            while count < len(statements):
                self._at += 1
                inline = _INLINE.fullmatch(self.code, *statements[count])
                if inline:
                    count = self._inline(inline, statements, count)
                else:
                    self._statement(*statements[count])
                    count += 1
        carried = _CARRIED.search(self.code) if _CARRYING in self.code else None
        if carried:
            what = "every target of this script may move along with a conveyor (track_conveyor)"
            self.story.notes.append((carried.start(), what))
            for point in range(len(self.story.offset)):
                self.story.flags.setdefault(point, Reason.EXPRESSION)

    def _statement(self, start: int, end: int) -> None:
        call = _CALL.match(self.code, start, end)
        word = call[1].decode() if call else ""
        if call and word in _MOVES:
            close = min(self._find_close(call.end(), end) + 1, end)
            self._move(word, call.end(), close)
            if close < end:
                self._other(close, end)
        elif call and word == "set_tcp":
            self._tool(call.end(), self._find_close(call.end(), end))
        elif not self._control(start, end) and not self._assign(start, end):
            self._other(start, end)

    def _control(self, start: int, end: int) -> bool:
        match = _KEYWORD.match(self.code, start, end)
        if match is None:
            return False
        word = match[1].decode()
        course, at = self.course, self._at
        if word == "while":
            course.loop(at)
        elif word == "if":
            course.branch(at, opens=True)
        elif word in ("elif", "else"):
            course.alternative(at, other=word == "else")
        elif word == "break":
            course.exit_loop(at)
        elif word in ("return", "halt"):
            course.leave(at)
        elif word == "end":
            block = self._blocks.pop() if self._blocks else ""
            (course.close_loop if block == "while" else course.join)(at)
        if word in ("while", "if"):
            self._blocks.append(word)
        if self._other(match.end(), end) and word in ("while", "if", "elif"):
            (course.loop_condition if word == "while" else course.condition)(self._at)
        return True

    def _other(self, start: int, end: int) -> bool:
        """Enters any other statement: its variables are uncertain now, own routines are called.

        Returns:
            Whether it calls routines, of this script or of none.
        """
        self._mention(start, end)
        called = [name.decode() for name in _CALLED.findall(self.code, start, end)]
        own = [name for name in called if name in self._own - self._threads]
        calls = self._outside(start, end) or bool(own)
        certain = not _MAYBE.search(self.code, start, end) if own else True
        for name in own:
            self._at += 1
            (self.course.call if certain else self.course.call_one)(self._at, [name])
        motion = _MOTION.search(self.code, start, end)
        word = motion[1].decode() if motion else ""
        if motion and word not in self._own:
            where = " after other words" if word in _MOVES else ""
            self.story.notes.append((motion.start(), f"{word} is not followed{where}"))
            for match in POSE.finditer(self.code, motion.start(), end):
                point = self.story.add(match.start(), self.table.add(*match.span(), POINT), POINT)
                self.story.flags[point] = Reason.EXPRESSION
        return calls

    def _outside(self, start: int, end: int) -> bool:
        """Notes calls of routines that are in no given script, if any: they may set the tool."""
        before = len(self.story.outside)
        for match in _ASKED.finditer(self.code, start, end):
            name = match[1].decode()
            if name in self._own or name in _OTHERS or _BUILT_IN.fullmatch(name):
                if name != "set_tcp":
                    continue
            elif name.lower() in self._harmless:
                continue
            self.story.outside.append((name, match.start()))
            self._at += 1
            self.course.set(self._at, FOREIGN, len(self.story.outside))
        return len(self.story.outside) > before

    def _mention(self, start: int, end: int) -> None:
        for match in _WORDS.finditer(self.code, start, end):
            variable = self.variables.find(self._scope, match[0].decode())
            if variable is not None:
                variable.computed = True

    def _assign(self, start: int, end: int) -> bool:
        match = _ASSIGNED.match(self.code, start, end)
        if match is None:
            return False
        name, at = match[2].decode(), match.end()
        variable = self.variables.find(self._scope, name)
        for pattern, kind, what in LITERALS:
            literal = None if match[3] else pattern.match(self.code, at, end)
            if literal and not self.code[literal.end() : end].strip():
                scope = self._scope if match[1] == b"local" and not self._shares else ""
                variable = variable or self.variables.declare(scope, name, what)
                if variable.kind != what:
                    variable.computed = True
                point = self.story.add(literal.start(), self.table.add(*literal.span(), kind), kind)
                variable.give("", point, self.course.barriers)
                self._given += 1
                return True
        if variable is None and not match[3]:
            variable = self.variables.declare("", name, "value")
        if variable is not None:
            variable.computed = True
        self._other(at, end)
        return True

    def _find_close(self, start: int, end: int) -> int:
        """Returns where the bracket closes that opened before ``start``."""
        depth = 1
        for match in re.finditer(rb"[()]", self.code[start:end]):
            depth += 1 if match[0] == b"(" else -1
            if depth == 0:
                return start + match.start()
        return end

    def _tool(self, start: int, end: int) -> None:
        first = arguments(self.code, start, end)[0]
        point, tools = self._frame(*first), self.story.tools
        version = self._tools.setdefault(point, len(tools)) if point >= 0 else len(tools)
        if version == len(tools):
            tools.append(point)
            self.story.asked[TOOL, version] = start
        self.course.set(self._at, TOOL, version)
        self.course.set(self._at, FOREIGN, 0)

    def _frame(self, start: int, end: int) -> int:
        """Returns the point that a frame or tool argument means, or ``UNKNOWN``."""
        text = self.code[start:end]
        known = self._literal_frames.get(text)
        if known is not None:
            return known
        state = text, self._scope, self.course.barriers, self._given
        if state == self._named_frame[0]:
            return self._named_frame[1]
        match = POSE.match(self.code, start, end)
        if match and match.end() == end:
            point = self.story.add(start, self.table.add(*match.span(), POINT), FRAME)
            self._literal_frames[text] = point
            return point
        variable = self._variable(text)
        if variable is not None and variable.kind == "pose":
            points = self.variables.points_at(variable, "", self.course.barriers)
            if points:
                self.story.flags[points[0]] = Reason.EXPRESSION
                self._named_frame = state, points[0]
                return points[0]
        self._mention(start, end)
        return UNKNOWN

    def _variable(self, text: bytes) -> Variable | None:
        return (
            self.variables.find(self._scope, text.decode("latin-1")) if _NAME.match(text) else None
        )

    def _inline(self, match: re.Match[bytes], statements: list[tuple[int, int]], first: int) -> int:
        """Enters motions that are alike but for their literal; returns the statement after them."""
        code, key, at = self.code, match.group(1, 2), first
        ahead: re.Match[bytes] | None = match
        edges = array("q")
        while ahead and ahead.group(1, 2) == key:
            edges.extend(ahead.span(3))
            at += 1
            ahead = _INLINE.fullmatch(code, *statements[at]) if at < len(statements) else None
        points = self.story.extend(edges[::2], self.table.extend(edges, POINT), POINT)
        frame = BASE if key[1] is None else self._frame(*match.span(2))
        number = self._number_frame(frame, statements[first][0])
        (motion,) = _MOVES[key[0].decode()]
        self.story.uses.extend(points, range(self._at, self._at + len(points)), motion, number)
        self._at += len(points) - 1
        self.moves += len(points)
        return at

    def _move(self, word: str, start: int, end: int) -> None:
        self.moves += 1
        targets = _MOVES[word]
        close = end - 1 if self.code[end - 1 : end] == b")" else self._find_close(start, end)
        places = arguments(self.code, start, close, len(targets))
        found = [self._operand(*place) for place in places]
        while len(found) < len(targets):
            found.append(
                (self._lose_point(start, Reason.INCOMPLETE, f"{word} has no target"), BASE)
            )
        for (point, frame), motion in zip(found, targets, strict=True):
            self._use(point, frame, motion, start)
        if len(found) == 2:
            self.story.arcs.append((found[0][0], found[1][0]))

    def _use(self, point: int, frame: int, motion: Motion, place: int) -> None:
        """Notes a motion to a point in a frame."""
        self.story.uses.add(point, self._at, motion, self._number_frame(frame, place))

    def _number_frame(self, frame: int, place: int) -> int:
        number = self.story.frames.setdefault(frame, len(self.story.frames))
        self.story.asked.setdefault(("base", number), place)
        return number

    def _operand(self, start: int, end: int, depth: int = 0) -> tuple[int, int]:
        """Returns the point of an argument and its frame."""
        named = _NAMED.match(self.code, start, end)
        start = named.end() if named else start
        for pattern, kind, _ in LITERALS:
            match = pattern.match(self.code, start, end)
            if match and match.end() == end:
                return self.story.add(start, self.table.add(*match.span(), kind), kind), BASE
        text = self.code[start:end]
        variable = self._variable(text)
        if variable is not None:
            points = self.variables.points_at(variable, "", self.course.barriers)
            if points:
                return points[0], BASE
        framed, solved = (each.match(self.code, start, end) for each in (_FRAMED, _SOLVED))
        call = framed or solved if depth < _NESTED else None
        if call and self._find_close(call.end(), end) == end - 1:
            inside = arguments(self.code, call.end(), end - 1)
            if (
                solved
                and not any(_OWN_TOOL.match(self.code, *each) for each in inside)
                and (len(inside) <= _SOLVED_WITH_TOOL)
            ):
                for place in inside[1:]:
                    self._mention_seed(*place)
                return self._operand(*inside[0], depth + 1)
            if framed and len(inside) == 2:
                point, inner = self._operand(*inside[1], depth + 1)
                frame = self._frame(*inside[0])
                return point, frame if inner == BASE else UNKNOWN
        self._mention(start, end)
        self._outside(start, end)
        shown = text[:40].decode("latin-1")
        if _ADDED.match(self.code, start, end):
            what = f"the target {shown!r} starts from another pose"
            return self._lose_point(start, Reason.RELATIVE, what), BASE
        what = f"the target {shown!r} is computed, a parameter, or given nowhere"
        return self._lose_point(start, Reason.EXPRESSION, what), BASE

    def _mention_seed(self, start: int, end: int) -> None:
        """Joints near which get_inverse_kin looks may be a variable: it stays what it is."""
        text = self.code[start:end].partition(b"=")[2].strip() or self.code[start:end]
        if self._variable(text) is None:
            self._mention(start, end)

    def _lose_point(self, offset: int, reason: Reason, what: str) -> int:
        point = self.story.add(offset, -1, NOTHING)
        self.story.flags[point] = reason
        self.story.notes.append((offset, what))
        return point
