"""The control-flow graph of a program, drawn statement by statement.

A node wherever paths divide or join and wherever a routine is called. Places are numbers that grow
from statement to statement.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Hashable, Iterable
from typing import Final

_NO_WAY: Final = "is unknown: no path through the program leads here"


class FlowGraph:
    """The graph, drawn statement by statement, and what is set on its way.

    Args:
        mains: How many of the routines begin with the program even if they are called from within.

    Attributes:
        barriers: Grows with every statement that is more than a plain one.
    """

    def __init__(self, mains: int = 0) -> None:
        self.barriers = 0
        self._mains = mains
        self._place: list[int] = []
        self._what: list[str] = []
        self._before: list[list[int]] = []
        self._calls: list[tuple[str, ...]] = []
        self._routine: list[int] = []
        self._at = -1
        self._names: dict[str, int] = {}
        self._first: list[int] = []
        self._last: list[list[int]] = []
        self._branches: list[tuple[int, list[int], bool, bool]] = []
        self._loops: list[tuple[int, int, list[int]]] = []
        self._labels: dict[tuple[int, str], int] = {}
        self._jumps: list[tuple[int, int, str]] = []
        self._handlers: set[str] = set()
        self._resumes = False
        self._sets: dict[Hashable, list[tuple[int, int]]] = defaultdict(list)
        self.start(0, "\0 before all")

    def __len__(self) -> int:
        return len(self._place)

    # Drawing

    def _add(self, at: int, before: Iterable[int], what: str = "") -> int:
        self.barriers += 1
        self._place.append(at)
        self._what.append(what or "depends on which branch ran")
        self._before.append([node for node in before if node >= 0])
        self._calls.append(())
        self._routine.append(len(self._first) - 1)
        self._at = len(self._place) - 1
        return self._at

    def start(self, at: int, name: str, *, handler: bool = False) -> None:
        """Begins a routine; the one before ends here. A handler may start at any place."""
        self._leave()
        self._first.append(len(self._place))
        self._last.append([])
        self._names[name] = len(self._first) - 1
        self._branches, self._loops = [], []
        self._add(at, (), "differs between the calls of this subprogram")
        if handler:
            self.handler(name)

    def handler(self, name: str) -> None:
        """Names a routine that an interrupt or trigger may start at any place."""
        self._handlers.add(name)

    def resume(self) -> None:
        """The program has RESUME: a routine may be left at any place."""
        self._resumes = True

    def set(self, at: int, key: Hashable, version: int) -> None:
        """Gives a thing a version (>= 0; 0 is what it was at first) from a place on."""
        self._sets[key].append((at, version))

    def call(self, at: int, names: Iterable[str]) -> int:
        """Passes through other routines, of this program or not; returns the node."""
        node = self._add(at, [self._at], "depends on the path through a called subprogram")
        self._calls[node] = tuple(names)
        return node

    def branch(self, at: int, *, opens: bool) -> None:
        """IF (which opens its first alternative at once), SWITCH and TEST."""
        entry = self._add(at, [self._at])
        self._branches.append((entry, [], False, opens))
        self._add(at, [entry])

    def alternative(self, at: int, *, other: bool) -> None:
        """ELSE and DEFAULT (``other``: taken if nothing else is), ELSEIF and CASE."""
        self.barriers += 1
        if self._branches:
            entry, ends, is_complete, is_open = self._branches.pop()
            if is_open:
                ends.append(self._at)
            self._branches.append((entry, ends, is_complete or other, True))
            self._add(at, [entry])

    def condition(self, at: int) -> None:
        """Ends the condition of an alternative: the others begin behind what it has called."""
        node = self._add(at, [self._at])
        if self._branches:
            self._branches.append((node, *self._branches.pop()[1:]))
        self._add(at, [node])

    def loop_condition(self, at: int) -> None:
        """Ends the condition of a loop: its calls run before every turn and before the end."""
        node = self._add(at, [self._at])
        if self._loops:
            head, _, exits = self._loops.pop()
            self._loops.append((head, node, exits))
        self._add(at, [node])

    def call_one(self, at: int, names: Collection[str]) -> None:
        """Passes through one of some routines, or none of them."""
        self.branch(at, opens=False)
        for name in names:
            self.alternative(at, other=False)
            self.call(at, [name])
        self.join(at)

    def call_any(self, at: int, names: Collection[str]) -> None:
        """Passes through some routines, each any number of times, or none of them."""
        self.loop(at)
        self.call_one(at, names)
        self.close_loop(at)

    @property
    def in_branch(self) -> bool:
        """Returns whether the statement being read runs on one of several ways."""
        return bool(self._branches)

    def join(self, at: int) -> None:
        """End of a branch."""
        self.barriers += 1
        if self._branches:
            entry, ends, is_complete, _ = self._branches.pop()
            self._add(at, [*ends, self._at, *([] if is_complete else [entry])])

    def loop(self, at: int) -> None:
        """Head of a loop."""
        head = self._add(at, [self._at], "differs between the first and later turns of a loop")
        self._loops.append((head, head, []))
        self._add(at, [head])

    def close_loop(self, at: int) -> None:
        """End of a loop: back to the head, or on; an interrupt leaves any."""
        self.barriers += 1
        if self._loops:
            head, tested, exits = self._loops.pop()
            if self._at >= 0:
                self._before[head].append(self._at)
            what = "depends on the number of turns of the previous loop"
            self._add(at, [tested, self._at, *exits], what)

    def exit_loop(self, at: int) -> None:
        """Leaves the loop from within."""
        self.barriers += 1
        if self._loops:
            self._loops[-1][2].append(self._at)
            self._add(at, (), _NO_WAY)

    def label(self, at: int, name: str) -> None:
        """A place a jump leads to."""
        node = self._add(at, [self._at], "differs between the paths to this label")
        self._labels[len(self._first) - 1, name] = node

    def jump(self, at: int, name: str) -> None:
        """GOTO."""
        self._jumps.append((self._at, len(self._first) - 1, name))
        self._add(at, (), _NO_WAY)

    def leave(self, at: int) -> None:
        """RETURN."""
        self._leave()
        self._add(at, (), _NO_WAY)

    def _leave(self) -> None:
        if self._last:
            self._last[-1].append(self._at)
