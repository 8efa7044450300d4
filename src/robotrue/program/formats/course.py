"""What a variable says at each statement, over every way a program can take.

A walk through the statements of a program records where ways divide and join and where something is
set; each thing that is ever set then has its own data flow (:mod:`.krl_flow`). Places are numbers
that grow from statement to statement.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.krl_flow import BASE, Flow

DIFFERS: Final = -1
"""Version of what differs between the ways that lead to a place."""


class _Step(NamedTuple):
    at: int
    kind: str
    name: str = ""
    yes: bool = False
    names: tuple[str, ...] = ()
    version: int = 0


class Course:
    """The recorded walk. Routines have names; one that an interrupt starts is a handler."""

    def __init__(self) -> None:
        self._steps: list[_Step] = [_Step(0, "start", "\0 before all")]
        self._sets: dict[Hashable, list[_Step]] = {}
        self._solved: dict[Hashable, tuple[IntArray, IntArray]] = {}
        self._handlers: set[str] = set()
        self.barriers = 0

    def __len__(self) -> int:
        return len(self._steps)

    def between(self, first: int, last: int) -> Course:
        """Returns the part of the walk from one place up to another, with nothing set in it."""
        part = Course()
        part._steps += [step for step in self._steps[1:] if first <= step.at < last]
        return part

    def set(self, at: int, key: Hashable, version: int) -> None:
        """Gives a thing a version (>= 0; 0 is what it was at first) from here on."""
        self._sets.setdefault(key, []).append(_Step(at, "set", version=version))

    def start(self, at: int, name: str, *, handler: bool = False) -> None:
        """Begins a routine."""
        self._step(_Step(at, "start", name, handler))

    def branch(self, at: int, *, opens: bool) -> None:
        """IF (which opens its first alternative at once) and TEST."""
        self._step(_Step(at, "branch", yes=opens))

    def alternative(self, at: int, *, other: bool) -> None:
        """ELSE and DEFAULT (``other``), ELSEIF and CASE."""
        self._step(_Step(at, "alternative", yes=other))

    def join(self, at: int) -> None:
        """End of a branch."""
        self._step(_Step(at, "join"))

    def loop(self, at: int) -> None:
        """Head of a loop."""
        self._step(_Step(at, "loop"))

    def close_loop(self, at: int) -> None:
        """End of a loop."""
        self._step(_Step(at, "close"))

    def exit_loop(self, at: int) -> None:
        """Leaves the loop from within."""
        self._step(_Step(at, "exit"))

    def leave(self, at: int) -> None:
        """RETURN."""
        self._step(_Step(at, "leave"))

    def label(self, at: int, name: str) -> None:
        """A place a jump leads to."""
        self._step(_Step(at, "label", name))

    def jump(self, at: int, name: str) -> None:
        """GOTO."""
        self._step(_Step(at, "jump", name))

    def call(self, at: int, names: Iterable[str]) -> None:
        """Passes through other routines."""
        self._step(_Step(at, "call", names=tuple(names)))

    def handlers(self) -> list[str]:
        """Returns the handlers that set something asked for: it may differ at any place."""
        return sorted(self._handlers)

    def versions(self, key: Hashable, places: IntArray) -> IntArray:
        """Returns the version (n,) in force at places (n,); ``DIFFERS`` where ways disagree."""
        if key not in self._sets:
            return np.zeros(len(places), np.int64)
        if key not in self._solved:
            self._solved[key] = self._solve(self._sets[key])
        line, value = self._solved[key]
        found = value[np.searchsorted(line, places, side="right") - 1]
        return np.maximum(found, DIFFERS)

    def _step(self, step: _Step) -> None:
        self.barriers += 1
        self._steps.append(step)

    def _solve(self, sets: list[_Step]) -> tuple[IntArray, IntArray]:
        flow = Flow()
        own = {step.name for step in self._steps if step.kind == "start"}
        for each in sorted([*self._steps, *sets], key=lambda step: step.at):
            match each.kind:
                case "set":
                    flow.set(each.at, (BASE, each.version))
                case "start":
                    flow.start(each.at, _name_routine(each.name))
                    if each.yes:
                        flow.handler(_name_routine(each.name))
                case "branch":
                    flow.branch(each.at, opens=each.yes)
                case "alternative":
                    flow.alternative(each.at, other=each.yes)
                case "join":
                    flow.join(each.at)
                case "loop":
                    flow.loop(each.at)
                case "close":
                    flow.close_loop(each.at)
                case "exit":
                    flow.exit_loop(each.at)
                case "leave":
                    flow.leave(each.at)
                case "label":
                    flow.label(each.at, each.name)
                case "jump":
                    flow.jump(each.at, each.name)
                case _:
                    flow.call(each.at, [_name_routine(name) for name in each.names if name in own])
        ways = flow.solve()
        self._handlers.update(name.removeprefix(_name_routine("")) for name in ways.handlers)
        return np.array(ways.line), np.array([value[BASE] for value in ways.value])


def _name_routine(routine: str) -> str:
    """Keeps names apart from those :mod:`.krl_flow` knows as KUKA's own."""
    return f"routine {routine}"
