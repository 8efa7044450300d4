"""Executes the Yaskawa jobs of ``jbi_flow_programs``, written without the product.

What a job cannot know (inputs, where the robot is, jobs in no file) is drawn from a seed, and so is
what the manuals leave open: the order in which files are loaded, whether END of the first job ends
a shift, whether shifts along different frames add up, whether a frame that is set later moves
taught positions. P variables, user frames and tools belong to the controller and keep their values
from run to run; C positions and LP variables belong to their job.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from controllers import MOST_STEPS, Ended, Move
from written import RATIOS

from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG, MM

POINT = re.compile(r"(C|P|EC)(\d+)=(.*)$")
MOVE = re.compile(r"MOV[JLCS] (C\d+|P\d+|LP\d+|P\[I\d+\])(?!\S)(.*)$")
CONDITION = re.compile(r"(\S+?)(<>|<=|>=|=|<|>)(\S+)$")
SIGNS: Mapping[str, Callable[[float, float], bool]] = {
    "=": operator.eq, "<>": operator.ne, "<=": operator.le, ">=": operator.ge, "<": operator.lt,
    ">": operator.gt,
}  # fmt: skip
FINE, SMALL = 1e-3, 1e-4
"""mm and deg of an element of a position variable."""


@dataclass
class Point:
    """A position: six numbers, how they are meant, and its frame and tool by number.

    ``kind`` is ``RECTAN`` (mm and deg), ``PULSE`` or ``ANGLE``; ``frame`` the number of a user
    frame, or 0 for the robot's root. Base and tool are kept where they were taught.
    """

    values: np.ndarray
    kind: str
    frame: int
    tool: int
    T_base: np.ndarray | None = None
    T_tool: np.ndarray | None = None


@dataclass
class Job:
    """The instructions and positions of a file; ``relative`` is its own user frame."""

    name: str = ""
    lines: list[str] = field(default_factory=list)
    points: dict[str, Point] = field(default_factory=dict)
    relative: int = 0


@dataclass
class Level:
    """A job that is executed: its LP variables, and the user frame it is called with."""

    job: Job
    frame: int
    points: dict[str, Point] = field(default_factory=dict)
    argument: float = 0.0
    loops: dict[int, float] = field(default_factory=dict)


def pose(values: np.ndarray) -> np.ndarray:
    """The matrix (4, 4), m, of X Y Z in mm and Rx Ry Rz in deg."""
    T = np.eye(4)
    T[:3, :3] = matrix_from_abc(values[[5, 4, 3]] * DEG)
    T[:3, 3] = values[:3] * MM
    return T


def numbers(T: np.ndarray) -> np.ndarray:
    """X Y Z in mm and Rx Ry Rz in deg of a matrix."""
    return np.array([*(T[:3, 3] / MM), *(abc_from_matrix(T[:3, :3])[::-1] / DEG)])


def along(step: np.ndarray) -> np.ndarray:
    """The matrix (4, 4) of a displacement in mm; turned ones are not executed."""
    if step[3:].any():
        raise Ended
    T = np.eye(4)
    T[:3, 3] = step[:3] * MM
    return T


class JbiController:
    """Variables, frames and motions of one robot.

    Args:
        files: Texts by name.
        frames: Numbered frames, by ``base`` and ``tool``.
        rng: Decides what the jobs cannot know.
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
        self.numbers: dict[str, float] = {"B001": 1.0}
        self.shifts: dict[str, np.ndarray] = {}
        self.ends_shift, self.adds_up, self.taught = (rng.random(3) < 0.5).tolist()
        self.places: dict[str, Point] = {}
        self.jobs: dict[str, Job] = {}
        texts = list(files.values())
        for index in rng.permutation(len(texts)).tolist():
            self._load(texts[index])

    def _load(self, text: str) -> None:
        job, user, tool, kind, frame = Job(), 0, 0, "PULSE", 0
        head, _, body = text.partition("//INST\n")
        for line in head.split("\n"):
            word, _, value = line.partition(" ")
            if word == "//NAME":
                job.name = value
            elif word == "///USER":
                user = int(value)
            elif word == "///TOOL":
                tool = int(value)
            elif word == "///POSTYPE":
                frame = 0 if value != "USER" else -1
            elif word in ("///RECTAN", "///PULSE", "///ANGLE"):
                kind = word[3:]
            elif match := POINT.match(line):
                values = np.array([float(each) for each in match[3].split(",")])
                held = {"P": self.places, "C": job.points}.get(match[1], {})
                held[f"{match[1]}{int(match[2])}"] = Point(values, kind, frame and user, tool)
        for line in body.split("\n"):
            if line.startswith("////FRAME USER "):
                job.relative = int(line.split()[2])
            elif line and not line.startswith(("/", "'")):
                job.lines.append(line)
        if self.taught and not job.relative:  # such a job keeps axes: frames set later do nothing
            for point in job.points.values():
                point.T_base = self.frames["base"][point.frame]
                point.T_tool = self.frames["tool"][point.tool]
        self.jobs[job.name] = job

    def run(self) -> bool:
        """Runs the job PART from its start; returns whether it came to its end."""
        self.steps = 0
        try:
            self._call("PART", 0, 0.0)
        except Ended:
            return False
        if self.ends_shift:
            self.shifts.clear()
        return True

    # Values

    def point(self, text: str, level: Level) -> Point:
        """A position by its name; ``PX`` names the P variable of the robot with its axes."""
        if text.startswith("P["):
            text = f"P{int(self.numbers.get(text[2:-1], 0.0))}"
        name = re.sub(r"0*(\d+)$", r"\1", text.replace("X", ""))
        found: Mapping[str, Point] = self.places
        if name[0] != "P":
            found = level.points if name[0] == "L" else level.job.points
        if name not in found:
            raise Ended
        return found[name]

    def set_point(self, text: str, point: Point, level: Level) -> None:
        """Gives a variable another value."""
        if text.startswith("P["):
            text = f"P{int(self.numbers.get(text[2:-1], 0.0))}"
        name = re.sub(r"0*(\d+)$", r"\1", text.replace("X", ""))
        copy = replace(point, values=np.array(point.values), T_base=None, T_tool=None)
        (level.points if name[0] == "L" else self.places)[name] = copy

    def value(self, text: str) -> float:
        """A number, the value of a variable or of an input."""
        if text.startswith("IN#"):
            return float(self.rng.random() < 0.5)
        if text in ("ON", "OFF"):
            return float(text == "ON")
        return float(text) if text.lstrip("-").isdigit() else self.numbers.get(text, 0.0)

    def holds(self, condition: str) -> bool:
        """Whether a condition holds; an empty one does."""
        if not condition:
            return True
        match = CONDITION.match(condition)
        assert match, condition
        return SIGNS[match[2]](self.value(match[1]), self.value(match[3]))

    def base(self, point: Point, level: Level) -> np.ndarray:
        """The frame (4, 4) a position counts from."""
        if level.job.relative and point.frame == level.job.relative and level.frame:
            return self.frames["base"][level.frame]
        return self.frames["base"][point.frame] if point.T_base is None else point.T_base

    def tool(self, point: Point) -> np.ndarray:
        """The tool (4, 4) of a position."""
        return self.frames["tool"][point.tool] if point.T_tool is None else point.T_tool

    def in_root(self, point: Point, level: Level) -> np.ndarray:
        """The pose (4, 4) of a position in the robot's root; of axis values some function."""
        if point.kind != "RECTAN":
            return pose(np.array([500.0, 200.0, 100.0, 3.0, 2.0, 1.0]) * np.sin(point.values * DEG))
        return self.base(point, level) @ pose(point.values)

    def frame(self, tag: str) -> np.ndarray:
        """The frame (4, 4) that a tag names."""
        if tag.startswith("UF#"):
            return self.frames["base"][int(self.value(tag[4:-1]))]
        assert tag in ("BF", "RF"), tag
        return np.eye(4)

    # Instructions

    def _call(self, name: str, frame: int, argument: float) -> None:
        if name not in self.jobs:
            self._run_absent()
            return
        level, at = Level(self.jobs[name], frame, argument=argument), 0
        while True:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            line = level.job.lines[at]
            order, _, condition = line.partition(" IF ")
            if line == "END" or (order == "RET" and self.holds(condition)):
                return
            if order.startswith("JUMP JOB:"):
                if self.holds(condition):
                    self._enter(order, level)
                    return
                at += 1
            else:
                at = self._go(order, condition, at, level)

    def _run_absent(self) -> None:
        """A job in no file may change any P variable, as the product assumes, and nothing else."""
        name = f"P{int(self.rng.integers(1, 7))}"
        step = self.rng.uniform(-50.0, 50.0)
        if name in self.places and self.rng.random() < 0.7:
            values = np.array(self.places[name].values)
            values[int(self.rng.integers(3))] = step
            self.places[name] = replace(self.places[name], values=values)

    def _enter(self, order: str, level: Level) -> None:
        match = re.match(r"\w+ JOB:(\w+)(?: \((\S+)\))?(?: UF#\((\w+)\))?$", order)
        assert match, order
        argument = self.value(match[2]) if match[2] else 0.0
        self._call(match[1], int(self.value(match[3])) if match[3] else 0, argument)

    def _go(self, order: str, condition: str, at: int, level: Level) -> int:
        """Executes an instruction; returns the place of the next one."""
        lines, words = level.job.lines, order.split()
        if words[0] == "JUMP":
            return lines.index(words[1]) + 1 if self.holds(condition) else at + 1
        if words[0] == "CALL":
            if self.holds(condition):
                self._enter(order, level)
        elif words[0].startswith("MACRO"):
            self._run_absent()
        elif words[0] == "IFTHENEXP":
            return at + 1 if self.holds(words[1]) else self._behind(lines, at, ("ELSE", "ENDIF"))
        elif words[0] == "ELSE":
            return self._behind(lines, at, ("ENDIF",))
        elif words[0] == "FOR":
            self.numbers[words[1]] = self.value(words[3])
            level.loops[at] = self.value(words[5])
        elif words[0] == "NEXT":
            return self._end_loop(at, level)
        elif match := MOVE.match(order):
            self._move(match[1], match[2], level)
            if (trap := re.search(r" TRAP (\S+)", order)) and self.rng.random() < 0.3:
                return lines.index(trap[1]) + 1
        elif words[0] == "IMOV":
            self._step(words, level)
        elif words[0] == "SFTON":
            self._shift(words, level)
        elif words[0] == "SFTOF":
            self.shifts.clear()
        elif not words[0].startswith(("*", "NOP", "ENDIF", "DOUT", "REFP", "RET", "TIMER")):
            self._assign(words, level)
        return at + 1

    def _behind(self, lines: list[str], at: int, ends: tuple[str, ...]) -> int:
        depth = 0
        for place in range(at + 1, len(lines)):
            if depth == 0 and lines[place] in ends:
                return place + 1
            depth += lines[place].startswith("IFTHENEXP") - (lines[place] == "ENDIF")
        raise AssertionError(lines[at])

    def _end_loop(self, at: int, level: Level) -> int:
        name = level.job.lines[at].split()[1]
        start = max(k for k in level.loops if k < at and level.job.lines[k].split()[1] == name)
        self.numbers[name] += 1.0
        return start + 1 if self.numbers[name] <= level.loops[start] else at + 1

    def _assign(self, words: list[str], level: Level) -> None:
        word, name = words[0], words[1]
        if word == "MFRAME":
            self._set_frame(words, level)
        elif word == "SETTOOL":
            self.frames["tool"][int(name[4:-1])] = pose(self._rectangular(words[2], level).values)
        elif word == "GETARG":
            self.numbers[name] = level.argument
        elif word == "GETE":
            point = self.point(words[2], level)
            unit = 1.0 if point.kind == "PULSE" else FINE if words[3] < "(4)" else SMALL
            self.numbers[name] = round(point.values[int(words[3][1]) - 1] / unit)
        elif word in ("INC", "DEC"):
            self.numbers[name] = self.value(name) + (1.0 if word == "INC" else -1.0)
        elif name[0] in "BID":
            change = self.value(words[2])
            signs = {"SET": change, "ADD": self.value(name) + change}
            self.numbers[name] = signs[word] if word in signs else self.value(name) - change
        else:
            self._assign_point(words, level)

    def _assign_point(self, words: list[str], level: Level) -> None:
        word, name = words[0], words[1]
        if word == "GETS":  # where the robot is
            self.set_point(name, Point(self.rng.uniform(-60.0, 60.0, 6), "RECTAN", 0, 1), level)
        elif word == "GETPOS":
            steps = [line for line in level.job.lines if MOVE.match(line)]
            number = int(words[2][6:-1]) - 1
            if number >= len(steps):
                raise Ended
            self.set_point(name, self.point(steps[number].split()[1], level), level)
        elif word == "SET":
            self.set_point(name, self.point(words[2], level), level)
        elif word == "CNVRT":
            source, tag = self.point(words[2], level), words[3]
            T = np.linalg.inv(self.frame(tag)) @ self.in_root(source, level)
            number = int(self.value(tag[4:-1])) if tag.startswith("UF#") else 0
            self.set_point(name, Point(numbers(T), "RECTAN", number, source.tool), level)
        elif word == "MSHIFT":
            one, two = (self.in_root(self.point(each, level), level) for each in words[3:5])
            step = np.linalg.inv(self.frame(words[2]))[:3, :3] @ (two - one)[:3, 3]
            self.set_point(name, Point(np.array([*step / MM, 0, 0, 0]), "RECTAN", 0, 1), level)
        else:
            self._change_point(words, level)

    def _change_point(self, words: list[str], level: Level) -> None:
        word, name, point = words[0], words[1], self.point(words[1], level)
        values = np.array(point.values)
        if word in ("ADD", "SUB") and words[2][0] != "(":
            other = self.point(words[2], level)
            if (other.kind, other.frame) != (point.kind, point.frame):
                raise Ended
            values += other.values if word == "ADD" else -other.values
            self.set_point(name, replace(point, values=values), level)
            return
        assert word == "SETE", words
        if words[2].startswith("TL#"):
            self.set_point(name, replace(point, tool=int(words[2][4:-1])), level)
            return
        index, change = int(words[2][1]) - 1, self.value(words[3])
        unit = 1.0 if point.kind == "PULSE" else FINE if index < 3 else SMALL
        values[index] = change * unit
        self.set_point(name, replace(point, values=values), level)

    def _rectangular(self, text: str, level: Level) -> Point:
        point = self.point(text, level)
        if point.kind != "RECTAN":
            raise Ended
        return point

    def _set_frame(self, words: list[str], level: Level) -> None:
        """Origin, a point on X and one beside it; or one position, in the base."""
        number = int(self.value(words[1][4:-1]))
        if words[3] == "BF":
            self.frames["base"][number] = pose(self._rectangular(words[2], level).values)
            return
        origin, x, y = (self.in_root(self.point(text, level), level)[:3, 3] for text in words[2:5])
        T, x, y = np.eye(4), x - origin, y - origin
        z = np.cross(x, y)
        if np.linalg.norm(z) < 1e-9:
            raise Ended
        columns = x, np.cross(z, x), z
        T[:3, :3] = np.stack([c / np.linalg.norm(c) for c in columns], axis=1)
        T[:3, 3] = origin
        self.frames["base"][number] = T

    def _shift(self, words: list[str], level: Level) -> None:
        tag = words[2] if len(words) > 2 else "BF"
        if not self.adds_up:
            self.shifts.clear()
        self.shifts[tag] = np.array(self._rectangular(words[1], level).values)

    def _move(self, name: str, tail: str, level: Level) -> None:
        point = self.point(name, level)
        tool = self.tool(point)
        if chosen := re.search(r" TL#\((\d+)\)", tail):
            tool = self.frames["tool"][int(chosen[1])]
        shifts = dict(self.shifts)
        if own := re.search(r"\+SFTON3D (P\d+)", tail):
            shifts["own"] = self._rectangular(own[1], level).values
        if point.kind != "RECTAN":
            axes = point.values / (RATIOS if point.kind == "PULSE" else 1.0) * DEG
            for step in shifts.values():  # some axis values elsewhere
                axes = axes + along(step)[:3, 3].sum()
            self.moves.append(Move(np.eye(4), tool, axes, via=False))
            return
        base = self.base(point, level)
        target = pose(point.values)
        for tag, step in shifts.items():
            if tag == "TF":
                target = target @ along(step)
            else:
                F = np.linalg.inv(base) @ self.frame("BF" if tag == "own" else tag)
                target = F @ along(step) @ np.linalg.inv(F) @ target
        self.moves.append(Move(base, tool, target, via=False))

    def _step(self, words: list[str], level: Level) -> None:
        """A motion from where the robot is."""
        step = np.array(self._rectangular(words[1], level).values)
        T, last, tag = along(step), self.moves[-1] if self.moves else None, words[3]
        if last is None or last.target is None or last.target.ndim == 1:
            raise Ended
        there = last.base @ last.target
        F = np.eye(4) if tag == "TF" else self.frame(tag)
        there = there @ T if tag == "TF" else F @ T @ np.linalg.inv(F) @ there
        self.moves.append(Move(np.eye(4), last.tool, there, False, True, step))
