"""What the code of a VAL3 application does with its data.

Which points its motions go to with which tools, and what other statements do with points, frames
and tools: a point whose value is read anywhere cannot be moved, a frame may be read.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Final, NamedTuple

from robotrue.program.formats.text_lines import split_outside
from robotrue.program.formats.val3_calls import CallTree, Reference, Step, Val3Call, Val3Move
from robotrue.program.formats.val3_files import Val3Routine
from robotrue.program.program import Motion

_NAME: Final = r"[A-Za-z_]\w*+(?::[A-Za-z_]\w*+)?+"
_REF: Final = rf"\s*+({_NAME})\s*+(?:\[((?:[^\[\]\n]|\[[^\[\]\n]*+\])*+)\])?+\s*+"
_MOVE: Final = re.compile(
    rf"\b(?:move([jl])\s*+\(|movec\s*+\({_REF},){_REF},{_REF},[^()\n]*+\)", re.ASCII
)
_COMPUTED: Final = re.compile(r"\bmove([jlc])\s*+\(", re.ASCII)
_INSIDE: Final = r"(?:[^()\n]|\((?:[^()\n]|\([^()\n]*+\))*+\)){0,2000}"
_CALL: Final = re.compile(
    rf"\bcall\s++({_NAME})|\btaskCreate(?:Sync)?+\b{_INSIDE},\s*+({_NAME})\s*+\("
)
_CALLED: Final = re.compile(
    rf"^[ \t]*+call\s++({_NAME})\s*+\(({_INSIDE})\)[ \t\r]*+$", re.ASCII | re.MULTILINE
)
_PLAIN: Final = re.compile(_REF, re.ASCII)
_WORD: Final = re.compile(rf"(\.\s*+[A-Za-z_]\w*+)|({_NAME})|([()\[\]])|[^\w\s()\[\].]++", re.ASCII)
_ASSIGNED: Final = re.compile(rf"{_REF}(\.[^=\n]{{0,200}}+)?+=(?!=)", re.ASCII)
_COPIED: Final = re.compile(rf"{_REF}$", re.ASCII)
_ZERO: Final = r",\s*+[-+]?+0*+(?:\.0*+)?+\s*+"
_UNTURNED: Final = re.compile(rf"\([^{{}}()]*+\{{[^{{}}]*?{_ZERO}{_ZERO}{_ZERO}\}}\s*+\)", re.ASCII)
"""Arguments of ``compose`` whose transformation only shifts."""
_MOVES: Final = frozenset({"movej", "movel", "movec"})
_SHIFTS: Final = frozenset({"appro", "compose"})
_READERS: Final = frozenset({"position", "jointToPoint", "pointToJoint", "distance", *_SHIFTS})
"""Functions that read values, and change neither points nor frames nor tools."""
_UNREAD: Final = frozenset({"open", "close", "here", "size", "isDefined"})
"""Functions that read no value of a point."""
_KEYWORDS: Final = frozenset("if elseif while until switch case to step and or not return".split())
_MOTIONS: Final = {"j": Motion.PTP, "l": Motion.LIN, "c": Motion.ARC_END}


@dataclass(slots=True)
class CodeUse:
    """What the code of an application does with its data.

    Attributes:
        moves: Motions in the order of the text.
        touched: Names that get other values, or whose values are read.
        changed: Names that may get other values: what matters for frames and tools.
        computed: Names in motions to a target that is computed.
        followed: Names from which targets are computed by a shift, or copied.
        calls: Routines that are called, and where first (file, line).
    """

    moves: list[Val3Move] = field(default_factory=list)
    touched: set[str] = field(default_factory=set)
    changed: set[str] = field(default_factory=set)
    computed: set[str] = field(default_factory=set)
    followed: set[str] = field(default_factory=set)
    calls: dict[str, tuple[int, int]] = field(default_factory=dict)


def read_code(routines: list[Val3Routine], *, shared: bool = False) -> CodeUse:
    """Returns what the routines of an application do with its data.

    Args:
        routines: Of all its files.
        shared: The data of a library are among those of the job, so that ``lib:p`` may be ``p``.
    """
    use, tree = CodeUse(), CallTree.of(routines)
    names = _Names(use, shared)
    for routine in routines:
        _read_routine(routine, use, names, tree)
    use.moves, endless = tree.list_moves()
    for move in use.moves:
        names.qualify(move)
    names.finish(endless)
    return use


def _read_routine(routine: Val3Routine, use: CodeUse, names: _Names, tree: CallTree) -> None:
    moves, places, rest = _cut_moves(routine)
    for match, line in _find_lines(_CALL, rest, routine.line):
        use.calls.setdefault(match[1] or match[2], (routine.file, line))
        tree.started[match[1] or match[2]] += 1
    others: list[tuple[int, Step]] = [
        (match.start(), Val3Move(_MOTIONS[match[1]], None, None, None, routine.file, line))
        for match, line in _find_lines(_COMPUTED, rest, routine.line)
    ]
    pieces, last = list[str](), 0
    for match, line in _find_lines(_CALLED, rest, routine.line):
        called = tree.routines.get(match[1])
        arguments = split_outside(match[2], ",") if match[2].strip() else []
        if called is not None and len(called.parameters) == len(arguments):
            given = names.pass_on(routine, called, arguments)
            others.append((match.start(), Val3Call(called.number, given, routine.file, line)))
            pieces.append(rest[last : match.start()])
            last = match.end()
    steps: list[tuple[int, Step]] = [*zip(places, moves, strict=True), *others]
    tree.steps[routine.number] += [step for _, step in sorted(steps, key=itemgetter(0))]
    names.take(routine, "".join([*pieces, rest[last:]]))


def _cut_moves(routine: Val3Routine) -> tuple[list[Val3Move], list[int], str]:
    """Returns the plain motions, the code without them, and the place in it after each."""
    code, moves, places, size, last = routine.code, [], [], 0, 0
    pieces: list[str] = []
    tools: dict[tuple[str, str | None], Reference | None] = {}
    for match, line in _find_lines(_MOVE, code, routine.line):
        how, via, via_key, target, key, tool, tool_key = match.groups()
        if routine.parameters and any(
            name in routine.parameters and (index or "0").strip() != "0"
            for name, index in ((via, via_key), (target, key), (tool, tool_key))
        ):
            continue  # an element of what is given
        named = tool, tool_key
        if named not in tools:
            tools[named] = _refer(routine, tool, tool_key)
        moves.append(
            Val3Move(
                _MOTIONS[how or "c"],
                _refer(routine, via, via_key) if via else None,
                _refer(routine, target, key),
                tools[named],
                routine.file,
                line,
            )
        )
        start, end = match.span()
        blank = "\n" * code.count("\n", start, end) or " "
        pieces += code[last:start], blank
        size += start - last + len(blank)
        places.append(size)
        last = end
    return moves, places, "".join([*pieces, code[last:]])


def _find_lines(
    pattern: re.Pattern[str], text: str, line: int
) -> Iterator[tuple[re.Match[str], int]]:
    """Yields the matches in a text that begins in a line, with the line each begins in."""
    last = 0
    for match in pattern.finditer(text):
        line += text.count("\n", last, match.start())
        last = match.start()
        yield match, line


def _refer(routine: Val3Routine, name: str, key: str | None) -> Reference | None:
    """The variable of the job or parameter that a name means; None for a local variable."""
    if name in routine.own:
        return Reference(routine.spell(name), "0") if name in routine.parameters else None
    text = "0" if key is None else key.strip()
    plain = text.isascii() and text.isdecimal()
    return Reference(name, (text.lstrip("0") or "0") if plain else None)


class _Brackets(NamedTuple):
    """Of which functions the brackets around a name are, of those that belong to any.

    Attributes:
        outer: The outermost.
        inner: The innermost.
        shifted: All but the outermost shift points.
        nested: There are several.
    """

    outer: str = ""
    inner: str = ""
    shifted: bool = True
    nested: bool = False

    def open(self, function: str) -> _Brackets:
        """Returns the brackets with those of a function in them, or of none."""
        if not function:
            return self
        if not self.outer:
            return _Brackets(function, function)
        return _Brackets(self.outer, function, self.shifted and function in _SHIFTS, True)


_OUTSIDE: Final = _Brackets()
_COPY: Final = _Brackets("appro", "appro")
"""A copy of a point is a shift by nothing."""


class _Names:
    """Notes what statements other than plain motions do with names, routine by routine.

    A name of a routine's own is spelled with its place in the job, to be another in each routine.
    """

    def __init__(self, use: CodeUse, shared: bool) -> None:
        self._use, self._shared = use, shared
        self._read: set[str] = set()
        self._assigned: set[str] = set()
        self._sources: dict[str, set[str]] = defaultdict(set)  # by the point shifted from them
        self._passed: dict[str, set[str]] = defaultdict(set)  # arguments by the parameter

    def qualify(self, move: Val3Move) -> None:
        """Notes the points of a library that a motion goes to."""
        for point in (move.via, move.target):
            if point is not None and ":" in point.name and self._shared:
                self._use.computed.add(point.name.partition(":")[2])

    def take(self, routine: Val3Routine, code: str) -> None:
        """Notes the names in the code of a routine without its plain motions."""
        brackets = [_OUTSIDE]
        for text in code.split("\n"):
            self._take_line(routine, text, brackets, "")

    def pass_on(
        self, routine: Val3Routine, called: Val3Routine, arguments: Sequence[str]
    ) -> dict[str, Reference | None]:
        """Notes the arguments of a call in a routine; returns them by the parameter."""
        given: dict[str, Reference | None] = {}
        for name, text in zip(called.parameters, arguments, strict=True):
            parameter, plain = called.spell(name), _PLAIN.fullmatch(text)
            if plain:
                given[parameter] = _refer(routine, plain[1], plain[2])
                self._passed[parameter].update(self._spell(routine, plain[1]))
            else:
                given[parameter] = None
                self._take_line(routine, text, [_OUTSIDE], parameter)
        return given

    def _take_line(
        self, routine: Val3Routine, text: str, brackets: list[_Brackets], target: str
    ) -> None:
        """Notes the names in a line, or in a value that is assigned to a variable."""
        before = ""
        for match in _WORD.finditer(text):
            member, name, bracket = match.groups()
            if bracket == "(":
                brackets.append(brackets[-1].open(_find_function(before, text, match.start())))
            elif bracket == "[":
                brackets.append(brackets[-1])
            elif bracket and len(brackets) > 1:
                brackets.pop()
            elif name:
                inside, place = brackets[-1], match.start()
                assigned = _ASSIGNED.match(text, place) if len(brackets) == 1 else None
                if assigned is not None:
                    target = self._assign(routine, name, whole=not assigned[3])
                else:
                    if inside is _OUTSIDE and target and _COPIED.match(text, place):
                        inside = _COPY
                    self._note(self._spell(routine, name), inside, target)
            before = name or member or ""

    def _spell(self, routine: Val3Routine, name: str) -> list[str]:
        """The variables of the job that a name may mean."""
        if name in routine.own:
            return [routine.spell(name)]
        return [name, name.partition(":")[2]] if self._shared and ":" in name else [name]

    def _assign(self, routine: Val3Routine, name: str, *, whole: bool) -> str:
        """Notes an assignment; returns the variable if no code elsewhere may read it unseen."""
        names = self._spell(routine, name)
        self._use.changed.update(names)
        self._assigned.update(names)
        if not whole:
            self._read.update(names)
        return "" if not whole or name in routine.given or ":" in name else names[0]

    def _note(self, names: list[str], inside: _Brackets, target: str) -> None:
        """Notes names in brackets, and what is assigned in their line."""
        if inside.inner in _UNREAD:
            return
        if inside.outer in _MOVES and inside.shifted:
            (self._use.followed if inside.nested else self._use.computed).update(names)
        elif inside.outer in _SHIFTS and target and inside.shifted:
            self._sources[target].update(names)
        else:
            self._read.update(names)
            if inside.inner and inside.inner not in _READERS:
                self._use.changed.update(names)

    def finish(self, endless: Sequence[Val3Call]) -> None:
        """Takes a point as read, too, if one shifted from it is, and arguments as parameters.

        Args:
            endless: Calls whose motions are not known.
        """
        use, passed = self._use, self._passed
        self._read.update(name for call in endless for name in call.arguments)
        _spread(self._read, {
            name: self._sources.get(name, set()) | passed.get(name, set())
            for name in (*self._sources, *passed)
        })  # fmt: skip
        use.followed.update(*(self._sources[name] for name in self._sources.keys() - self._read))
        for held in (self._assigned, use.changed, use.computed, use.followed):
            _spread(held, passed)
        use.touched |= self._read | self._assigned


def _spread(held: set[str], links: Mapping[str, set[str]]) -> None:
    """Adds to some names those they lead to."""
    due = [name for name in links if name in held]
    while due:
        fresh = links[due.pop()] - held
        held |= fresh
        due += [name for name in fresh if name in links]


def _find_function(before: str, text: str, place: int) -> str:
    """The function whose brackets open at a place behind a word, empty if it is none."""
    if before == "compose" and not _UNTURNED.match(text, place):
        return "position"  # what turns a point turns its correction, so that it counts as read
    return "" if before.lower() in _KEYWORDS else before
