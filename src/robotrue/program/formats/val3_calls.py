"""Calls of VAL3 routines: the motions of a routine go to the points it is given.

A parameter is spelled with the number of its routine, see ``Val3Routine.spell``. The motions of a
routine that name its parameters stand where it is called, once for each call.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from robotrue.program.formats.val3_files import Val3Routine
from robotrue.program.program import Motion

_MOST: Final = 1000
"""Routines and arguments that one call leads to; one that leads to more is not followed."""


class Reference(NamedTuple):
    """A variable as a statement names it.

    Attributes:
        name: Of the variable.
        key: Its element; None if that is computed.
    """

    name: str
    key: str | None

    def __str__(self) -> str:
        return self.name if self.key in ("0", None) else f"{self.name}[{self.key}]"

    @property
    def is_given(self) -> bool:
        """Whether it is a parameter."""
        return " " in self.name


class Val3Move(NamedTuple):
    """One motion.

    Attributes:
        motion: PTP, LIN or ARC_END.
        via: Auxiliary point of an arc.
        target: None if it is computed.
        tool: Likewise.
        file: Of the job.
        line: One-based.
    """

    motion: Motion
    via: Reference | None
    target: Reference | None
    tool: Reference | None
    file: int
    line: int

    @property
    def variables(self) -> tuple[Reference | None, Reference | None, Reference | None]:
        """What it names."""
        return self.via, self.target, self.tool

    def bind(self, given: Mapping[str, Reference | None]) -> Val3Move:
        """Returns it with arguments in place of its parameters, computed where none is given."""
        via, target, tool = (_bind(each, given) for each in self.variables)
        return self._replace(via=via, target=target, tool=tool)


class Val3Call(NamedTuple):
    """One call of a routine of the job.

    Attributes:
        routine: Its number.
        arguments: By the parameter; None if it is computed.
        file: Of the job.
        line: One-based.
    """

    routine: int
    arguments: dict[str, Reference | None]
    file: int
    line: int


Step = Val3Move | Val3Call


def _bind(each: Reference | None, given: Mapping[str, Reference | None]) -> Reference | None:
    return given.get(each.name) if each is not None and each.is_given else each


def _names_parameter(step: Step) -> bool:
    named = step.variables if isinstance(step, Val3Move) else step.arguments.values()
    return any(each is not None and each.is_given for each in named)


@dataclass(slots=True)
class CallTree:
    """The motions and calls of the routines of a job, by the number of the routine.

    Attributes:
        routines: Those that a name means, where only one has it.
        steps: Motions and calls in the order of the text.
        started: How often a name is called or started as a task.
    """

    routines: dict[str, Val3Routine]
    steps: list[list[Step]]
    started: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, routines: list[Val3Routine]) -> CallTree:
        """Returns the tree of some routines, without their steps; numbers the routines."""
        for number, routine in enumerate(routines):
            routine.number = number
        count = Counter(routine.name for routine in routines)
        only = {each.name: each for each in routines if count[each.name] == 1}
        return cls(only, [[] for _ in routines])

    def list_moves(self) -> tuple[list[Val3Move], list[Val3Call]]:
        """Returns the motions of the job in order, and the calls that lead too far."""
        moves, endless = list[Val3Move](), list[Val3Call]()
        opened = self._find_open()
        for number, steps in enumerate(self.steps):
            for step in steps:
                bound = number not in opened and _names_parameter(step)
                if isinstance(step, Val3Call):
                    found = None if bound else self._follow(step)
                    moves += found or ()
                    endless += [step] * (found is None and not bound)
                elif bound:  # it stands where the routine is called; here the path is not known
                    moves.append(step._replace(via=None, target=None, tool=None))
                else:
                    moves.append(step.bind({}))
        return moves, endless

    def _find_open(self) -> set[int]:
        """Returns the routines that more than the followed calls may start."""
        calls = [[each for each in steps if isinstance(each, Val3Call)] for steps in self.steps]
        followed = Counter(call.routine for some in calls for call in some)
        names = {routine.number: name for name, routine in self.routines.items()}
        closed = {
            number for number, count in followed.items() if count == self.started[names[number]]
        }
        opened = set(range(len(self.steps))) - closed
        reached = set[int]()
        for number in (*sorted(opened), *sorted(closed)):
            if number not in reached:  # one that only calls itself may be started from elsewhere
                opened.add(number)
                due = [number]
                while due:
                    fresh = {call.routine for call in calls[due.pop()]} - reached
                    reached |= fresh
                    due += fresh
        return opened

    def _follow(self, call: Val3Call) -> list[Val3Move] | None:
        """Returns the motions that a call leads to, if it does not lead too far."""
        moves, seen = list[Val3Move](), set[tuple[int, tuple[Reference | None, ...]]]()
        due: list[tuple[Iterator[Step], Mapping[str, Reference | None]]] = []

        def enter(each: Val3Call, outer: Mapping[str, Reference | None]) -> None:
            given = {name: _bind(one, outer) for name, one in each.arguments.items()}
            key = each.routine, tuple(given.values())
            if key not in seen:
                seen.add(key)
                due.append((iter(self.steps[each.routine]), given))

        enter(call, {})
        while due and len(seen) <= _MOST:
            steps, given = due[-1]
            step = next(steps, None)
            if step is None:
                due.pop()
            elif not _names_parameter(step):
                continue
            elif isinstance(step, Val3Call):
                enter(step, given)
            else:
                moves.append(step.bind(given)._replace(file=call.file, line=call.line))
        return None if due else moves
