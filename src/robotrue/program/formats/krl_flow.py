"""Which frames are in force at each line, over every way a KRL program can take.

The walk draws a graph: a node wherever a frame is set, a way divides or joins, or a subprogram is
called. What holds at a node is then what holds on every way to it (forward data flow, iterated to
its fixed point); where two ways bring different frames the value says so and the targets after it
are not compensated. A subprogram is summed up as what it does to the frames it finds.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from robotrue.program.formats.krl_builtin import HARMLESS

BASE: Final = 0
TOOL: Final = 1
ON_ROBOT: Final = 2
PENDING: Final = 3
"""FDAT_ACT: what an inline form hands to the next BAS call; 0 is nothing."""
FOREIGN_BASE: Final = 4
FOREIGN_TOOL: Final = 5
"""One-based line of a call that leaves the files of this program, since the frame was set; or 0."""

Value = tuple[int, ...]
"""One number per column above: what is set there (>= 0), or one of the marks below."""
UNREACHED: Final = -1
AS_FOUND: Final = -2
"""What held where the routine was called."""
_DIFFERS: Final = -3
"""``-3 - node``: different ways join at this node."""
_COLUMNS: Final = 6
_FOUND: Final[Value] = (AS_FOUND,) * _COLUMNS
_NOWHERE: Final[Value] = (UNREACHED,) * _COLUMNS
_START: Final[Value] = (0,) * _COLUMNS


class Ways(NamedTuple):
    """The solved graph, one entry per node in the order of lines.

    Attributes:
        line: Zero-based line from which the value holds; behind them those of copied routines.
        value: What holds.
        what: What to say of a node at which ways differ.
        handlers: Interrupt and trigger routines that change frames, so that they may change
            anywhere.
        foreign: Routines called that are in no file, by the one-based line of the call.
        lost: Interrupt routines that are in no file.
    """

    line: list[int]
    value: list[Value]
    what: list[str]
    handlers: list[str]
    foreign: dict[int, tuple[str, ...]]
    lost: list[str]


def differing(mark: int) -> int:
    """Returns the node whose ways differ, -1 if the line is never reached."""
    return _DIFFERS - mark if mark <= _DIFFERS else -1


_DARK: Final = "is not known here: no way through the program leads here"


class Flow:
    """The graph while it is drawn, line by line.

    Args:
        harmless: Routines, in lower case, that leave frames alone wherever they stand.
    """

    def __init__(self, harmless: Iterable[str] = ()) -> None:
        self._harmless = HARMLESS.union(harmless)
        self._line: list[int] = []
        self._what: list[str] = []
        self._before: list[list[int]] = []
        self._sets: list[tuple[tuple[int, int], ...]] = []
        self._takes: list[bool] = []
        self._calls: list[tuple[str, ...]] = []
        self._routine: list[int] = []
        self._at = -1
        self._names: dict[str, int] = {}
        self._first: list[int] = []
        self._last: list[list[int]] = []
        self._branches: list[tuple[int, list[int], bool, bool]] = []
        self._loops: list[tuple[int, list[int]]] = []
        self._saved: list[int] = []
        self._labels: dict[tuple[int, str], int] = {}
        self._jumps: list[tuple[int, int, str]] = []
        self._handlers: set[str] = set()
        self._triggers: set[int] = set()
        self._resumes = False
        self._drawn = -1
        self._instead: dict[tuple[int, str], int] = {}
        self.copied = -1
        self.pending: list[tuple[int, int, int]] = [(0, 0, 0)]
        self.start(0, "")

    def _add(self, line: int, before: Iterable[int], what: str = "") -> int:
        self._line.append(line)
        self._what.append(what or "depends on which branch ran")
        self._before.append([node for node in before if node >= 0])
        self._sets.append(())
        self._takes.append(False)
        self._calls.append(())
        self._routine.append(len(self._first) - 1)
        self._at = len(self._line) - 1
        return self._at

    def start(self, line: int, name: str) -> None:
        """Begins a routine; the one before ends here."""
        self.leave()
        self._first.append(len(self._line))
        self._last.append([])
        self._names[name] = len(self._first) - 1
        self._branches, self._loops, self._saved = [], [], []
        self._add(line, (), "differs between the calls of this subprogram")

    def set(self, line: int, *values: tuple[int, int]) -> None:
        """Puts (column, value) pairs in force from a line on."""
        node = self._add(line, [self._at])
        self._sets[node] = values

    def pend(self, line: int, base: int, tool: int, on_robot: bool) -> None:
        """Remembers what FDAT_ACT hands over."""
        self.pending.append((base, tool, int(on_robot)))
        self.set(line, (PENDING, len(self.pending) - 1))

    def take_pending(self, line: int) -> None:
        """Puts FDAT_ACT in force: ``BAS(#FRAMES)``, ``BAS(#PTP_PARAMS)``, ``BAS(#CP_PARAMS)``."""
        node = self._add(line, [self._at], "comes from an FDAT_ACT that depends on the way here")
        self._takes[node] = True

    def call(self, line: int, names: Iterable[str]) -> int:
        """Passes through other routines, of this file or not; returns the node, -1 if none."""
        names = tuple(name for name in names if not self.is_harmless(name))
        if not names:
            return -1
        node = self._add(line, [self._at], "depends on the way a called subprogram took")
        self._calls[node] = names
        return node

    def is_harmless(self, name: str) -> bool:
        """Returns whether a routine leaves frames alone wherever it stands."""
        return name.partition("@")[0] in self._harmless

    def rename(self, frames: Mapping[tuple[int, int], int]) -> None:
        """Gives frames their indices: from column and index that stood for one."""
        for node, sets in enumerate(self._sets):
            if sets:
                self._sets[node] = tuple((c, frames.get((c, index), index)) for c, index in sets)

    def calls_of(self, name: str) -> list[int]:
        """Returns the nodes of a routine that call others."""
        routine = self._names.get(name, -1)
        return [n for n, of in enumerate(self._routine) if of == routine and self._calls[n]]

    def copy_routine(self, name: str, frames: Mapping[tuple[int, int], int]) -> dict[int, int]:
        """Enters a copy of a routine for one call, with other frames; returns its nodes by node.

        The copy is :attr:`copied`; nothing is moved to within it.
        """
        if self._drawn < 0:
            self.leave()
            self._drawn = len(self._line)
        routine = self._names[name]
        nodes = [node for node, of in enumerate(self._routine) if of == routine]
        new = {node: len(self._line) + k for k, node in enumerate(nodes)}
        self.copied = len(self._first)
        self._first.append(new[self._first[routine]])
        self._last.append([new[node] for node in self._last[routine] if node in new])
        for node in nodes:
            self._line.append(self._line[node])
            self._what.append(self._what[node])
            self._before.append([new[each] for each in self._before[node] if each in new])
            sets = self._sets[node]
            self._sets.append(tuple((c, frames.get((c, index), index)) for c, index in sets))
            self._takes.append(self._takes[node])
            self._calls.append(self._calls[node])
            self._routine.append(self.copied)
        self._jumps += [
            (new[at], self.copied, to) for at, of, to in self._jumps if of == routine and at in new
        ]
        for (of, label), node in list(self._labels.items()):
            if of == routine:
                self._labels[self.copied, label] = new[node]
        return new

    def lead(self, node: int, name: str, copy: int) -> None:
        """Makes a call of a routine one of a copy of it."""
        self._instead[node, name] = copy

    def handler(self, name: str) -> None:
        """Names a routine that an interrupt or trigger may start at any line."""
        self._handlers.add(name)

    def trigger(self, line: int, names: Iterable[str]) -> None:
        """Passes a trigger: a routine in no file may run from here on, as if it were called."""
        before = len(self._line)
        self.call(line, names)
        self._triggers.update(range(before, len(self._line)))

    def resume(self) -> None:
        """The program has RESUME: a routine may be left at any line."""
        self._resumes = True

    def branch(self, line: int, *, opens: bool) -> None:
        """IF (which opens its first alternative at once) and SWITCH."""
        self._branches.append((self._add(line, [self._at]), [], False, opens))

    def alternative(self, line: int, *, other: bool) -> None:
        """ELSE and DEFAULT (``other``: taken if nothing else is), CASE."""
        if self._branches:
            entry, ends, had, started = self._branches.pop()
            if started:
                ends.append(self._at)
            self._branches.append((entry, ends, had or other, True))
            self._add(line, [entry])

    @property
    def in_branch(self) -> bool:
        """Returns whether the line being read runs on one of several ways."""
        return bool(self._branches)

    def join(self, line: int) -> None:
        """ENDIF and ENDSWITCH."""
        if self._branches:
            entry, ends, other, _ = self._branches.pop()
            self._add(line, [*ends, self._at, *([] if other else [entry])])

    def loop(self, line: int) -> None:
        """FOR, WHILE, LOOP, REPEAT."""
        head = self._add(line, [self._at], "differs between the first and later turns of a loop")
        self._loops.append((head, []))

    def close_loop(self, line: int) -> None:
        """ENDFOR, ENDWHILE, ENDLOOP, UNTIL: back to the head, or on; an interrupt leaves any."""
        if self._loops:
            head, exits = self._loops.pop()
            if self._at >= 0:
                self._before[head].append(self._at)
            what = "depends on how often the loop before it has run"
            self._add(line, [head, self._at, *exits], what)

    def exit_loop(self, line: int) -> None:
        """EXIT."""
        if self._loops:
            self._loops[-1][1].append(self._at)
            self._add(line, (), _DARK)

    def label(self, line: int, name: str) -> None:
        """A place GOTO leads to."""
        node = self._add(line, [self._at], "differs between the ways that lead to this label")
        self._labels[len(self._first) - 1, name] = node

    def jump(self, line: int, name: str) -> None:
        """GOTO."""
        self._jumps.append((self._at, len(self._first) - 1, name))
        self._add(line, (), _DARK)

    def leave(self, line: int = -1) -> None:
        """RETURN, or the end of a routine."""
        if self._last:
            self._last[-1].append(self._at)
        if line >= 0:
            self._add(line, (), _DARK)

    def save(self) -> None:
        """Remembers what holds here, for :meth:`restore`."""
        self._saved.append(self._at)

    def restore(self, line: int) -> None:
        """Puts back in force what held at the last :meth:`save`."""
        if self._saved:
            self._add(line, [self._saved.pop()])

    def solve(self) -> Ways:
        """Returns what holds at every node."""
        if self._drawn < 0:
            self.leave()
            self._drawn = len(self._line)
        for node, routine, name in self._jumps:
            place = self._labels.get((routine, name), -1)
            if place >= 0 and node >= 0:
                self._before[place].append(node)
        if self._resumes:
            for node, routine in enumerate(self._routine):
                self._last[routine].append(node)
        inside, found, effect = self._within_routines()
        entries = self._entries(found)
        value = [
            _fill_entry(each, entries[routine])
            for each, routine in zip(inside, self._routine, strict=True)
        ]
        if any(each[BASE] == UNREACHED for each in value):
            self._light(value, effect)
        changing = [
            name
            for name in sorted(self._handlers & self._names.keys())
            if set(effect[self._names[name]][: ON_ROBOT + 1]) - {AS_FOUND, UNREACHED}
        ]
        drawn = self._drawn
        return Ways(
            self._line, value[:drawn], self._what, changing, self._foreign(), self._find_lost()
        )

    def _foreign(self) -> dict[int, tuple[str, ...]]:
        """Returns the routines in no file that each one-based line calls."""
        out = {}
        for line, names in zip(self._line, self._calls, strict=True):
            absent = tuple(name for name in names if name not in self._names)
            if absent:
                out[line + 1] = absent
        return out

    def _find_lost(self) -> list[str]:
        """Returns the routines in no file that interrupts start."""
        called = {name for names in self._calls for name in names}
        return sorted(self._handlers - self._names.keys() - self._harmless - called)

    def _light(self, value: list[Value], effect: list[Value]) -> None:
        """Says what holds where no way leads, as if the program began there knowing nothing.

        Points are kept behind a GOTO to be taught; what their inline forms set holds for them. It
        does not reach the rest of the program.
        """
        on_robot = self._any_on_robot()
        for node, before in enumerate(self._before):
            if value[node][BASE] != UNREACHED:
                continue
            known = [value[each] for each in before if each < node]
            if len(known) < max(len(before), 1):
                unsure = _DIFFERS - node
                known = [(unsure, unsure, unsure if on_robot else 0, unsure, 0, 0)]
            value[node] = self._through(node, _join_values(known, node, _NOWHERE), effect)

    def _within_routines(self) -> tuple[list[Value], list[Value], list[Value]]:
        """Returns (after, before) every node, relative to what its routine was called with.

        The third list is what every routine does to what it was called with.
        """
        after: list[list[int]] = [[] for _ in self._line]
        for node, before in enumerate(self._before):
            for each in before:
                after[each].append(node)
        ends = defaultdict(list)
        for routine, nodes in enumerate(self._last):
            for node in nodes:
                ends[node].append(routine)
        callers = defaultdict(list)
        for node, names in enumerate(self._calls):
            for name in names:
                if name in self._names:
                    callers[self._callee(node, name)].append(node)
        out, into = [_NOWHERE] * len(self._line), [_NOWHERE] * len(self._line)
        effect = [_NOWHERE] * len(self._first)
        first = set(self._first)
        queue, queued = deque(range(len(self._line))), [True] * len(self._line)
        while queue:
            node = queue.popleft()
            queued[node] = False
            before = self._before[node]
            new = _join_values([out[each] for each in before], node, into[node])
            if node in first:
                new = _join_values([_FOUND, *[out[each] for each in before]], node, into[node])
            into[node] = new
            new = _keep_differences(out[node], self._through(node, new, effect))
            if new == out[node]:
                continue
            out[node] = new
            wake = list(after[node])
            for routine in ends.get(node, ()):
                total = _join_values([effect[routine], new], node, effect[routine])
                if total != effect[routine]:
                    effect[routine] = total
                    wake += callers[routine]
            for each in wake:
                if not queued[each]:
                    queued[each] = True
                    queue.append(each)
        return out, into, effect

    def _through(self, node: int, value: Value, effect: list[Value]) -> Value:
        """Returns what holds after a node from what holds before it."""
        if value[BASE] == UNREACHED:
            return value
        new = list(value)
        for column, index in self._sets[node]:
            new[column] = index
            if column <= TOOL:
                new[FOREIGN_BASE + column] = 0
        if self._takes[node]:
            self._take(node, new)
        for name in self._calls[node]:
            routine = self._callee(node, name)
            if routine < 0:
                new[FOREIGN_BASE] = new[FOREIGN_TOOL] = self._line[node] + 1
                continue
            if node in self._triggers:
                continue
            for column, does in enumerate(effect[routine]):
                if does <= _DIFFERS:
                    new[column] = _DIFFERS - node
                elif does != AS_FOUND:
                    new[column] = does
        return tuple(new)

    def _callee(self, node: int, name: str) -> int:
        """Returns the routine, or the copy of it, that a node calls; -1 if it is in no file."""
        return self._instead.get((node, name), self._names.get(name, -1))

    def _take(self, node: int, new: list[int]) -> None:
        pending = new[PENDING]
        if pending == AS_FOUND and self._routine[node] <= 1:
            return  # nothing was handed over since the program began
        columns = (BASE, TOOL, ON_ROBOT)
        if pending < 0:
            for column in columns:
                new[column] = _DIFFERS - node
        elif pending > 0:
            for column, index in zip(columns, self.pending[pending], strict=True):
                new[column] = index
            new[FOREIGN_BASE] = new[FOREIGN_TOOL] = 0

    def _any_on_robot(self) -> bool:
        return any(on_robot for _, _, on_robot in self.pending) or any(
            column == ON_ROBOT and value for sets in self._sets for column, value in sets
        )

    def _entries(self, found: list[Value]) -> list[Value]:
        """Returns what each routine is entered with; one that nothing here calls, the defaults."""
        calls = [
            (node, self._names[name])
            for node, names in enumerate(self._calls[: self._drawn])
            for name in names
            if name in self._names
        ]
        called = {routine for _, routine in calls}
        handlers = {self._names[name] for name in self._handlers if name in self._names}
        entry = [
            _START if routine <= 1 or routine not in called else _NOWHERE
            for routine in range(len(self._first))
        ]
        for routine in handlers:
            unsure = _DIFFERS - self._first[routine]
            entry[routine] = (unsure, unsure, unsure if self._any_on_robot() else 0, unsure, 0, 0)
        changed = True
        while changed:
            changed = False
            for node, routine in calls:
                here = _fill_entry(found[node], entry[self._routine[node]])
                total = _join_values([entry[routine], here], self._first[routine], entry[routine])
                changed |= total != entry[routine]
                entry[routine] = total
        return entry


def _join_values(values: list[Value], node: int, old: Value) -> Value:
    """Returns what holds whichever of the ways was taken."""
    reached = [value for value in values if value[BASE] != UNREACHED]
    if not reached:
        return old
    if len(reached) == 1:
        return _keep_differences(old, reached[0])
    return _keep_differences(
        old,
        tuple(
            column[0] if len(set(column)) == 1 else _DIFFERS - node
            for column in zip(*reached, strict=True)
        ),
    )


def _keep_differences(old: Value, new: Value) -> Value:
    """Returns ``new``, but a difference once seen stays: the iteration ends."""
    if min(old) > _DIFFERS:
        return new
    return tuple(o if o <= _DIFFERS else n for o, n in zip(old, new, strict=True))


def _fill_entry(value: Value, entry: Value) -> Value:
    """Returns a value relative to a routine's entry as it is for this entry."""
    if AS_FOUND not in value:
        return value
    if entry[BASE] == UNREACHED:
        return _NOWHERE
    return tuple(e if v == AS_FOUND else v for v, e in zip(value, entry, strict=True))
