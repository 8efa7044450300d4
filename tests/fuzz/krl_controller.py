"""Executes the KRL of ``krl_flow_programs``, written without the product.

What a program cannot know (inputs, when an interrupt comes) is drawn from a seed, so that the same
program with other numbers takes the same way. Data lists keep their values from run to run.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from controllers import MOST_STEPS, Ended, Move, split

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM

COMPONENTS = "xyzabc"
OPENING = ("if", "for", "while", "repeat", "loop", "switch")
CLOSING = ("endif", "endfor", "endwhile", "until", "endloop", "endswitch")
LOOPS = ("loop", "for", "while", "repeat")
COMPARE = {
    "==": operator.eq, "<>": operator.ne, "<=": operator.le, ">=": operator.ge,
    "<": operator.lt, ">": operator.gt,
}  # fmt: skip
ARITHMETIC = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul}
NAME = re.compile(r"\$anin\[\d+\]|[a-z_]\w*(?:\[\w+\])?\.[a-z]\b|[a-z_]\w*")
DECLARED = re.compile(
    r"(?:decl )?(?:global )?(e6pos|pos|frame|int|real)\s+(\w+)(\[\d+\])?(?:=(.*))?$"
)


def matrix(value: Mapping[str, float]) -> np.ndarray:
    """The pose (4, 4), m, of X, Y, Z, A, B, C in mm and deg."""
    T = np.eye(4)
    T[:3, :3] = matrix_from_abc(np.array([value[c] for c in "abc"]) * DEG)
    T[:3, 3] = np.array([value[c] for c in "xyz"]) * MM
    return T


def components(T: np.ndarray) -> dict[str, float]:
    """X, Y, Z, A, B, C of a pose."""
    b = np.arctan2(-T[2, 0], np.hypot(T[0, 0], T[1, 0]))
    turns = np.array([np.arctan2(T[1, 0], T[0, 0]), b, np.arctan2(T[2, 1], T[2, 2])])
    values = [*(T[:3, 3] / MM), *(turns / DEG)]
    return dict(zip(COMPONENTS, map(float, values), strict=True))


class KrlController:
    """Variables, frames in force and the motions of one robot.

    Args:
        files: Texts by name.
        frames: Numbered bases and tools, by ``base`` and ``tool``.
        rng: Decides what the program cannot know.
    """

    def __init__(
        self, files: Mapping[str, str], frames: Mapping[str, Mapping[str, np.ndarray]],
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self.rng, self.frames = rng, {side: dict(table) for side, table in frames.items()}
        self.lines: list[str] = []
        self.routines: dict[str, tuple[list[tuple[str, bool]], int, int]] = {}
        self.data: dict[str, Any] = {}
        self.moves: list[Move] = []
        for name, text in files.items():
            self._load(name, text.lower())

    def _load(self, name: str, text: str) -> None:
        routine, parameters, first = "", [], 0
        for line in text.splitlines():
            head = re.match(r"def (\w+)\s*\((.*)\)", line)
            if head:
                routine, first = head[1], len(self.lines)
                pairs = [each.strip().partition(":") for each in head[2].split(",") if each.strip()]
                parameters = [(each[0], each[2].strip() == "in") for each in pairs]
            elif line == "end":
                self.routines[routine] = parameters, first, len(self.lines)
            elif name.endswith(".src"):
                self.lines.append(line)
            elif not line.startswith(("defdat", "enddat")):
                self._declare(line, self.data)

    def run(self) -> bool:
        """Runs the program from its start; returns whether it came to its end."""
        self.base = self.tool = np.eye(4)
        self.handlers: dict[str, str] = {}
        self.active: set[str] = set()
        self.due: list[str] = []
        self.handling, self.steps = False, 0
        try:
            self._call("part", [], {})
        except Ended:
            return False
        return True

    # Values

    def _declare(self, line: str, local: dict[str, Any]) -> None:
        match = DECLARED.match(line)
        if match is None:
            self._assign(line, local)
        elif match[2] not in local or local is self.data:  # else a parameter, which has its value
            local[match[2]] = {} if match[3] else self.value(match[4], local) if match[4] else None

    def _place(self, text: str, local: dict[str, Any]) -> tuple[Any, Any]:
        """The table that holds a variable, and its key there."""
        match = re.fullmatch(r"(\w+)(?:\[(.*)\])?", text.strip())
        assert match, text
        table, key = (local if match[1] in local else self.data), match[1]
        if isinstance(table.get(key), tuple):  # a parameter by reference
            table, key = table[key]
        return (table[key], int(self.number(match[2], local))) if match[2] else (table, key)

    def _known(self, text: str, local: dict[str, Any]) -> Any:
        table, key = self._place(text, local)
        if table.get(key) is None:
            raise Ended
        return table[key]

    def value(self, text: str, local: dict[str, Any]) -> Any:
        """The value of an expression: a number, or components by name."""
        text = text.strip()
        parts = split(text, ":")
        if len(parts) > 1:
            T = np.eye(4)
            for part in parts:
                T = T @ matrix(self.value(part, local))
            return components(T)
        if text.startswith("{"):
            pairs = [part.split() for part in text.strip("{}").split(",")]
            return {name: float(number) for name, number in pairs}
        numbered = re.fullmatch(r"(base|tool)_data\[(.*)\]", text)
        if numbered:
            return components(self.frames[numbered[1]][str(self.number(numbered[2], local))])
        if text == "$nullframe":
            return dict.fromkeys(COMPONENTS, 0.0)
        if re.fullmatch(r"[a-z_]\w*(\[.*\])?", text):
            value = self._known(text, local)
            return dict(value) if isinstance(value, dict) else value
        return self.number(text, local)

    def number(self, text: str, local: dict[str, Any]) -> float:
        """The value of a sum of products; an analogue input differs every time."""

        def spell(match: re.Match[str]) -> str:
            if match[0].startswith("$"):
                return repr(float(self.rng.uniform(-50.0, 50.0)))
            name, _, component = match[0].partition(".")
            value = self._known(name, local)
            return repr(value[component] if component else value)

        def compute(node: ast.expr) -> float:
            if isinstance(node, ast.BinOp):
                return ARITHMETIC[type(node.op)](compute(node.left), compute(node.right))
            value = ast.literal_eval(node)
            assert isinstance(value, (int, float))
            return value

        return compute(ast.parse(NAME.sub(spell, text.strip()), mode="eval").body)

    def _holds(self, text: str, local: dict[str, Any]) -> bool:
        if text.startswith("$in["):
            return bool(self.rng.random() < 0.5)
        if text == "true":
            return True
        match = re.fullmatch(r"(.+?)(==|<>|<=|>=|<|>)(.+)", text)
        assert match, text
        return bool(COMPARE[match[2]](self.number(match[1], local), self.number(match[3], local)))

    # Statements

    def _call(self, name: str, arguments: list[str], local: dict[str, Any]) -> None:
        parameters, first, end = self.routines[name]
        new: dict[str, Any] = {}
        for (parameter, by_value), text in zip(parameters, arguments, strict=True):
            new[parameter] = self.value(text, local) if by_value else self._place(text, local)
        self._block(first, end, new)

    def _partners(self, first: int, end: int) -> tuple[dict[int, int], dict[int, list[int]]]:
        """The other end of every structure, and the alternatives in it."""
        opened: list[int] = []
        partner: dict[int, int] = {}
        others: dict[int, list[int]] = {}
        for at in range(first, end):
            word = self.lines[at].partition(" ")[0]
            if word in OPENING:
                opened.append(at)
                others[at] = []
            elif word in ("else", "case", "default"):
                others[opened[-1]].append(at)
            elif word in CLOSING:
                start = opened.pop()
                partner[start], partner[at] = at, start
        return partner, others

    def _block(self, first: int, end: int, local: dict[str, Any]) -> None:
        partner, others = self._partners(first, end)
        last: dict[int, float] = {}
        at = first
        while at < end:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            self._interrupt()
            line = self.lines[at]
            word = line.partition(" ")[0]
            if word == "return":
                return
            if word == "goto":
                at = self.lines.index(line.split()[1] + ":", first, end)
            elif word in ("for", "endfor"):
                at = self._count(at, partner, last, local)
            elif word in ("else", "case", "default"):
                at = partner[max(s for s, alternatives in others.items() if at in alternatives)] + 1
            elif word == "exit":
                around = [s for s in partner if s < at < partner[s]]
                at = 1 + partner[max(s for s in around if self.lines[s].split()[0] in LOOPS)]
            elif word in (*OPENING, *CLOSING):
                at = self._control(at, word, partner, others.get(at, []), local)
            else:
                self._act(line, local)
                at += 1

    def _control(
        self, at: int, word: str, partner: dict[int, int], others: list[int],
        local: dict[str, Any],
    ) -> int:  # fmt: skip
        """The next line behind a branch or a loop that is not counted."""
        line, rest = self.lines[at], self.lines[at].partition(" ")[2]
        if word == "if" and not self._holds(rest.removesuffix(" then"), local):
            return [*others, partner[at]][0] + 1
        if word == "while" and not self._holds(rest, local):
            return partner[at] + 1
        if word in ("endwhile", "endloop") or (word == "until" and not self._holds(rest, local)):
            return partner[at]
        if word == "switch":
            value = self.number(rest, local)
            for other in others:
                line = self.lines[other]
                if line == "default" or value in map(int, line.removeprefix("case ").split(",")):
                    return other + 1
            return partner[at] + 1
        return at + 1

    def _count(
        self, at: int, partner: dict[int, int], last: dict[int, float], local: dict[str, Any]
    ) -> int:
        start = min(at, partner[at])
        match = re.match(r"for (\w+)=(.*) to (.*)$", self.lines[start])
        assert match
        table, key = self._place(match[1], local)
        if at == start:
            table[key], last[at] = self.number(match[2], local), self.number(match[3], local)
        else:
            table[key] += 1
        return start + 1 if table[key] <= last[start] else max(at, partner[at]) + 1

    def _interrupt(self) -> None:
        for number in sorted(self.active):
            if self.rng.random() < 0.12 and not self.handling:
                self.handling = True
                self._call(self.handlers[number], [], {})
                self.handling = False

    def _act(self, line: str, local: dict[str, Any]) -> None:
        if line.startswith(("decl ", "e6pos ")):
            self._declare(line, local)
        elif line.startswith(("$base=", "$tool=")):
            setattr(self, line[1:5], matrix(self.value(line[6:], local)))
        elif match := re.match(r"bas\(#(base|tool),(.*)\)$", line):
            setattr(self, match[1], self.frames[match[1]][str(self.number(match[2], local))])
        elif match := re.match(r"(base|tool)_data\[(.*)\]=(.*)$", line):
            number = str(self.number(match[2], local))
            self.frames[match[1]][number] = matrix(self.value(match[3], local))
        elif match := re.match(r"(?:lin|ptp|circ) (.*)$", line):
            targets = split(match[1], ",")
            for number, text in enumerate(targets, 1):
                self._move(text, number < len(targets), local)
            due, self.due = self.due, []
            for name in due:
                self._call(name, [], {})
        elif match := re.match(r"interrupt decl (\d+) when .* do (\w+)\(\)", line):
            self.handlers[match[1]] = match[2]
        elif match := re.match(r"interrupt (on|off) (\d+)", line):
            known = match[1] == "on" and match[2] in self.handlers
            self.active = self.active | {match[2]} if known else self.active - {match[2]}
        elif match := re.match(r"trigger .* do (\w+)\(\)", line):
            self.due.append(match[1])
        elif match := re.match(r"(\w+)\((.*)\)$", line):
            self._call(match[1], split(match[2], ",") if match[2] else [], local)
        elif not line.endswith(":"):
            self._assign(line, local)

    def _assign(self, line: str, local: dict[str, Any]) -> None:
        match = re.match(r"(\w+(?:\[\w+\])?)(?:\.([a-z]))?=(.*)$", line)
        assert match, line
        if match[2]:
            value = self.number(match[3], local)
            self._known(match[1], local)[match[2]] = value
        else:
            value = self.value(match[3], local)
            table, key = self._place(match[1], local)
            table[key] = value

    def _move(self, text: str, via: bool, local: dict[str, Any]) -> None:
        value = self.value(text, local)
        whole = matrix(value) if len(value) >= len(COMPONENTS) else None
        self.moves.append(Move(self.base, self.tool, whole, via))
