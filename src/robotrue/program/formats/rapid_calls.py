"""Follows the calls of a RAPID module: its own routines, those of others, calls by name."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Container
from typing import Final

from robotrue.program.formats import rapid_scan as scan
from robotrue.program.formats.rapid_beside import LATE, list_routines
from robotrue.program.formats.rapid_data import Data, RapidSource
from robotrue.program.formats.rapid_flow import AXES_SHIFTED, FOREIGN, SHIFTED, SHIFTS
from robotrue.program.formats.rapid_frames import TOOL, WORK

_MAYBE: Final = re.compile(rb"\b(?:and|or)\b", re.IGNORECASE)
"""What may keep a function behind it from being called."""


class Calls(Data):
    """The calls while a module is read.

    Attributes:
        routines: Names of the module's routines read so far.
        changing: First byte of the first call of each routine of other modules that changes data.
        has_functions: Functions of the task may change something.
    """

    def __init__(self, source: RapidSource) -> None:
        super().__init__(source)
        self.routines = set[str]()
        self.changing: dict[str, int] = {}
        self._calls: list[tuple[int, str, int]] = []
        self._shifts: list[tuple[int, str]] = []
        self._functions = scan.list_functions(self.data)
        self._procedures = [n for n, r in list_routines(self.data).items() if r.kind == "proc"]
        self.has_functions = bool(self._functions or self.beside.functions)
        for reach in self.beside.handlers.values():
            for each in reach.back:
                self.course.handler(each)

    def call(self, name: str, offset: int) -> None:
        """Passes through a routine, and through those of this module that it may call."""
        reach = self.beside.reach(name)
        absent = (name,) if not self.beside.knows(name) else reach.absent
        self._calls += [(self.place, each, offset) for each in absent]
        self.course.call(self.place, [name])
        back: Collection[str] = reach.back
        if name == LATE:
            back = [each for each in self._procedures if each != "main"]
            self.course.call_one(self.place, back)
        elif back:
            self.course.call_any(self.place, back)
        for each in (name, *back):
            self.values.call(self.scope, each)
        if reach.changes:
            self.changing.setdefault(name, offset)
            self._change(reach.changes)

    def _change(self, names: Container[str]) -> None:
        """Enters that a routine of another module may have changed frames and displacements."""
        self.course.branch(self.place, opens=True)
        self.place += 1
        for word, (key, version) in SHIFTS.items():
            if word in names:
                self.course.set(self.place, key, version)
                self.place += 1
        for side, name in self.frames.list_shared():
            if name in names:
                self.frames.lose(side, name, self.place)
        self.place += 1
        self.course.join(self.place)

    def use_functions(self, start: int, end: int) -> bool:
        """Passes through the functions of the task that an expression calls, if there are any."""
        own = scan.find_calls(self.data, start, end, self._functions)
        is_certain = not _MAYBE.search(self.data, start, end) if own else True
        for name in own:
            (self.course.call if is_certain else self.course.call_one)(self.place, [name])
            self.values.call(self.scope, name)
        others = scan.find_calls(self.data, start, end, self.beside.functions - self._functions)
        for name in others:
            self.call(name, start)
        return bool(own or others)

    def condition(self, start: int, end: int, close: Callable[[int], None]) -> None:
        """Passes through the functions in a condition, which ``close`` ends in the graph."""
        if self.has_functions and self.use_functions(start, end):
            close(self.place)

    def find_absent(self) -> None:
        """Enters where routines in no given file may change data; all has been read."""
        known = self.routines | set(self.beside.harmless)
        self._calls = [each for each in self._calls if each[1] not in known]
        self.values.absent = [place for place, _, _ in self._calls]

    def outside(self) -> list[tuple[str, int]]:
        """Returns name and first byte of the calls of routines that are in no given file.

        From then on the control flow holds which of displacement, tools and work objects each may
        have changed: ``FOREIGN`` keys hold one more than its number here.
        """
        data = {(side, name) for pair in self.story.settings for side, name in
                ((TOOL, pair[0]), (WORK, pair[1]))}  # fmt: skip
        for key in (SHIFTED, AXES_SHIFTED, *(each for each in data if self._open_to_all(*each))):
            for number, (place, _, _) in enumerate(self._calls, start=1):
                self.course.set(place, (FOREIGN, key), number)
        for place, key in (*self._shifts, *self.frames.renewed):
            self.course.set(place, (FOREIGN, key), 0)
        return [(name, at) for _, name, at in self._calls]

    def find_changing_handlers(self) -> list[str]:
        """Returns the traps and handlers of other modules that change what motions here need."""
        needed = {name for pair in self.story.settings for name in pair} | SHIFTS.keys()
        handlers = self.beside.handlers.items()
        return sorted(name for name, reach in handlers if reach.changes & needed)

    def _open_to_all(self, side: str, name: str) -> bool:
        """Returns whether routines of other modules may change a tool or work object."""
        if name in ("", "tool0", "wobj0") or (side, name) in self.frames.own:
            return False
        return re.fullmatch(r"[\w\x80-\xff]+", name) is not None
