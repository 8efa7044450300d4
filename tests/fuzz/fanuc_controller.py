"""Executes the Fanuc LS of ``fanuc_flow_programs``, written without the product.

What a program cannot know (inputs, where the robot is, the frames in force before the first run) is
drawn from a seed. Registers and frames are those of the controller: all programs share them, and
they keep their values from run to run; positions belong to their program. A position in other
frames than those in force stops the program, as INTP-252 does.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from controllers import BINARY, COMPARE, MOST_STEPS, Ended, Move

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM

RECORD = re.compile(r"P\[(\d+)[^\]]*\]\{(.*?)\n?\};", re.DOTALL)
FRAMES = re.compile(r"UF *: *(\w+), *UT *: *(\w+)")
VALUE = re.compile(r"\b(J\d|[XYZWPR])\s*=\s*(-?[\d.]+)")
MOVE = re.compile(r"([JLSCA]) +(PR?\[.*?\]+)(?: +(PR?\[.*?\]+))? +\d+(?:mm/sec|%) +\w+ *(.*)$")
UNKNOWN = None


@dataclass
class Point:
    """A position: six numbers in mm and deg, axis values or not, and its frames."""

    values: np.ndarray
    axes: bool
    frame: str
    tool: str


@dataclass
class Routine:
    """The statements and positions of a program."""

    lines: list[str] = field(default_factory=list)
    points: dict[int, Point] = field(default_factory=dict)


def matrix(values: np.ndarray) -> np.ndarray:
    """The pose (4, 4), m, of X Y Z in mm and W P R in deg."""
    T = np.eye(4)
    T[:3, :3] = matrix_from_abc(values[[5, 4, 3]] * DEG)
    T[:3, 3] = values[:3] * MM
    return T


class FanucController:
    """Registers, frames in force and motions of one robot.

    Args:
        files: Texts by name.
        frames: Numbered frames, by ``base`` and ``tool``.
        rng: Decides what the program cannot know.
    """

    def __init__(
        self, files: Mapping[str, str], frames: Mapping[str, Mapping[str, np.ndarray]],
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self.rng, self.moves = rng, list[Move]()
        self.frames = {
            side: {0: np.eye(4)} | {int(k): T for k, T in table.items() if k.isdigit()}
            for side, table in frames.items()
        }
        before = np.random.default_rng(3)
        self.numbers = {k: float(1 + k % 2) for k in range(1, 10)}
        self.places = {k: before.uniform(-70.0, 70.0, 6) for k in range(1, 6)}
        self.places |= {k: np.array([*before.uniform(-50.0, 50.0, 3), 0, 0, 0]) for k in (10, 11)}
        self.base, self.tool = (int(each) for each in rng.integers(1, 3, 2))
        self.routines = dict(self._load(text) for text in files.values())

    def _load(self, text: str) -> tuple[str, Routine]:
        head, _, rest = text.partition("/MN")
        body, _, positions = rest.partition("/POS")
        out = Routine()
        for statement in body.split(";"):
            line = re.sub(r"\s*(?:^|\n)\s*\d*:", " ", statement)
            line = re.sub(r"(\[\w+):\w*", r"\1", line).strip()
            if line:
                out.lines.append(line)
        for number, record in RECORD.findall(positions):
            found = VALUE.findall(record)
            frame = FRAMES.search(record)
            assert frame, record
            values = np.array([float(value) for _, value in found])
            out.points[int(number)] = Point(values, found[0][0] == "J1", frame[1], frame[2])
        return head.split()[1].lower(), out

    def run(self) -> bool:
        """Runs the program PART from its start; returns whether it came to its end."""
        self.steps = 0
        try:
            self._call("part", [])
        except Ended:
            return False
        return True

    # Values

    def value(self, text: str, routine: Routine, given: list[float]) -> Any:
        """The value of an expression: a number, or six numbers."""
        text = text.replace("<>", "!=").replace("DIV", "//").replace("MOD", "%")
        text = re.sub(r"(?<![<>!=])=", "==", text)
        return self._compute(ast.parse(text.strip(), mode="eval").body, routine, given)

    def _compute(self, node: ast.expr, routine: Routine, given: list[float]) -> Any:
        if isinstance(node, ast.Constant):
            assert isinstance(node.value, (int, float))
            return float(node.value)
        if isinstance(node, ast.UnaryOp):
            return -self._compute(node.operand, routine, given)
        if isinstance(node, ast.BinOp):
            sides = (self._compute(x, routine, given) for x in (node.left, node.right))
            return BINARY[type(node.op)](*sides)
        if isinstance(node, ast.Compare):
            sides = (self._compute(x, routine, given) for x in (node.left, node.comparators[0]))
            return COMPARE[type(node.ops[0])](*sides)
        if isinstance(node, ast.Name):
            if node.id == "ON":
                return 1.0
            assert node.id == "LPOS"
            return self.rng.uniform(-60.0, 60.0, 6)
        assert isinstance(node, ast.Subscript)
        assert isinstance(node.value, ast.Name)
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        index = [int(self._compute(part, routine, given)) for part in parts]
        name = node.value.id
        if name == "DI":
            return float(self.rng.random() < 0.5)
        if name == "AI":
            return float(self.rng.uniform(-50.0, 50.0))
        if name == "AR":
            if not 0 < index[0] <= len(given):
                raise Ended
            return given[index[0] - 1]
        if name == "P":
            if index[0] not in routine.points:
                raise Ended
            return np.array(routine.points[index[0]].values)
        table: dict[int, Any] = {"R": self.numbers, "PR": self.places}[name]
        if index[0] not in table:
            raise Ended
        held = table[index[0]]
        return held[index[1] - 1] if len(index) > 1 else held if name == "R" else np.array(held)

    # Statements

    def _call(self, name: str, given: list[float]) -> None:
        routine, lines = self.routines[name], self.routines[name].lines
        self.condition: tuple[int, np.ndarray] | None = None
        loops: dict[int, float] = {}
        at = 0
        while at < len(lines):
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            line = lines[at]
            if line == "END":
                break
            if line.startswith("SELECT "):
                at = self._select(at, routine, given)
            elif line.startswith("IF ") and line.endswith("THEN"):
                holds = self.value(line[3:-4], routine, given)
                at = at + 1 if holds else self._behind(lines, at, ("ELSE", "ENDIF"))
            elif line.startswith("IF "):
                condition, _, action = line[3:].partition(",")
                holds = self.value(condition, routine, given)
                at = self._go(action, at, routine, given) if holds else at + 1
            elif line == "ELSE":
                at = self._behind(lines, at, ("ENDIF",))
            elif line.startswith("FOR "):
                loops[at] = self._begin_loop(line, routine, given)
                at += 1
            elif line == "ENDFOR":
                at = self._end_loop(lines, at, loops)
            else:
                at = self._go(line, at, routine, given)

    def _behind(self, lines: list[str], at: int, ends: tuple[str, ...]) -> int:
        depth = 0
        for place in range(at + 1, len(lines)):
            line = lines[place]
            if depth == 0 and line in ends:
                return place + 1
            depth += line.startswith("IF ") and line.endswith("THEN")
            depth -= line == "ENDIF"
        raise AssertionError(lines[at])

    def _begin_loop(self, line: str, routine: Routine, given: list[float]) -> float:
        match = re.match(r"FOR R\[(\d+)\]=(.*) TO (.*)$", line)
        assert match, line
        self.numbers[int(match[1])] = self.value(match[2], routine, given)
        return float(self.value(match[3], routine, given))

    def _end_loop(self, lines: list[str], at: int, loops: Mapping[int, float]) -> int:
        depth, start = 0, at
        while depth or not lines[start].startswith("FOR ") or start == at:
            start -= 1
            depth += (lines[start] == "ENDFOR") - (lines[start].startswith("FOR ") and depth > 0)
        number = int(lines[start][6 : lines[start].index("]")])
        if self.numbers[number] < loops[start]:
            self.numbers[number] += 1.0
            return start + 1
        return at + 1

    def _select(self, at: int, routine: Routine, given: list[float]) -> int:
        """Alternatives follow each other: ``SELECT R[1]=1,..``, ``=2,..``, ``ELSE,..``."""
        lines = routine.lines
        name, _, rest = lines[at][7:].partition("=")
        held, cases, after = self.value(name, routine, given), ["=" + rest], at + 1
        while lines[after].startswith(("=", "ELSE,")):
            cases.append(lines[after])
            after += 1
        for case in cases:
            told, _, action = case.lstrip("=").partition(",")
            if told == "ELSE" or held == self.value(told, routine, given):
                return self._go(action, after - 1, routine, given)
        return after

    def _go(self, line: str, at: int, routine: Routine, given: list[float]) -> int:
        """Executes a statement; returns the place of the next one."""
        if line.startswith("JMP "):
            label = f"LBL[{int(self.value(line[8:-1], routine, given))}]"
            if label not in routine.lines:
                raise Ended
            return routine.lines.index(label) + 1
        if line.startswith("CALL "):
            match = re.match(r"CALL (\w+)(?:\((.*)\))?$", line)
            assert match, line
            texts = match[2].split(",") if match[2] else []
            held = self.condition
            self._call(match[1].lower(), [self.value(each, routine, given) for each in texts])
            self.condition = held
        elif match := MOVE.match(line):
            targets = [each for each in match.groups()[1:3] if each]
            for number, text in enumerate(targets, 1):
                via = number < len(targets)
                self._move(text, match[4], routine, given, via=via)
        elif line.startswith("OFFSET CONDITION"):
            number = int(line[line.index("[") + 1 : -1])
            self.condition = number, np.array(self.places[number])
        elif not line.startswith(("LBL[", "ENDIF")):
            self._assign(line, routine, given)
        return at + 1

    def _assign(self, line: str, routine: Routine, given: list[float]) -> None:
        left, _, right = line.partition("=")
        value = self.value(right, routine, given)
        if left in ("UFRAME_NUM", "UTOOL_NUM"):
            setattr(self, "base" if left[1] == "F" else "tool", int(value))
            return
        match = re.match(r"(\w+)\[(.*)\]$", left)
        assert match, line
        parts = [int(self.value(each, routine, given)) for each in match[2].split(",")]
        if match[1] in ("UFRAME", "UTOOL"):
            self.frames["base" if match[1] == "UFRAME" else "tool"][parts[0]] = matrix(value)
        elif match[1] == "R":
            self.numbers[parts[0]] = value
        elif match[1] == "P":
            routine.points[parts[0]].values = np.array(value)
        elif len(parts) > 1:
            if parts[0] not in self.places:
                raise Ended
            self.places[parts[0]][parts[1] - 1] = value
        else:
            self.places[parts[0]] = np.array(value)

    def _move(
        self, text: str, tail: str, routine: Routine, given: list[float], *, via: bool
    ) -> None:
        values = self.value(text, routine, given)
        if text.startswith("P["):
            inner = re.match(r"P\[(.*)\]$", text)
            assert inner
            point = routine.points[int(self.value(inner[1], routine, given))]
            for told, held in ((point.frame, self.base), (point.tool, self.tool)):
                if told not in ("F", str(held)):
                    raise Ended
            if point.axes:
                tool = self.frames["tool"][self.tool]
                self.moves.append(Move(np.eye(4), tool, point.values * DEG, via))
                return
        base, tool = self.frames["base"][self.base], self.frames["tool"][self.tool]
        target: np.ndarray | None = matrix(values)
        follows = "INC" in tail
        if follows:
            target = self._step(values, base, tool)
        offset = re.search(r"(Tool_)?Offset(?:,PR\[(\d+)\])?", tail)
        if offset and target is not None:
            target = self._shift(target, offset)
        step = values if follows else np.zeros(0)
        self.moves.append(Move(base, tool, target, via, follows, step))

    def _step(self, values: np.ndarray, base: np.ndarray, tool: np.ndarray) -> np.ndarray | None:
        """The last target, in its own frames, and a step along the axes of the user frame."""
        last = self.moves[-1] if self.moves else None
        if last is None or last.target is None or last.target.ndim == 1 or values[3:].any():
            return None
        T = np.linalg.inv(base) @ last.base @ last.target @ np.linalg.inv(last.tool) @ tool
        T[:3, 3] += values[:3] * MM
        return T

    def _shift(self, target: np.ndarray, offset: re.Match[str]) -> np.ndarray | None:
        """None for what the manuals do not describe: turned offsets, a register that changed."""
        if offset[2]:
            shift = self.places[int(offset[2])]
        elif self.condition is None or offset[1]:
            return None
        else:
            number, shift = self.condition
            if not np.array_equal(shift, self.places[number]):
                return None
        if shift[3:].any():
            return None
        step = np.eye(4)
        step[:3, 3] = shift[:3] * MM
        if offset[1]:
            return np.asarray(target @ step)
        return np.asarray(step @ target)
