"""Executes the UR script of ``urscript_flow_programs``, written without the product.

What a program cannot know (inputs, where the robot is) is drawn from a seed. Variables begin anew
with every run, those of the program are global, those of a routine are local unless a global one
of the name exists; routines get copies. The default tool is active where a run begins. A thread
runs as a whole before some statement of the program after its start, or not at all.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from controllers import BINARY, COMPARE, MOST_STEPS, Ended, Move

from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix

OPENING = ("if ", "while ", "def ", "thread ")


class Pose(list[float]):
    """A pose: m and rotation vector in rad; plain lists are axes or lists of poses."""

    @property
    def matrix(self) -> np.ndarray:
        """The pose (4, 4)."""
        T = np.eye(4)
        T[:3, :3] = matrix_from_rotation_vector(np.array(self[3:]))
        T[:3, 3] = self[:3]
        return T

    @classmethod
    def of(cls, T: np.ndarray) -> Pose:
        """The pose of a matrix."""
        return cls([*T[:3, 3].tolist(), *rotation_vector_from_matrix(T[:3, :3]).tolist()])


class Routine(NamedTuple):
    """Parameters, and first line and end of the body."""

    parameters: list[str]
    first: int
    end: int


class Left(Exception):
    """Ends a routine, with its value."""


class UrController:
    """One script.

    Args:
        files: Its text by name.
        rng: Decides what the program cannot know.
    """

    def __init__(self, files: Mapping[str, str], rng: np.random.Generator) -> None:
        self.rng, self.moves = rng, list[Move]()
        (text,) = files.values()
        self.lines = [line.partition("#")[0].strip() for line in text.splitlines()]
        self.partner: dict[int, int] = {}
        self.others: dict[int, list[int]] = {}
        self.routines: dict[str, Routine] = {}
        opened: list[int] = []
        for at, line in enumerate(self.lines):
            if line.startswith(OPENING):
                opened.append(at)
                self.others[at] = []
            elif line.startswith(("else:", "elif ")):
                self.others[opened[-1]].append(at)
            elif line == "end":
                start = opened.pop()
                self.partner[start], self.partner[at] = at, start
        for at, line in enumerate(self.lines):
            match = re.match(r"(?:def|thread) (\w+)\((.*)\):$", line)
            if match:
                names = [each.strip() for each in match[2].split(",") if each.strip()]
                self.routines[match[1]] = Routine(names, at + 1, self.partner[at])

    def run(self) -> bool:
        """Runs the program; returns whether it came to its end."""
        self.data: dict[str, Any] = {}
        self.tool, self.steps, self.threads = np.eye(4), 0, set[str]()
        try:
            self._call("part", [])
        except Ended:
            return False
        return True

    # Values

    def value(self, text: str, local: dict[str, Any] | None) -> Any:
        """The value of an expression; not a copy."""
        return self._compute(ast.parse(text.strip(), mode="eval").body, local)

    def _compute(self, node: ast.expr, local: dict[str, Any] | None) -> Any:
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.UnaryOp):
            held = self._compute(node.operand, local)
            return not held if isinstance(node.op, ast.Not) else -held
        if isinstance(node, ast.BinOp):
            sides = (self._compute(each, local) for each in (node.left, node.right))
            return BINARY[type(node.op)](*sides)
        if isinstance(node, ast.Compare):
            sides = (self._compute(each, local) for each in (node.left, node.comparators[0]))
            return COMPARE[type(node.ops[0])](*sides)
        if isinstance(node, ast.List):
            return [copy.deepcopy(self._compute(each, local)) for each in node.elts]
        if isinstance(node, ast.Subscript):
            if isinstance(node.slice, ast.Tuple):  # a pose as it is written
                return Pose(self._compute(each, local) for each in node.slice.elts)
            held, index = self._compute(node.value, local), int(self._compute(node.slice, local))
            if not 0 <= index < len(held):
                raise Ended
            return held[index]
        if isinstance(node, ast.Name):
            for table in (local or {}, self.data):
                if node.id in table:
                    return table[node.id]
            raise Ended
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        given = [copy.deepcopy(self._compute(each, local)) for each in node.args]
        return self._function(node.func.id, given)

    def _function(self, name: str, given: list[Any]) -> Any:
        if name in self.routines:
            return self._call(name, given)
        if name == "get_standard_digital_in":
            return bool(self.rng.random() < 0.5)
        if name == "get_standard_analog_in":
            return float(self.rng.uniform(-0.05, 0.05))
        if name == "get_actual_tcp_pose":
            return Pose(self.rng.uniform(-0.9, 0.9, 6).tolist())
        if name == "get_inverse_kin":
            return given[0]  # a move to its axes is a move to the pose
        one, *more = (each.matrix for each in given)
        if name == "pose_inv":
            return Pose.of(np.linalg.inv(one))
        if name == "pose_trans":
            return Pose.of(one @ more[0])
        turn = more[0][:3, :3].T if name == "pose_sub" else more[0][:3, :3]
        T = np.eye(4)
        T[:3, 3] = one[:3, 3] + (-1.0 if name == "pose_sub" else 1.0) * more[0][:3, 3]
        T[:3, :3] = one[:3, :3] @ turn
        assert name in ("pose_add", "pose_sub"), name
        return Pose.of(T)

    # Statements

    def _call(self, name: str, given: list[Any]) -> Any:
        routine = self.routines[name]
        local = None if name == "part" else dict(zip(routine.parameters, given, strict=True))
        try:
            self._block(routine, local)
        except Left as left:
            return left.args[0]
        return None

    def _block(self, routine: Routine, local: dict[str, Any] | None) -> None:
        at = routine.first
        while at < routine.end:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            line = self.lines[at]
            for name in sorted(self.threads):
                if self.rng.random() < 0.2:
                    self.threads.discard(name)
                    self._call(name, [])
            if line.startswith(("def ", "thread ")):
                at = self.partner[at] + 1
            elif line.startswith("if "):
                at = self._choose(at, local)
            elif line.startswith(("else:", "elif ")):
                at = self.partner[max(s for s, places in self.others.items() if at in places)] + 1
            elif line.startswith("while "):
                at = at + 1 if self.value(line[6:-1], local) else self.partner[at] + 1
            elif line == "break":
                loops = [s for s, e in self.partner.items() if s < at < e]
                at = self.partner[max(s for s in loops if self.lines[s].startswith("while "))] + 1
            elif line == "end":
                start = self.partner[at]
                at = start if self.lines[start].startswith("while ") else at + 1
            else:
                self._act(line, local)
                at += 1

    def _choose(self, at: int, local: dict[str, Any] | None) -> int:
        for place in (at, *self.others[at]):
            line = self.lines[place]
            if line == "else:" or self.value(line.partition(" ")[2][:-1], local):
                return place + 1
        return self.partner[at] + 1

    def _act(self, line: str, local: dict[str, Any] | None) -> None:
        if started := re.match(r"(?:\w+ = )?run (\w+)\(\)$", line):
            self.threads.add(started[1])
            return
        if line.startswith(("join ", "kill ")):
            return
        match = re.match(r"(?:(global|local) )?([a-z]\w*)(?:\[(\w+)\])? = (.*)$", line)
        if line.startswith("return"):
            raise Left(copy.deepcopy(self.value(line[6:], local)) if line[6:] else None)
        if match:
            value = copy.deepcopy(self.value(match[4], local))
            table, name = self._table(match[1] or "", match[2], local), match[2]
            if match[3]:
                table[name][int(self.value(match[3], local))] = value
            else:
                table[name] = value
            return
        node = ast.parse(line, mode="eval").body
        assert isinstance(node, ast.Call), line
        assert isinstance(node.func, ast.Name)
        named = [each.value for each in node.keywords if each.arg == "pose"]
        word, arguments = node.func.id, named or node.args
        if word == "set_tcp":
            self.tool = self._compute(arguments[0], local).matrix
        elif word.startswith("move"):
            count = 2 if word == "movec" else 1
            for number, each in enumerate(arguments[:count], 1):
                self._move(self._compute(each, local), via=number < count)
        else:
            self._compute(node, local)

    def _table(self, prefix: str, name: str, local: dict[str, Any] | None) -> dict[str, Any]:
        """The table that an assignment means."""
        if local is None or prefix == "global":
            return self.data
        return local if prefix == "local" or name in local or name not in self.data else self.data

    def _move(self, value: Any, *, via: bool) -> None:
        target = value.matrix if isinstance(value, Pose) else np.array(value)
        self.moves.append(Move(np.eye(4), self.tool, target, via))
