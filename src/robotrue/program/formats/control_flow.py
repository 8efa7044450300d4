"""Reaching definitions: the settings in force at each place of a program, over all its paths.

A setting at a place of the graph has a *version*; each variable has a separate data flow, iterated
to its fixed point, in which a routine is summarised by its effect on the incoming version.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.expression import NotConstantError
from robotrue.program.formats.flow_graph import FlowGraph

DIFFERS: Final = -1
"""Version of what differs between the ways that lead to a place."""
_MOST_STEPS: Final = 600_000
"""Nodes looked at for variables in all; beyond, what is changed is not known."""
_UNREACHED: Final = -1
AS_FOUND: Final = -2
"""Mark of the version in force where the routine was called."""
_JOINED: Final = -3
"""``-3 - node``: mark of different versions that join at a node."""


class Reaching(NamedTuple):
    """The solved data flow of one thing.

    Attributes:
        node: (d,) version or mark at each drawn node, after its calls and before what is set
            between it and the next one.
        relative: The same for all nodes, relative to what their routine was called with; where no
            way leads, as if the program began there.
        effect: What every routine makes of the version it finds.
        set_at: (s,) places at which it is set, rising.
        set_node: (s,) the nodes before them.
        version: (s,) the versions set.
    """

    node: IntArray
    relative: list[int]
    effect: list[int]
    set_at: IntArray
    set_node: IntArray
    version: IntArray


class ControlFlow(FlowGraph):
    """The graph, and which version of each thing is in force at its places."""

    def __init__(self, mains: int = 0) -> None:
        super().__init__(mains)
        self._cut_short: Collection[int] = ()
        self._drawn = -1
        self._solved: dict[Hashable, Reaching] = {}
        self._within: dict[Hashable, Reaching] = {}
        self._looked_at = 0

    def _finish(self) -> None:
        """Ends the drawing: jumps lead to their labels."""
        if self._drawn >= 0:
            return
        self._leave()
        self._drawn = len(self._place)
        for node, routine, name in self._jumps:
            place = self._labels.get((routine, name), -1)
            if place >= 0 and node >= 0:
                self._before[place].append(node)
        self._cut_short = self._list_cut_short()
        for node, routine in enumerate(self._routine if self._cut_short else ()):
            if routine in self._cut_short:
                self._last[routine].append(node)

    # Answers

    def handlers(self) -> list[str]:
        """Returns the handlers that set a requested variable: it may differ at any place."""
        return self._setting_handlers(self._solved.values())

    def _setting_handlers(self, solved: Iterable[Reaching]) -> list[str]:
        routines = [(name, self._names[name]) for name in self._handlers & self._names.keys()]
        effects = [one.effect for one in solved]
        unchanged = (AS_FOUND, _UNREACHED)
        return sorted(n for n, r in routines if any(each[r] not in unchanged for each in effects))

    def versions(self, key: Hashable, places: IntArray) -> IntArray:
        """Returns the version (n,) in force at places (n,); ``DIFFERS`` where ways disagree."""
        if not any(one for _, one in self._sets[key]) and not self._is_set_outside(key):
            return np.zeros(len(places), np.int64)
        return np.maximum(self.marks(key, places), DIFFERS)

    def marks(self, key: Hashable, places: IntArray) -> IntArray:
        """Returns the version (n,) in force at places (n,), or a mark, see :meth:`differing`."""
        return self._look_up(self._solve_all(key), places)

    def differing(self, mark: int) -> tuple[int, str]:
        """Returns the place at which the ways of a mark join, and why they may differ there.

        The place is -1 if no way leads to where the mark is in force.
        """
        if mark > _JOINED:
            return -1, "is unknown: no path through the program leads here"
        return self._place[_JOINED - mark], self._what[_JOINED - mark]

    def mark_of(self, node: int) -> int:
        """Returns the mark of different ways to a node."""
        return _JOINED - node

    def version_within(
        self, name: Hashable, span: tuple[int, int], sets: Iterable[tuple[int, int]], place: int
    ) -> int:
        """Returns the version of a variable in force at a place; ``DIFFERS`` where paths disagree.

        Args:
            name: Of the variable; its data flow is stored under it.
            span: First place and end between which it is followed.
            sets: (place, version) pairs; read on the first query of the variable only.
            place: Of the query.

        Raises:
            NotConstantError: Too many statements were followed already.
        """
        self._finish()
        if name not in self._within:
            if self._looked_at > _MOST_STEPS:
                raise NotConstantError("the program is too long to follow its variables")
            begin, end = np.searchsorted(self._place[: self._drawn], span).tolist()
            self._looked_at += end - begin
            self._within[name] = self._solve("", sets, range(begin, end))
        return max(int(self._look_up(self._within[name], np.array([place]))[0]), DIFFERS)

    def _look_up(self, solved: Reaching, places: IntArray) -> IntArray:
        node = np.searchsorted(self._place[: self._drawn], places, side="right") - 1
        value = solved.node[node]
        if len(solved.set_at):
            last = np.searchsorted(solved.set_at, places, side="right") - 1
            is_set = (last >= 0) & (solved.set_node[last] == node)
            value = np.where(is_set, solved.version[last], value)
        return np.asarray(value)

    # Data flow

    def _solve_all(self, key: Hashable) -> Reaching:
        if key not in self._solved:
            self._finish()
            self._solved[key] = self._solve(key, self._sets[key], range(len(self._place)))
        return self._solved[key]

    def _solve(self, key: Hashable, sets: Iterable[tuple[int, int]], nodes: range) -> Reaching:
        ordered = sorted(sets, key=lambda one: one[0])
        at, version = np.array(ordered, np.int64).reshape(-1, 2).T
        set_node = np.searchsorted(self._place[: self._drawn], at, side="right") - 1
        behind: dict[int, list[int]] = defaultdict(list)
        for node, one in zip(set_node.tolist(), version.tolist(), strict=True):
            behind[node].append(one)
        flow = _DataFlow(self, key, nodes, behind)
        flow.iterate()
        return Reaching(flow.absolute(), flow.middle, flow.effect, at, set_node, version)

    # Hooks for languages

    def _list_cut_short(self) -> Collection[int]:
        """Returns the routines that may be left at any place; asked once all is drawn."""
        return range(len(self._first)) if self._resumes else ()

    def _enter(self, key: Hashable, node: int) -> list[int]:
        """Returns the routines of the program that a node may start."""
        return [self._names[name] for name in self._calls[node] if name in self._names]

    def _pass_through(self, key: Hashable, node: int) -> list[int]:
        """Returns the routines that have run after a node."""
        return self._enter(key, node)

    def _come_from(self, key: Hashable, node: int) -> list[int]:
        """Returns the nodes before a node."""
        return self._before[node]

    def _started_anywhere(self, key: Hashable) -> list[int]:
        """Returns the routines that begin with any version."""
        return [self._names[name] for name in self._handlers & self._names.keys()]

    def _is_kept(self, key: Hashable) -> bool:
        """Returns whether a thing keeps its version from run to run."""
        return False

    def _ends_program(self, key: Hashable) -> Collection[int]:
        """Returns the nodes after which the program begins again with what it keeps."""
        return ()

    def _is_set_outside(self, key: Hashable) -> bool:
        """Returns whether another program sets a thing."""
        return False

    def _is_set_before(self, key: Hashable, routine: int) -> bool:
        """Returns whether another program may call a routine after it has set a thing."""
        return False

    def _is_certain(self, key: Hashable) -> bool:
        """Returns whether a thing has version 0 wherever no way leads."""
        return False

    def _pass_node(self, key: Hashable, node: int, mark: int) -> int:
        """Returns the state after a node from the state after its calls."""
        return mark

    def _versions_behind(
        self, key: Hashable, node: int, behind: Mapping[int, list[int]]
    ) -> Sequence[int]:
        """Returns the versions set between a node and the next one."""
        return behind.get(node, ())


class _DataFlow:
    """The iteration of one thing over some nodes."""

    def __init__(
        self, flow: ControlFlow, key: Hashable, nodes: range, behind: Mapping[int, list[int]]
    ) -> None:
        self.flow, self.key, self.nodes, self.behind = flow, key, nodes, behind
        count = len(flow._place)
        self.routines = {r for r, node in enumerate(flow._first) if node in nodes}
        self.into, self.middle, self.out = ([_UNREACHED] * count for _ in range(3))
        self.effect = [_UNREACHED] * len(flow._first)

    def iterate(self) -> None:
        """Finds what holds at every node, relative to what its routine was called with."""
        flow, nodes = self.flow, self.nodes
        behind, ends, callers = (defaultdict[int, list[int]](list) for _ in range(3))
        for node in nodes:
            for one in flow._come_from(self.key, node):
                behind[one].append(node)
            for routine in flow._pass_through(self.key, node):
                callers[routine].append(node)
        for routine in self.routines:
            for node in flow._last[routine]:
                ends[node].append(routine)
        first = {flow._first[routine] for routine in self.routines}
        queue, queued = deque(nodes), set(nodes)
        while queue:
            node = queue.popleft()
            queued.discard(node)
            before = [self.out[one] for one in flow._come_from(self.key, node)]
            into = [AS_FOUND, *before] if node in first else before
            self.into[node] = _join(into, node, self.into[node])
            new = _keep_joined(self.out[node], self._through(node, self.into[node]))
            if new == self.out[node]:
                continue
            self.out[node] = new
            wake = list(behind[node])
            cut = flow._routine[node] in flow._cut_short
            left = [self.middle[node], *self._versions(node)] if cut else [new]
            for routine in ends[node]:
                total = _join([self.effect[routine], *left], node, self.effect[routine])
                if total != self.effect[routine]:
                    self.effect[routine] = total
                    wake += callers[routine]
            queue.extend(one for one in wake if one not in queued)
            queued.update(wake)

    def _through(self, node: int, mark: int) -> int:
        """Returns state and assignments after a node; stores those in between."""
        if mark == _UNREACHED:
            return mark
        for routine in self.flow._pass_through(self.key, node):
            does = self.effect[routine] if routine in self.routines else AS_FOUND
            if does <= _JOINED:
                mark = _JOINED - node
            elif does != AS_FOUND:
                mark = does
        if mark != _UNREACHED:
            mark = self.flow._pass_node(self.key, node, mark)
        self.middle[node] = mark
        return mark if mark == _UNREACHED else [mark, *self._versions(node)][-1]

    def _versions(self, node: int) -> Sequence[int]:
        return self.flow._versions_behind(self.key, node, self.behind)

    def absolute(self) -> IntArray:
        """Returns what holds in the middle of every drawn node, however its routine is called."""
        flow, entry = self.flow, self._entries()
        drawn = range(self.nodes.start, min(self.nodes.stop, flow._drawn))
        middle = np.full(flow._drawn, _UNREACHED)
        for node in drawn:
            found = entry[flow._routine[node]]
            self.out[node] = _fill(self.out[node], found)
            middle[node] = _fill(self.middle[node], found)
            if _UNREACHED in (self.out[node], middle[node]):
                middle[node] = self._light(node)
        return middle

    def _light(self, node: int) -> int:
        """Sets the state of an unreachable node, as if the program started there without settings.

        Points after a GOTO are stored for teaching; the settings of their inline forms apply to
        them. They do not reach other parts of the program.
        """
        before = self.flow._come_from(self.key, node)
        known = [self.out[one] for one in before if one < node]
        if len(known) < max(len(before), 1):
            known = [self._unsure(node)]
        self.out[node] = self._through(node, _join(known, node, _UNREACHED))
        return self.middle[node]

    def _unsure(self, node: int) -> int:
        return 0 if self.flow._is_certain(self.key) else _JOINED - node

    def _entries(self) -> list[int]:
        """Returns the entry state of each routine; version 0 for one without a caller here."""
        flow = self.flow
        calls = [
            (node, routine)
            for node in range(self.nodes.start, min(self.nodes.stop, flow._drawn))
            for routine in flow._enter(self.key, node)
            if routine in self.routines
        ]
        called = {routine for _, routine in calls}
        entry = [
            0 if routine <= flow._mains or routine not in called else _UNREACHED
            for routine in range(len(flow._first))
        ]
        started = set(flow._started_anywhere(self.key))
        ends = {self.effect[r] for r, mark in enumerate(entry) if not mark and r not in started}
        is_kept = flow._is_kept(self.key)
        roots = [routine for routine, mark in enumerate(entry) if not mark]
        for routine in roots:
            if is_kept and ends - {AS_FOUND, _UNREACHED, 0}:
                entry[routine] = self._any_version(routine)
            elif flow._is_set_before(self.key, routine):
                entry[routine] = self._any_version(routine)
        for routine in started:
            entry[routine] = self._unsure(flow._first[routine])
        self._hand_down(entry, calls)
        last = {_fill(self.out[n], entry[flow._routine[n]]) for n in flow._ends_program(self.key)}
        if is_kept and last - {_UNREACHED, 0}:
            for routine in set(roots) - started:
                entry[routine] = self._any_version(routine)
            self._hand_down(entry, calls)
        return entry

    def _any_version(self, routine: int) -> int:
        return _JOINED - self.flow._first[routine]

    def _hand_down(self, entry: list[int], calls: list[tuple[int, int]]) -> None:
        """Joins, in place, what routines begin with where they are called."""
        flow, changed = self.flow, True
        while changed:
            changed = False
            for node, routine in calls:
                caller = entry[flow._routine[node]]
                if caller == _UNREACHED:
                    continue
                here = _fill(self.into[node], caller)
                total = _join([entry[routine], here], flow._first[routine], entry[routine])
                changed |= total != entry[routine]
                entry[routine] = total


def _join(marks: list[int], node: int, old: int) -> int:
    """Returns what holds whichever of the ways was taken."""
    reached = {mark for mark in marks if mark != _UNREACHED}
    if not reached:
        return old
    return _keep_joined(old, reached.pop() if len(reached) == 1 else _JOINED - node)


def _keep_joined(old: int, new: int) -> int:
    """Returns ``new``, but a difference once seen stays: the iteration ends."""
    return old if old <= _JOINED else new


def _fill(mark: int, entry: int) -> int:
    """Returns a mark relative to a routine's entry as it is for this entry."""
    return entry if mark == AS_FOUND else mark
