"""Executes the VAL3 of ``val3_flow_programs``, written without the product.

What a program cannot know (inputs, where the robot is, when a task runs, what a program of a
library that is not there changes) is drawn from a seed. Data keep their values from run to run,
unless the application is loaded anew; locals live as long as their call. A point is stored in its
parent frame, which is looked up when the robot moves. ``link`` keeps either the numbers of a point
or its place: a reader must be right for both.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from xml.etree import ElementTree

import numpy as np
from controllers import BINARY, COMPARE, MOST_STEPS, Ended, Move, split

from robotrue.core.units import DEG, MM

NAMES = ("x", "y", "z", "rx", "ry", "rz")
OPENING = ("if", "for", "while", "do", "switch")
CLOSING = ("endIf", "endFor", "endWhile", "until", "endSwitch")
MIDDLE = ("else", "elseIf", "case", "default")
ASSIGNED = re.compile(r"([A-Za-z_][\w:]*(?:\[[^\]]*\])?(?:\.\w+)*)=(?!=)(.*)$")
STARTED = re.compile(r"(?:call |taskCreate(?:Sync)?\b.*,)([\w:]+)\((.*)\)$")
DRIFT, LOST, BESIDE, ANEW = 7.0, 0.5, 0.2, 0.3


class Returned(Exception):
    """Ends a program."""


class Trsf(list[float]):
    """A transformation: mm, and deg about x, the new y and the new z."""

    @property
    def matrix(self) -> np.ndarray:
        """The pose (4, 4) in m."""
        return _matrix(tuple(self))

    @classmethod
    def of(cls, T: np.ndarray) -> Trsf:
        """The transformation of a pose."""
        turns = [
            np.arctan2(-T[1, 2], T[2, 2]), np.arctan2(T[0, 2], np.hypot(T[0, 0], T[0, 1])),
            np.arctan2(-T[0, 1], T[0, 0]),
        ]  # fmt: skip
        return cls([*(T[:3, 3] / MM).tolist(), *(float(turn) / DEG for turn in turns)])


class Axes(list[float]):
    """Axis values in deg; ``follows`` as that of a point."""

    follows = False


@dataclass(eq=False)
class Cell:
    """One element of a variable; what means it sees its new values."""

    value: Any


@dataclass(eq=False)
class Linked:
    """A point, frame or tool: where it is in another, None for the root of all.

    ``follows``: computed from a point with a function that shifts points, or a copy.
    """

    trsf: Trsf
    father: Cell | None = None
    follows: bool = False

    @property
    def base(self) -> np.ndarray:
        """The pose (4, 4) of its parent in the root."""
        return np.eye(4) if self.father is None else self.father.value.pose

    @property
    def pose(self) -> np.ndarray:
        """The pose (4, 4) in the root."""
        return self.base @ self.trsf.matrix


def copied(value: Any) -> Any:
    """A copy, with the same parent."""
    if isinstance(value, Linked):
        return Linked(Trsf(value.trsf), value.father, value.follows)
    return type(value)(value) if isinstance(value, list) else value


@lru_cache(4096)
def _matrix(values: tuple[float, ...]) -> np.ndarray:
    T = np.eye(4)
    turns = np.array(values[3:]) * DEG
    (sx, sy, sz), (cx, cy, cz) = np.sin(turns).tolist(), np.cos(turns).tolist()
    T[:3, :3] = [
        [cy * cz, -cy * sz, sy],
        [cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy],
        [sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy],
    ]
    T[:3, 3] = np.array(values[:3]) * MM
    T.flags.writeable = False
    return T


@lru_cache(4096)
def parsed(text: str) -> ast.expr:
    """An expression as Python parses it."""
    text = text.replace("{", "(").replace("}", ")").replace(":", "__")
    text = text.replace("true", "True").replace("false", "False").strip()
    return ast.parse(text, mode="eval").body


@dataclass(frozen=True)
class Program:
    """Parameters with whether each is a reference, names of locals, and lines."""

    parameters: tuple[tuple[str, bool], ...]
    own: tuple[str, ...]
    lines: tuple[str, ...]


Table = dict[str, list[Cell]]


class Val3Controller:
    """One application, and the library next to it.

    Args:
        files: Texts by name.
        rng: Decides what the program cannot know.
    """

    def __init__(self, files: Mapping[str, str], rng: np.random.Generator) -> None:
        self.rng, self.moves = rng, list[Move]()
        self.keeps_numbers = bool(rng.random() < 0.5)
        self.programs: dict[str, Program] = {}
        self.texts = {n: ElementTree.fromstring(text) for n, text in files.items()}  # noqa: S314
        for name, root in self.texts.items():
            if name.endswith(".pgx"):
                self._add_program(root)
        self._load()

    def _add_program(self, root: ElementTree.Element) -> None:
        (program,) = (each for each in root if each.tag.endswith("Program"))
        given, own, lines = [], [], []
        for each in program.iter():
            tag = each.tag.rpartition("}")[2]
            if tag == "Parameter":
                given.append((each.attrib["name"], each.get("use") == "reference"))
            elif tag == "Local":
                own.append(each.attrib["name"])
            elif tag == "Code":
                lines = [line.strip() for line in (each.text or "").strip().splitlines()]
        assert lines[0] == "begin", lines
        assert lines[-1] == "end", lines
        name = program.attrib["name"]
        self.programs[name] = Program(tuple(given), tuple(own), tuple(lines[1:-1]))

    def _load(self) -> None:
        """Sets all data to the values of the files."""
        self.data: Table = {"world": [Cell(None)], "flange": [Cell(Linked(Trsf([0.0] * 6)))]}
        self.data["world"][0].value = Linked(Trsf([0.0] * 6))
        fathers = []
        for name, root in self.texts.items():
            for each in root.iter() if name.endswith(".dtx") else ():
                if not each.tag.endswith("Data"):
                    continue
                cells = [Cell(self._value(each.attrib["type"], value.attrib)) for value in each]
                self.data[each.attrib["name"]] = cells
                known = zip(cells, each, strict=True)
                fathers += [(c, value.get("fatherId")) for c, value in known if value.get("x")]
        for cell, father in fathers:
            if father:
                name, _, key = father.partition("[")
                cell.value.father = self.data[name][int(key.rstrip("]"))]
        self.data |= {f"lib__{name}": cells for name, cells in self.data.items()}

    def _value(self, kind: str, given: Mapping[str, str]) -> Any:
        if kind == "num":
            return float(given["value"])
        if kind == "jointRx":
            return Axes(float(given[f"j{k}"]) for k in range(1, 7))
        trsf = Trsf([float(given.get(name, "0")) for name in NAMES])
        return trsf if kind == "trsf" else Linked(trsf)

    def run(self) -> bool:
        """Runs start(); returns whether it came to its end."""
        if self.rng.random() < ANEW:
            self._load()
        self.steps, self.tasks = 0, set[str]()
        try:
            self._call("start", [])
        except Ended:
            return False
        return True

    # Values

    def value(self, text: str, local: Table) -> Any:
        """The value of an expression; a structure is not a copy."""
        return self._compute(parsed(text), local)

    def _cell(self, node: ast.expr, local: Table) -> Cell:
        index = 0
        if isinstance(node, ast.Subscript):
            index, node = int(self._compute(node.slice, local)), node.value
        assert isinstance(node, ast.Name), ast.dump(node)
        cells = local[node.id] if node.id in local else self.data[node.id]
        if not 0 <= index < len(cells) or cells[index].value is None:
            raise Ended
        return cells[index]

    def _compute(self, node: ast.expr, local: Table) -> Any:
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Tuple):
            return Trsf([float(self._compute(each, local)) for each in node.elts])
        if isinstance(node, ast.UnaryOp):
            value = self._compute(node.operand, local)
            return not value if isinstance(node.op, ast.Not) else -value
        if isinstance(node, ast.BoolOp):
            held = [self._compute(each, local) for each in node.values]
            return all(held) if isinstance(node.op, ast.And) else any(held)
        if isinstance(node, ast.Compare):
            sides = (self._compute(each, local) for each in (node.left, node.comparators[0]))
            return COMPARE[type(node.ops[0])](*sides)
        if isinstance(node, ast.BinOp):
            left, right = (self._compute(each, local) for each in (node.left, node.right))
            if isinstance(node.op, ast.Mult) and isinstance(left, Trsf):
                return Trsf.of(left.matrix @ right.matrix)
            if isinstance(left, Axes):
                return Axes(a + b for a, b in zip(left, right, strict=True))
            return BINARY[type(node.op)](left, right)
        if isinstance(node, ast.Attribute):
            whole = self._compute(node.value, local)
            return whole.trsf if node.attr == "trsf" else whole[_place(node.attr)]
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            return self._function(node.func.id, node.args, local)
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            if node.value.id == "dIn":
                return bool(self.rng.random() < 0.5)
        return self._cell(node, local).value

    def _function(self, name: str, nodes: list[ast.expr], local: Table) -> Any:
        if name == "aioGet":
            return float(self.rng.uniform(-50.0, 50.0))
        if name == "herej":
            return Axes(self.rng.uniform(-90.0, 90.0, 6).tolist())
        if name == "size":
            assert isinstance(nodes[0], ast.Name)
            return float(len(self.data[nodes[0].id]))
        if name in ("here", "jointToPoint"):
            frame = self._cell(nodes[1], local)
            if name == "here":
                return Linked(self._random(), frame)
            axes = self._compute(nodes[2], local)
            tool = self._compute(nodes[0], local).pose
            flange = Trsf([8.0 * sum(axes), *(5.0 * a for a in axes[1:3]), *axes[3:]]).matrix
            return Linked(Trsf.of(np.linalg.inv(frame.value.pose) @ flange @ tool), frame)
        if name == "setFrame":
            return self._set_frame(nodes, local)
        point = self._compute(nodes[0], local)
        if name == "position":
            frame = self._compute(nodes[1], local)
            return Trsf.of(np.linalg.inv(frame.pose) @ point.pose)
        shift = self._compute(nodes[-1], local).matrix
        if name == "appro":
            T = point.trsf.matrix @ shift
        else:
            assert name == "compose", name
            frame = self._compute(nodes[1], local).pose
            T = np.linalg.inv(point.base) @ frame @ shift @ np.linalg.inv(frame) @ point.pose
        is_shifted_point = not (isinstance(nodes[0], ast.Call) and not point.follows)
        return Linked(Trsf.of(T), point.father, is_shifted_point)

    def _random(self) -> Trsf:
        return Trsf(self.rng.uniform(-80.0, 80.0, 6).tolist())

    def _set_frame(self, nodes: list[ast.expr], local: Table) -> float:
        """The frame with an origin, a point on its x axis and one of its xy plane."""
        zero, along, plane = (self._compute(each, local).pose[:3, 3] for each in nodes[:3])
        z = np.cross(along - zero, plane - zero)
        if np.linalg.norm(z) < 1e-9:
            return -1.0
        T = np.eye(4)
        T[:3, 0] = (along - zero) / np.linalg.norm(along - zero)
        T[:3, 2] = z / np.linalg.norm(z)
        T[:3, 1], T[:3, 3] = np.cross(T[:3, 2], T[:3, 0]), zero
        frame = self._cell(nodes[3], local).value
        frame.trsf = Trsf.of(np.linalg.inv(frame.base) @ T)
        return 0.0

    # Statements

    def _call(self, name: str, given: list[Any]) -> None:
        if name not in self.programs:
            self._disturb()
            return
        program = self.programs[name]
        local: Table = {own: [Cell(Linked(Trsf([0.0] * 6)))] for own in program.own}
        for (parameter, refers), cell in zip(program.parameters, given, strict=True):
            local[parameter] = [cell if refers else Cell(copied(cell.value))]
        try:
            self._block(program.lines, local)
        except Returned:
            pass

    def _disturb(self) -> None:
        """A program that is not there changes some points, frames and tools."""
        for cells in self.data.values():
            for cell in cells:
                if isinstance(cell.value, Linked) and self.rng.random() < LOST:
                    cell.value.trsf[0] += DRIFT

    def _block(self, lines: tuple[str, ...], local: Table) -> None:
        partner, others = _find_partners(lines)
        last: dict[int, float] = {}
        at = 0
        while at < len(lines):
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            self._run_tasks()
            line = lines[at]
            word = line.partition(" ")[0]
            if word in ("for", "endFor"):
                at = self._count(at, lines, partner, last, local)
            elif word in (*MIDDLE, "break"):  # reached from above: go on behind
                at = partner[max(s for s, end in partner.items() if s < at < end)] + 1
            elif word in ("if", "switch"):
                at = self._choose(at, lines, [*others[at], partner[at]], local)
            elif word == "while":
                at = at + 1 if self.value(line[6:], local) else partner[at] + 1
            elif word == "endWhile":
                at = partner[at]
            elif word == "until":
                at = at + 1 if self.value(line[6:], local) else partner[at]
            else:
                self._act(line, local)
                at += 1

    def _run_tasks(self) -> None:
        for name in sorted(self.tasks):
            if name in self.tasks and self.rng.random() < BESIDE:
                self.tasks.discard(name)
                self._call(name, [])

    def _choose(self, at: int, lines: tuple[str, ...], others: list[int], local: Table) -> int:
        """The line behind the alternative that is taken, or the end of the structure."""
        word, _, rest = lines[at].partition(" ")
        value = self.value(rest, local)
        if word == "if" and value:
            return at + 1
        for other in others[:-1]:
            mark, _, text = lines[other].partition(" ")
            if mark in ("else", "default") or (mark == "elseIf" and self.value(text, local)):
                return other + 1
            if mark == "case" and value in map(float, text.split(",")):
                return other + 1
        return others[-1] + 1

    def _count(
        self, at: int, lines: tuple[str, ...], partner: dict[int, int], last: dict[int, float],
        local: Table,
    ) -> int:  # fmt: skip
        start = min(at, partner[at])
        match = re.match(r"for (\w+)=(.*?) to (.*?)(?: step (.*))?$", lines[start])
        assert match
        cell = self._cell(ast.Name(match[1]), local)
        if at == start:
            cell.value, last[at] = self.value(match[2], local), self.value(match[3], local)
        else:
            cell.value += 1
        return start + 1 if cell.value <= last[start] else partner[start] + 1

    def _act(self, line: str, local: Table) -> None:
        started = STARTED.match(line)
        if started and line.startswith("task"):
            self.tasks.add(started[1])
        elif started:
            nodes = [parsed(x) for x in split(started[2], ",") if x]
            cells = [
                Cell(self._compute(node, local)) if isinstance(node, ast.Call)
                else self._cell(node, local)
                for node in nodes
            ]  # fmt: skip
            self._call(started[1], cells)
        elif match := re.match(r"(?:nId=)?(move[jlc])\((.*)\)$", line):
            self._move(match[1], split(match[2], ","), local)
        elif match := re.match(r"link\((.*),(.*)\)$", line):
            self._link(match[1], match[2], local)
        elif match := ASSIGNED.match(line):
            self._assign(match[1], copied(self.value(match[2], local)), local)
        elif line == "return":
            raise Returned
        else:
            assert line in ("waitEndMove()", "open(t1)", "do", "endIf", "endSwitch"), line

    def _assign(self, text: str, value: Any, local: Table) -> None:
        node = parsed(text)
        if not isinstance(node, ast.Attribute):
            if isinstance(value, (Linked, Axes)):
                value.follows = True
            self._cell(node, local).value = value
        elif node.attr == "trsf":
            self._compute(node.value, local).trsf = Trsf(value)
        else:
            self._compute(node.value, local)[_place(node.attr)] = float(value)

    def _link(self, text: str, father: str, local: Table) -> None:
        linked = self.value(text, local)
        pose, cell = linked.pose, self._cell(parsed(father), local)
        linked.father = cell
        if not self.keeps_numbers:
            linked.trsf = Trsf.of(np.linalg.inv(linked.base) @ pose)

    def _move(self, word: str, parts: list[str], local: Table) -> None:
        tool = self.value(parts[-2], local).pose
        for number, text in enumerate(parts[:-2], 1):
            goal = self.value(text, local)
            if isinstance(goal, Linked):
                via = word == "movec" and number == 1
                move = Move(goal.base, tool, goal.trsf.matrix, via, goal.follows)
            else:
                move = Move(np.eye(4), tool, np.array(goal) * DEG, False, goal.follows)
            self.moves.append(move)


def _place(name: str) -> int:
    return NAMES.index(name) if name in NAMES else int(name[1:]) - 1


def _find_partners(lines: tuple[str, ...]) -> tuple[dict[int, int], dict[int, list[int]]]:
    """The other end of every structure, and the alternatives in it."""
    opened: list[int] = []
    partner: dict[int, int] = {}
    others: dict[int, list[int]] = {}
    for at, line in enumerate(lines):
        word = line.partition(" ")[0]
        if word in OPENING:
            opened.append(at)
            others[at] = []
        elif word in MIDDLE:
            others[opened[-1]].append(at)
        elif word in CLOSING:
            start = opened.pop()
            partner[start], partner[at] = at, start
    return partner, others
