"""The value of every RAPID variable at every statement: reaching definitions over a module.

Data that nothing in the task changes have the value of their declaration. What the module itself
changes has the value of the one assignment that reaches a statement on every way to it; its
declaration then does not count, because modules keep their values from run to run. Variables of a
routine start with their declared value.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from robotrue.program.formats.control_flow import DIFFERS, ControlFlow
from robotrue.program.formats.expression import NotConstantError
from robotrue.program.formats.rapid_expression import (
    MEMBERS,
    PURE,
    RapidValue,
    evaluate_rapid,
)
from robotrue.program.formats.rapid_moves import READING, behind_condition, move_of

KINDS: Final = frozenset(
    "num dnum pos orient pose robtarget jointtarget confdata extjoint robjoint".split()
)
"""Types whose data are followed."""
_DEEPEST: Final = 12
_LAST: Final = 1 << 60
_TEXT: Final = re.compile(r'"(?:[^"\r\n]|"")*"|![^\r\n]*')
_DECLARED: Final = re.compile(
    r"(?:\b(LOCAL|TASK)\s++)?+\b(?:CONST|PERS|VAR)\s++(\w++)\s++(\w++)\s*+(\{[^}]*+\})?+\s*+"
    r"(?::=([^;]*+))?+;",
    re.IGNORECASE,
)
_ROUTINE: Final = re.compile(r"\b(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)
_CHANGED: Final = re.compile(r"(?<![\w.\\])(\w++)\s*+(?:\{[^{}]*+\}\s*+)?+(?:\.\s*+\w++\s*+)*+:=")
_HEADS: Final = re.compile(
    r"^[ \t]*+(?:LOCAL[ \t]++)?+(?:MODULE|PROC|FUNC|TRAP)\b[^\n]*+"
    r"|\b(?:IF|ELSEIF|WHILE|FOR)\b[^;]{0,500}?\b(?:THEN|DO)\b|\b(?:ELSE|ERROR|UNDO|END\w++)\b"
    r"|\b(?:CASE\b[^;:]{0,500}+|DEFAULT\s*+):",
    re.IGNORECASE | re.MULTILINE,
)
"""What a statement may follow without a semicolon."""
_CALLED: Final = re.compile(r"(?:^|;)[ \t]*+([A-Za-z_]\w*+)\s++([^;:]*+);", re.MULTILINE)
_HANDED: Final = re.compile(r"\b(\w++)\s*+\(([^()]*+)\)")
_NAME: Final = re.compile(r"[A-Za-z_\x80-\xff][\w\x80-\xff]*")


class RapidModule(NamedTuple):
    """Data in the text of a module.

    Attributes:
        name: Of the file.
        given: Value, and whether it is LOCAL, by name in lower case.
        changed: Names it changes, or passes to what may change them.
        words: All names in it, without those of the data it declares.
    """

    name: str
    given: dict[str, tuple[str, bool]]
    changed: frozenset[str]
    words: frozenset[str]


def read_module(name: str, data: bytes) -> RapidModule:
    """Returns the data of a module, without following its routines."""
    text = _TEXT.sub("", data.decode("latin-1"))
    given: dict[str, tuple[str, bool]] = {}
    twice = set()
    for match in _DECLARED.finditer(text):
        variable = match[3].lower()
        twice |= {variable} & given.keys()
        if match[2].lower() in KINDS and match[5] is not None:
            given[variable] = match[5], (match[1] or "").upper() == "LOCAL"
    plain = _DECLARED.sub(";", text)
    changed = {match[1].lower() for match in _CHANGED.finditer(plain)}
    for match in _CALLED.finditer(_HEADS.sub(";", plain)):
        word = match[1].lower()
        word = behind_condition(match[2].lower()) if word == "if" else word
        if move_of(word) is None and word not in READING:
            changed.update(each.lower() for each in _NAME.findall(match[2]))
    for match in _HANDED.finditer(plain):
        if match[1].lower() not in PURE:
            changed.update(each.lower() for each in _NAME.findall(match[2]))
    head = _ROUTINE.split(text, maxsplit=1)[0]
    own = {match[3].lower() for match in _DECLARED.finditer(head)}
    words = frozenset(each.lower() for each in _NAME.findall(text)) - own
    return RapidModule(name, given, frozenset(changed | twice), words)


@dataclass(slots=True)
class RapidTask:
    """The modules of a job.

    Attributes:
        modules: In the order of the job.
        changes: By name, how many modules change it.
    """

    modules: Sequence[RapidModule] = ()
    changes: dict[str, list[str]] = field(default_factory=dict)
    _given: dict[str, list[RapidModule]] = field(default_factory=dict)
    _readers: dict[str, str] = field(default_factory=dict)
    """The module that names a variable of others; empty if several do."""

    @classmethod
    def of(cls, files: Iterable[tuple[str, bytes]]) -> RapidTask:
        """Returns the task of some files."""
        out = cls([read_module(name, data) for name, data in files])
        for module in out.modules:
            for name in module.given:
                out._given.setdefault(name, []).append(module)
            for name in module.words:
                out._readers[name] = "" if name in out._readers else module.name
            for name in module.changed:
                out.changes.setdefault(name, []).append(module.name)
        return out

    def is_changed_outside(self, name: str, module: str) -> bool:
        """Returns whether another module than this changes a name."""
        return any(each != module for each in self.changes.get(name, ()))

    def is_given(self, name: str) -> bool:
        """Returns whether a module gives a name a value."""
        return name in self._given

    def is_read_outside(self, name: str, module: str) -> bool:
        """Returns whether another module than this names a variable."""
        return self._readers.get(name, module) != module

    def value(self, name: str, asking: str, depth: int = 0) -> RapidValue:
        """Returns the value of data that another module declares.

        Args:
            name: In lower case.
            asking: The module that names it.
            depth: Of declarations followed already.

        Raises:
            NotConstantError: It has none, or not one alone.
        """
        if depth > _DEEPEST:
            raise NotConstantError(f"{name!r} depends on too many others")
        found = [
            module
            for module in self._given.get(name, ())
            if module.name == asking or not module.given[name][1]
        ]
        own = [module for module in found if module.name == asking]
        found = own or found
        if not found:
            raise NotConstantError(
                f"no module of this job gives {name!r} a value",
                "give the module that declares it, too",
            )
        if len(found) > 1 and len({module.given[name][0].strip() for module in found}) > 1:
            where = ", ".join(module.name for module in found[:3])
            raise NotConstantError(f"{name!r} is declared in {where} with several values")
        if self.changes.get(name):
            raise NotConstantError(f"{name!r} is changed in {self.changes[name][0]}")
        home = found[0]
        return evaluate_rapid(
            home.given[name][0], lambda other: self.value(other, home.name, depth + 1)
        )


class RapidChange(NamedTuple):
    """A statement that changes a variable: text None if it is not followed."""

    place: int
    subscript: str
    path: str
    text: str | None


class RapidValues:
    """Variables of one module while it is read, and their values afterwards.

    Attributes:
        absent: Places where routines in no given file are called.
    """

    def __init__(self, course: ControlFlow, task: RapidTask, module: str) -> None:
        self.task, self.module = task, module
        self.absent: list[int] = []
        self._course = course
        self._given: dict[tuple[str, str], tuple[str | None, bool]] = {}
        self._twice: set[tuple[str, str]] = set()
        self._changes: dict[tuple[str, str], list[RapidChange]] = defaultdict(list)
        self._starts: list[tuple[int, str, bool]] = [(0, "", False)]
        self._calls: dict[str, set[str]] = defaultdict(set)
        self._kept: dict[tuple[str, str], RapidValue] = {}

    def begin_routine(self, place: int, name: str, *, handler: bool) -> None:
        """Enters a routine or a handler."""
        self._starts.append((place, name, handler))

    def end_routine(self, place: int) -> None:
        """Enters the end of a routine."""
        self._starts.append((place, "", False))

    def declare(self, scope: str, name: str, text: str | None, *, local: bool) -> None:
        """Enters a declaration: text None if it gives no value."""
        if (scope, name) in self._given:
            self._twice.add((scope, name))
        self._given[scope, name] = text, local

    def change(self, scope: str, name: str, change: RapidChange) -> None:
        """Enters a statement that changes a variable."""
        self._changes[self._key(scope, name)].append(change)

    def call(self, scope: str, name: str) -> None:
        """Enters a call of a routine from another."""
        self._calls[scope].add(name)

    def knows(self, scope: str, name: str) -> bool:
        """Returns whether the module declares a variable that is followed."""
        return self._key(scope, name) in self._given

    def key(self, scope: str, name: str) -> tuple[str, str]:
        """Returns routine (empty: none) and name of the variable a name means in a routine."""
        return self._key(scope, name)

    def is_local(self, scope: str, name: str) -> bool:
        """Returns whether no other module can see a variable."""
        key = self._key(scope, name)
        return bool(key[0]) or self._given.get(key, (None, False))[1]

    def _key(self, scope: str, name: str) -> tuple[str, str]:
        return (scope, name) if (scope, name) in self._given else ("", name)

    def value(self, text: str, place: int, scope: str, depth: int = 0) -> RapidValue:
        """Returns the value of an expression at a place, before its statement has run.

        Raises:
            NotConstantError: It has none, or not one alone.
        """
        return evaluate_rapid(text, lambda name: self._find(name, place, scope, depth))

    def _find(self, name: str, place: int, scope: str, depth: int) -> RapidValue:
        if depth > _DEEPEST:
            raise NotConstantError(f"{name!r} depends on too many others")
        key = self._key(scope, name)
        if key not in self._given and key not in self._changes:
            return self.task.value(name, self.module)
        if key in self._twice:
            raise NotConstantError(f"{name!r} is declared twice")
        if not key[0] and not self.is_local(scope, name):
            if self.task.is_changed_outside(name, self.module):
                raise NotConstantError(f"{name!r} is changed in another module")
        text = self._given.get(key, (None, False))[0]
        changes = self._changes.get(key)
        if not changes:
            if text is None:
                raise NotConstantError(f"{name!r} is given no value")
            if key not in self._kept or key[0]:
                self._kept[key] = self.value(text, place if key[0] else 0, key[0], depth + 1)
            return self._kept[key]
        return self._find_reaching(key, place, scope, changes, depth)

    def _find_reaching(
        self, key: tuple[str, str], place: int, scope: str, changes: list[RapidChange], depth: int
    ) -> RapidValue:
        """Returns the value of the one change that reaches a place on every way."""
        name = key[1]
        risky = self._started_by_handlers()
        if any(self._routine(change.place) in risky for change in changes):
            raise NotConstantError(f"{name!r} is changed by a trap or an error handler")
        sets = [(change.place, k) for k, change in enumerate(changes, start=1)]
        if not self.is_local(scope, name):
            sets += [(at, len(changes) + 1) for at in self.absent]
        version = self._course.version_within(key, self._extent(key[0]), sets, place - 1)
        if version == DIFFERS:
            raise NotConstantError(f"{name!r} has more than one value here")
        if version == 0:
            text = self._given.get(key, (None, False))[0]
            if key[0] and text is not None:
                return self.value(text, place, key[0], depth + 1)
            raise NotConstantError(
                f"{name!r} is changed by the program, and here it may have any earlier value",
                "give it its value as a whole before this line",
            )
        if version > len(changes):
            raise NotConstantError(
                f"{name!r} is changed by the module, and maybe by routines in no given file",
                "give their files, too, or name them in harmless_routines",
            )
        change = changes[version - 1]
        if change.text is None:
            raise NotConstantError(f"{name!r} is set by a statement that is not interpreted")
        value = self.value(change.text, change.place, self._routine(change.place), depth + 1)
        if not change.path and not change.subscript:
            return value
        before = self._find(name, change.place, self._routine(change.place), depth + 1)
        return _replace_part(before, _steps(change), value)

    def _extent(self, routine: str) -> tuple[int, int]:
        """Returns the places between which the variables of a routine are followed."""
        if not routine:
            return -1, _LAST
        first = next(place for place, name, _ in self._starts if name == routine)
        ends = (at for at, name, _ in self._starts if at > first and not name)
        return first, min(ends, default=_LAST)

    def _routine(self, place: int) -> str:
        at = bisect_right(self._starts, place, key=lambda start: start[0]) - 1
        return self._starts[max(at, 0)][1]

    def _started_by_handlers(self) -> set[str]:
        out = {name for _, name, handler in self._starts if handler}
        waiting = list(out)
        while waiting:
            fresh = self._calls[waiting.pop()] - out
            out |= fresh
            waiting += fresh
        return out


def _steps(change: RapidChange) -> list[int]:
    """Returns the places that lead to what a change sets.

    Raises:
        NotConstantError: A subscript that is computed, or a component that is not known.
    """
    out = []
    for part in filter(None, change.subscript.split(",")):
        if not part.isdecimal() or int(part) < 1:
            raise NotConstantError("a computed element is changed")
        out.append(int(part) - 1)
    for name in filter(None, change.path.replace(" ", "").lower().split(".")):
        if name not in MEMBERS:
            raise NotConstantError(f"component {name!r} is not followed")
        out.append(MEMBERS[name])
    return out


def _replace_part(value: RapidValue, steps: list[int], new: RapidValue) -> RapidValue:
    if not steps:
        return new
    if not isinstance(value, tuple) or steps[0] >= len(value):
        raise NotConstantError("a component that is not there is changed")
    inner = _replace_part(value[steps[0]], steps[1:], new)
    return (*value[: steps[0]], inner, *value[steps[0] + 1 :])
