"""What executes G-code of either control: blocks, runs and expressions, without the product.

What a program cannot know (inputs, which blocks with / are skipped) is drawn from a seed. A run
begins with the states of a reset; work offsets and R parameters stay from run to run.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from controllers import BINARY, COMPARE, MOST_STEPS, Ended
from gcode_machine import GcodeMachine, Words

from robotrue.core.units import DEG
from robotrue.program.program import FrameTable

SPIN = 20.0 * DEG
STOP = -1
"""Instead of the next block: back to the caller."""


class GcodeController:
    """Blocks, jumps and calls, whatever the control.

    Args:
        files: Texts by name; the first is the main program.
        table: Work frames and tools.
        rng: Decides what the program cannot know.
    """

    comments: re.Pattern[str]

    def __init__(
        self, files: Mapping[str, str], table: FrameTable, rng: np.random.Generator
    ) -> None:
        self.rng, self.machine = rng, GcodeMachine(table, SPIN)
        self.moves = self.machine.moves
        self.programs: dict[str, list[str]] = {}
        for name, text in files.items():
            self.load(name, [self.comments.sub("", line).strip() for line in text.split("\n")])
        blocks = [b for program in self.programs.values() for b in program]
        self.changes = any(re.search(r"\bM0?6\b", block) for block in blocks)
        self.values: dict[str, float] = {}

    def load(self, name: str, blocks: list[str]) -> None:
        """Takes the programs of a file."""
        raise NotImplementedError

    def act(self, block: str, program: list[str], at: int) -> int:
        """Executes a block; returns the next one, or ``STOP``."""
        raise NotImplementedError

    def run(self) -> bool:
        """Runs the main program; returns whether it came to its end."""
        self.machine.reset()
        self.steps, self.chosen, self.depth = 0, "", 0
        self.cycle: dict[str, float] = {}
        self.initial, self.to_initial, self.modal = 0.0, True, ""
        self.skipping = {number: self.rng.random() < 0.5 for number in range(10)}
        self.locals: list[dict[str, float]] = [{}]
        self.target = ""
        try:
            self.call(next(iter(self.programs)))
        except Ended:
            return False
        return True

    def call(self, name: str) -> None:
        """Runs a program to its end."""
        program = self.programs[name]
        self.depth += 1
        self.stretch(program, 0, len(program))
        self.depth -= 1

    def stretch(self, program: list[str], first: int, end: int) -> bool:
        """Runs some blocks; returns whether they came to their end."""
        at = first
        while first <= at < end:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            block = re.sub(r"^N\d+\s*", "", program[at])
            if block.startswith("/"):
                number, block = re.findall(r"^/(\d?)\s*(.*)", block)[0]
                if self.skipping[int(number or 1)]:
                    at += 1
                    continue
                block = re.sub(r"^N\d+\s*", "", block)
            at = self.act(block, program, at) if block else at + 1
        return at == end

    def find(self, program: list[str], label: str) -> list[int]:
        """The blocks with a label or block number."""
        pattern = re.compile(rf"/?\d?\s*(?:N\d+\s+)?{label}:|/?\d?\s*{label}(?!\d|\w)")
        return [at for at, block in enumerate(program) if pattern.match(block)]

    def compute(self, text: str) -> float:
        """The value of an expression in Python's words."""
        return self._compute(ast.parse(text.strip(), mode="eval").body)

    def _compute(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.UnaryOp):
            value = self._compute(node.operand)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp):
            return BINARY[type(node.op)](self._compute(node.left), self._compute(node.right))
        if isinstance(node, ast.Compare):
            sides = self._compute(node.left), self._compute(node.comparators[0])
            return COMPARE[type(node.ops[0])](*sides)
        assert isinstance(node, ast.Name), ast.dump(node)
        if node.id.startswith("input"):
            return float(self.rng.random() < 0.5)
        for table in (self.locals[-1], self.values):
            if node.id in table:
                return table[node.id]
        raise Ended

    def choose_tool(self, name: str) -> None:
        """T; it is loaded at once by a control without M6."""
        self.chosen = name
        if not self.changes:
            self.machine.load(name)

    def go(self, words: Words, centre: Mapping[str, float], radius: float | None) -> None:
        """The motion of a block."""
        machine = self.machine
        if machine.drive in (2, 3) and (centre or radius is not None):
            machine.circle(words, centre, radius)
        elif words:
            machine.line(words)
