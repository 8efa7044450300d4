"""What the routines of the other modules of a RAPID task change, and which they call back."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from robotrue.program.formats import rapid_scan as scan
from robotrue.program.formats.rapid_expression import PURE
from robotrue.program.formats.rapid_flow import SHIFTS
from robotrue.program.formats.rapid_moves import BUILT_IN, behind_condition, move_of

LATE: Final = "a call by name"
"""What ``%...%`` and CallByVar call where the name is computed."""
_LITERAL_NAME: Final = re.compile(r'%\s*"(?:[^":]*:)?([\w\x80-\xff]+)"\s*%')
_CONTROL: Final = frozenset(
    """if elseif else endif for endfor while endwhile test case default endtest return goto label
    const pers var local task global prefix record endrecord module endmodule""".split()
) | {"", "if then"}
_ASSIGNED: Final = re.compile(
    r"(?<![\w.\\])([\w\x80-\xff]+)\s*(?:\{[^}]*\}\s*)?(?:\.\s*[\w\x80-\xff]+\s*)*:="
)
_HANDED: Final = re.compile(r"([\w\x80-\xff]++)\s*+\(([^()]*+)\)")
_USED: Final = re.compile(r"([\w\x80-\xff]+)\s*\(")
_NAME: Final = re.compile(r"[A-Za-z_\x80-\xff][\w\x80-\xff]*")
_HEADS: Final = re.compile(
    rb"^[ \t]*+(LOCAL\s++)?+(PROC|TRAP|FUNC\s++" + scan.WORD + rb")\s++(" + scan.WORD + rb")",
    re.IGNORECASE | re.MULTILINE,
)


def called_by_name(text: str) -> str:
    """Returns the routine a call by name starts: ``LATE`` if its name is computed."""
    match = _LITERAL_NAME.match(text)
    return match[1].lower() if match else LATE


@dataclass(slots=True)
class RapidRoutine:
    """What the statements of a routine name, in lower case.

    Attributes:
        kind: PROC, FUNC or TRAP.
        local: Other modules cannot call it.
        calls: Routines that its statements call.
        uses: Functions in its expressions, those of the controller too.
        handled: Those its error, undo and backward handlers call.
        changes: Data it may change, and its instructions of ``SHIFTS``.
    """

    kind: str
    local: bool
    calls: set[str] = field(default_factory=set)
    uses: set[str] = field(default_factory=set)
    handled: set[str] = field(default_factory=set)
    changes: set[str] = field(default_factory=set)


def list_routines(data: bytes) -> dict[str, RapidRoutine]:
    """Returns the routines of a module, without what they name."""
    heads = ((m[3], m[2][:4], m[1] is not None) for m in _HEADS.finditer(data))
    return {
        name.decode("latin-1").lower(): RapidRoutine(kind.decode().lower(), local)
        for name, kind, local in heads
    }


class RoutineReader:
    """Collects the routines of a module from its statements in order."""

    def __init__(self, data: bytes) -> None:
        self.routines: dict[str, RapidRoutine] = {}
        self._data = data
        self._routine: RapidRoutine | None = None
        self._local = self._in_handler = False

    def take(self, statement: scan.RapidStatement) -> None:
        """Enters a statement."""
        word = statement.word
        if word in ("proc", "func", "trap"):
            head = scan.clean(self._data[statement.body : statement.end]).partition("(")[0]
            self._routine = RapidRoutine(word, self._local)
            self.routines[(head.split() or [""])[-1].lower()] = self._routine
            self._in_handler = False
        elif word in ("endproc", "endfunc", "endtrap"):
            self._routine = None
        elif word in ("error", "undo", "backward"):
            self._in_handler = True
        elif self._routine is not None:
            self._enter(self._routine, statement)
        self._local = word == "prefix" and self._data[statement.start : statement.body].isalpha()

    def _enter(self, routine: RapidRoutine, statement: scan.RapidStatement) -> None:
        word = statement.word
        if move_of(word) is not None and self._data.find(b"(", statement.body, statement.end) < 0:
            return
        text = scan.clean(self._data[statement.start : statement.end]).lower()
        if word == "if":
            word = behind_condition(text[2:])
        calls, uses = set[str](), set(_USED.findall(text))
        if word in ("late", "callbyvar"):
            calls.add(called_by_name(text))
        elif word in SHIFTS:
            routine.changes.add(word)
        elif word in _ASSIGNED.findall(text):
            routine.changes.add(word)
        elif word not in BUILT_IN and word not in _CONTROL and move_of(word) is None:
            calls.add(word)
            routine.changes.update(_NAME.findall(text))
        for function, inside in _HANDED.findall(text) if uses else ():
            if function not in PURE:
                routine.changes.update(_NAME.findall(inside))
        routine.calls |= calls
        routine.uses |= uses
        if self._in_handler:
            routine.handled |= calls | uses


class Reach(NamedTuple):
    """What a routine of another module may do with all it calls.

    Attributes:
        absent: Routines in no given file that it calls, which may change anything.
        changes: As of ``RapidRoutine``.
        back: Routines of the module that is read that it may call.
    """

    absent: tuple[str, ...] = ()
    changes: frozenset[str] = frozenset()
    back: tuple[str, ...] = ()


class CallsBeside:
    """The calls of a task as the module that is read meets them.

    Args:
        own: Name of that module.
        modules: The routines of all modules by name, those of this one too.
        harmless: Routines in no given file that change nothing, in lower case.

    Attributes:
        harmless: As given.
        functions: Names of the functions of other modules that do more than give a value.
        handlers: What the traps of other modules and the error handlers of their routines do, any
            time.
    """

    def __init__(
        self,
        own: str = "",
        modules: Mapping[str, Mapping[str, RapidRoutine]] | None = None,
        harmless: Collection[str] = (),
    ) -> None:
        self._modules, self.harmless = modules or {}, harmless
        self._own, self._mine = own, self._modules.get(own, {})
        self._home: dict[str, str] = {}
        self._known: dict[str, Reach] = {}
        self.handlers: dict[str, Reach] = {}
        for module, routines in self._modules.items():
            for name, routine in routines.items() if module != own else ():
                if not routine.local:
                    self._home.setdefault(name, module)
        for module, routines in self._modules.items():
            for name, routine in routines.items() if module != own else ():
                starts = [(module, each) for each in routine.handled]
                starts += [(module, name)] if routine.kind == "trap" else []
                if starts:
                    self.handlers[name] = self._follow(starts)
        self.functions = frozenset(
            name.encode("latin-1")
            for name, module in self._home.items()
            if self._modules[module][name].kind == "func" and self.reach(name) != Reach()
        )

    def knows(self, name: str) -> bool:
        """Returns whether another module has a routine."""
        return name in self._home

    def reach(self, name: str) -> Reach:
        """Returns what a routine may do that the module calls and does not have."""
        if name not in self._known:
            is_called = name in self._home and name not in self._mine
            self._known[name] = self._follow([("", name)] if is_called else [])
        return self._known[name]

    def _follow(self, waiting: list[tuple[str, str]]) -> Reach:
        """Returns what routines may do, each by the module that names it."""
        missing, changes, back = set[str](), set[str](), set[str]()
        seen = set(waiting)
        while waiting:
            module, name = waiting.pop()
            if name in self.harmless:
                continue
            home = module if name in self._modules.get(module, ()) else self._find(name)
            if name == LATE:
                back.update(n for n, r in self._mine.items() if r.kind == "proc" and n != "main")
            if home == self._own:
                back.add(name)
                continue
            routine = self._modules[home][name] if home else RapidRoutine("", False)
            absent = (each for each in routine.calls if not self._has(home, each))
            missing.update(each for each in absent if each not in self.harmless)
            changes |= routine.changes
            fresh = {(home, each) for each in routine.calls | routine.uses} - seen
            seen |= fresh
            waiting += fresh
        return Reach(tuple(sorted(missing)), frozenset(changes), tuple(sorted(back)))

    def _has(self, module: str, name: str) -> bool:
        return name in self._modules[module] or bool(self._find(name))

    def _find(self, name: str) -> str:
        """Returns the module of a routine that all modules can call, empty if there is none."""
        if name in self._mine and not self._mine[name].local:
            return self._own
        return self._home.get(name, "")
