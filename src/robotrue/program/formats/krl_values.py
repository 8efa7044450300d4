"""The value of every KRL variable at every statement: reaching definitions over the whole job.

A variable that no statement of the job changes has the value of its declaration. The declaration of
a changed variable does not count, because data lists keep the last value; its value is then that of
the one assignment that reaches a statement on every way to it. Parameters have a value where every
call passes the same one, or within one call.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from robotrue.program.formats.control_flow import DIFFERS, ControlFlow
from robotrue.program.formats.expression import NotConstantError
from robotrue.program.formats.krl_expression import KrlValue, evaluate
from robotrue.program.formats.krl_scope import Scope

Arguments = Mapping[str, KrlValue]
"""Parameters of a routine within one call."""
NO_VALUE: Final = "no file of this job gives"
_DEEPEST: Final = 12
_LAST: Final = 1 << 60
_PLAIN: Final = re.compile(r"\s*([A-Za-z_]\w*)\s*(?:\[([^\]]*)\])?\s*")
_PARAMETER: Final = re.compile(r"\s*(\w+)\s*(?:\[[^\]]*\])?\s*(?::\s*(IN|OUT))?\s*", re.IGNORECASE)
_PIECE: Final = re.compile(r"\w+|[^\s\w]")
_SUBSCRIPT: Final = re.compile(r"\d+(?:,\d+)*")


class VariableChange(NamedTuple):
    """A statement that changes a variable.

    Attributes:
        line: Zero-based, of the main text.
        subscript: As written without blanks; empty: the whole variable.
        path: Component that is changed; empty: all of it.
        text: The new value; None: it is not followed.
    """

    line: int
    subscript: str
    path: str
    text: str | None


class KrlCall(NamedTuple):
    """A call of a routine: zero-based line, node of the graph, its name and arguments."""

    line: int
    node: int
    name: str
    arguments: tuple[str, ...]


class KrlRoutine(NamedTuple):
    """A routine: its first line and its parameters, those handed over by value (IN) or not."""

    line: int
    parameters: tuple[tuple[str, bool], ...]


class KrlValues:
    """Variables of a job while it is read, and their values afterwards.

    Attributes:
        routines: By name as the flow knows them.
        calls: Of routines of the job and of others.
        handlers: Routines that an interrupt, a trigger or the submit interpreter starts.
        shared: Names that other modules than their own may change.
        foreign: A routine in no given file is called that may change shared names.
        resumes: An interrupt may leave a routine at any line.
    """

    def __init__(self, scope: Scope, flow: ControlFlow) -> None:
        self.scope, self._flow = scope, flow
        self.routines: dict[str, KrlRoutine] = {}
        self.calls: list[KrlCall] = []
        self.handlers: set[str] = set()
        self.shared: set[str] = set()
        self.foreign = self.resumes = False
        self._given: dict[str, dict[str, list[tuple[str, int]]]] = defaultdict(dict)
        self._changes: dict[str, list[VariableChange]] = defaultdict(list)
        self._locals: dict[str, set[str]] = defaultdict(set)
        self._starts: list[tuple[int, str]] = [(0, "")]
        self._kept: dict[tuple[str, str, int], KrlValue | NotConstantError] = {}
        self._settings: dict[tuple[str, str], tuple[list[VariableChange], set[str]]] = {}
        self._started: set[str] | None = None
        self._computed: dict[str, bool] = {}

    def declare(self, name: str, subscript: str, text: str) -> None:
        """Enters what the data list being read gives a variable."""
        line = self.scope.store
        given = self._given[self.scope.name_in(name, line)]
        given.setdefault(subscript, []).append((text, line))

    def change(self, name: str, change: VariableChange) -> None:
        """Enters a statement that changes a variable."""
        self._changes[self.key(name, change.line)].append(change)

    def begin_routine(self, line: int, name: str, parameters: str) -> None:
        """Enters a routine with its text of parameters."""
        found = [_PARAMETER.fullmatch(each) for each in parameters.split(",") if each.strip()]
        pairs = [(m[1].lower(), (m[2] or "").upper() == "IN") for m in found if m]
        self.routines[name] = KrlRoutine(line, tuple(pairs))
        self._starts.append((line, name))
        self._locals[name].update(parameter for parameter, _ in pairs)

    def declare_local(self, line: int, names: list[str]) -> None:
        """Enters variables that a routine declares for itself."""
        routine = self.routine_at(line)
        if routine:
            self._locals[routine].update(names)

    def routine_at(self, line: int) -> str:
        """Returns the routine that contains a line; empty before the first."""
        return self._start_at(line)[1]

    def begin_of(self, line: int) -> int:
        """Returns the first line of the routine that contains a line."""
        return self._start_at(line)[0]

    def _start_at(self, line: int) -> tuple[int, str]:
        at = bisect_right(self._starts, line, key=lambda start: start[0]) - 1
        return self._starts[max(at, 0)]

    def key(self, name: str, line: int) -> str:
        """Returns a name as it is meant in a line: after its routine if it is local there."""
        routine = self.routine_at(line)
        if name in self._locals.get(routine, ()):
            return f"{routine}:{name}"
        return self.scope.name_in(name, line)

    def leaves_routine(self, key: str) -> bool:
        """Returns whether a key names a parameter by which a routine changes its caller's."""
        routine, _, name = key.rpartition(":")
        return (name, False) in self.routines[routine].parameters if routine else False

    def is_computed(self, name: str, line: int) -> bool:
        """Returns whether a statement gives a variable something else than a literal."""
        key = self.key(name, line)
        if key not in self._computed:
            self._computed[key] = any(
                change.text is None or change.path or not change.text.lstrip().startswith("{")
                for change in self._changes.get(key, ())
            )
        return self._computed[key]

    def find_setting_line(self, key: str, index: str, line: int) -> int | None:
        """Returns the zero-based line that sets a variable on every way to a line.

        None: none does, or more than one may.

        Args:
            key: As :meth:`key` returns it.
            index: Subscript without blanks; empty: the whole variable.
            line: Zero-based.
        """
        if (key, index) not in self._settings:
            self._settings[key, index] = self._collect_settings(key, index)
        mine, changing = self._settings[key, index]
        routine = self.routine_at(line)
        if (
            not mine
            or (":" not in key and routine in self.started_by_handlers())
            or (self.resumes and changing - {routine})
        ):
            return None
        version = self._version(key, index, mine, line)
        return mine[version - 1].line if version > 0 else None

    def _collect_settings(self, key: str, index: str) -> tuple[list[VariableChange], set[str]]:
        """Returns the changes of a variable, none if not followed, and the routines with them."""
        changes = self._changes.get(key, [])
        changing = {self.routine_at(change.line) for change in changes}
        if (
            (key in self.shared and self.foreign)
            or changing & self.started_by_handlers()
            or any(each.subscript and not _SUBSCRIPT.fullmatch(each.subscript) for each in changes)
        ):
            return [], changing
        return [each for each in changes if each.subscript in ("", index) or not index], changing

    def _version(self, key: str, index: str, mine: list[VariableChange], line: int) -> int:
        """Returns which of some changes reaches a line, counted from 1; below: none, or several."""
        of = key.rpartition(":")[0]
        sets = ((2 * change.line + 1, k) for k, change in enumerate(mine, start=1))
        span = self._extent(of) if of else (-1, _LAST)
        return self._flow.version_within((key, index), span, sets, 2 * line)

    def settle(self, harmless: Callable[[str], bool]) -> None:
        """Enters what calls change: arguments that are not handed over by value.

        Args:
            harmless: Whether a routine in no given file changes no variable.
        """
        for call in self.calls:
            routine = self.routines.get(call.name)
            if routine is None and harmless(call.name):
                continue
            self.foreign |= routine is None
            for number, text in enumerate(call.arguments):
                by_value = (
                    routine is not None
                    and number < len(routine.parameters)
                    and routine.parameters[number][1]
                )
                plain = None if by_value else _PLAIN.fullmatch(text.partition(".")[0])
                if plain:
                    subscript = re.sub(r"\s+", "", plain[2] or "")
                    self.change(plain[1].lower(), VariableChange(call.line, subscript, "", None))

    def started_by_handlers(self) -> set[str]:
        """Returns the routines that may run at any place."""
        if self._started is not None:
            return self._started
        out = self._started = set(self.handlers)
        waiting = list(out)
        calls: dict[str, set[str]] = defaultdict(set)
        for call in self.calls:
            calls[self.routine_at(call.line)].add(call.name)
        while waiting:
            fresh = calls[waiting.pop()] - out
            out |= fresh
            waiting += fresh
        return out

    def value(
        self, text: str, line: int, arguments: Arguments | None = None, depth: int = 0
    ) -> KrlValue:
        """Returns the value of an expression in a line, before the line has run.

        Args:
            text: The expression.
            line: Zero-based.
            arguments: Parameters of the routine that contains the line, within one call.
            depth: Of definitions followed already.

        Raises:
            NotConstantError: It has none, or more than one.
        """
        return evaluate(text, lambda name, index: self._find(name, index, line, arguments, depth))

    def _find(
        self, name: str, index: str, line: int, arguments: Arguments | None, depth: int
    ) -> KrlValue:
        if name.startswith("$"):
            if name == "$nullframe":
                return dict.fromkeys(("x", "y", "z", "a", "b", "c"), 0.0)
            raise NotConstantError(f"{name.upper()} is known only to the controller")
        if depth > _DEEPEST:
            raise NotConstantError(f"{name.upper()} depends on too many others")
        key = self.key(name, line)
        if arguments is not None and ":" in key and name in arguments and key not in self._changes:
            return arguments[name]
        if arguments is not None:
            return self._at(key, index, line, arguments, depth)
        kept = (key, index, line)
        if kept not in self._kept:
            try:
                self._kept[kept] = self._at(key, index, line, None, depth)
            except NotConstantError as why:
                self._kept[kept] = why
        value = self._kept[kept]
        if isinstance(value, NotConstantError):
            raise value
        return value

    def _at(
        self, key: str, index: str, line: int, arguments: Arguments | None, depth: int
    ) -> KrlValue:
        name = key.rpartition(":")[2]
        changes = self._changes.get(key)
        if changes:
            return self._find_reaching(key, index, line, changes, arguments, depth)
        if key != name:
            return self._parameter(key, depth)
        given = self._given.get(name, {}).get(index)
        if given is None:
            raise NotConstantError(
                f"{NO_VALUE} {_spell(name, index)} a value",
                "give the .dat or $config.dat that holds it, too",
            )
        if len({text.replace(" ", "") for text, _ in given}) > 1:
            raise NotConstantError(f"{_spell(name, index)} is given several values")
        return self.value(*given[0], None, depth + 1)

    def _parameter(self, key: str, depth: int) -> KrlValue:
        """Returns the value every call passes."""
        routine, _, name = key.rpartition(":")
        names = [parameter for parameter, _ in self.routines[routine].parameters]
        if name not in names:
            raise NotConstantError(f"{name.upper()} is declared without a value")
        number, values = names.index(name), []
        for call in self.calls:
            if call.name == routine:
                if number >= len(call.arguments):
                    raise NotConstantError(f"a call leaves {name.upper()} out")
                values.append(self.value(call.arguments[number], call.line, None, depth + 1))
        if not values or any(each != values[0] for each in values):
            what = "several values" if values else "no value in this job"
            raise NotConstantError(
                f"{name.upper()} is a parameter that receives {what}",
                "write the number out, or give the program that calls it, too",
            )
        return values[0]

    def _find_reaching(
        self,
        key: str,
        index: str,
        line: int,
        changes: list[VariableChange],
        arguments: Arguments | None,
        depth: int,
    ) -> KrlValue:
        """Returns the value of the one change that reaches a line on every way."""
        name = key.rpartition(":")[2]
        shown = _spell(name, index)
        if key in self.shared and self.foreign:
            raise NotConstantError(
                f"{shown} is changed by this job, and maybe by routines in no given file",
                "give their files, too, or name them in harmless_routines",
            )
        everywhere = self.started_by_handlers()
        if any(self.routine_at(change.line) in everywhere for change in changes):
            raise NotConstantError(f"{shown} is changed by an interrupt or in the background")
        routine = self.routine_at(line)
        if ":" not in key and routine in everywhere:
            raise NotConstantError(
                f"{shown} is read by a routine that an interrupt or a trigger starts, at any value"
            )
        if self.resumes and any(self.routine_at(change.line) != routine for change in changes):
            raise NotConstantError(
                f"{shown} is changed by a routine that RESUME may leave anywhere"
            )
        mine = [each for each in changes if each.subscript in ("", index) or not index]
        if any(each.subscript and not _SUBSCRIPT.fullmatch(each.subscript) for each in changes):
            raise NotConstantError(f"a computed element of {name.upper()} is changed")
        if not mine:
            given = self._given.get(name, {}).get(index, [])
            if len(given) == 1:
                return self.value(*given[0], None, depth + 1)
        version = self._version(key, index, mine, line)
        if version == DIFFERS:
            raise NotConstantError(
                f"{shown} has more than one value here", "set it in the line before"
            )
        if version <= 0:
            raise NotConstantError(
                f"{shown} is changed by the program, and here it may have any earlier value",
                "give it its value as a whole before this line",
            )
        change = mine[version - 1]
        if change.text is None:
            raise NotConstantError(
                f"{shown} is set by a statement that is not interpreted (line {change.line + 1})"
            )
        value = self.value(change.text, change.line, arguments, depth + 1)
        if not change.path:
            return value
        before = self._find(name, index, change.line, arguments, depth + 1)
        if not isinstance(before, dict) or "." in change.path or isinstance(value, dict | str):
            raise NotConstantError(f"{shown}.{change.path.upper()} is not followed")
        return before | {change.path: value}

    def _extent(self, routine: str) -> tuple[int, int]:
        """Returns the places a routine lies between."""
        first = self.routines[routine].line
        later = [line for line, _ in self._starts if line > first]
        return 2 * first, 2 * min(later) if later else _LAST


def split_calls(code: str) -> list[tuple[str, tuple[str, ...]]]:
    """Returns name and arguments of every call in a line whose bracket is closed."""
    out: list[tuple[str, tuple[str, ...]]] = []
    opened: list[tuple[str, int, list[str]]] = []
    word = ""
    for match in _PIECE.finditer(code):
        piece = match[0]
        if piece in "({[":
            opened.append((word if piece == "(" else "", match.end(), []))
        elif piece in ")}]" and opened:
            name, begin, parts = opened.pop()
            if name and len(opened) < _DEEPEST:
                last = code[begin : match.start()].strip()
                out.append((name, (*parts, last) if parts or last else ()))
        elif piece == "," and opened:
            name, begin, parts = opened[-1]
            if len(opened) <= _DEEPEST:
                parts.append(code[begin : match.start()].strip())
            opened[-1] = name, match.end(), parts
        word = piece if piece[0].isalnum() or piece[0] == "_" else ""
    return out


def _spell(name: str, index: str) -> str:
    plain = name.partition("@")[0].upper()
    return f"{plain}[{index}]" if index else plain
