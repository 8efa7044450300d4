"""The control flow of a RAPID module in its task: what is in force where routines begin."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Hashable
from functools import cached_property
from typing import Final

from robotrue.program.formats.control_flow import AS_FOUND, ControlFlow
from robotrue.program.formats.rapid_frames import TOOL, WORK
from robotrue.program.formats.rapid_values import RapidTask

SHIFTED: Final = "displacement"
AXES_SHIFTED: Final = "offset of external axes"
SHIFTS: Final = {
    "pdispon": (SHIFTED, 1),
    "pdispset": (SHIFTED, 1),
    "pdispoff": (SHIFTED, 0),
    "eoffson": (AXES_SHIFTED, 1),
    "eoffsset": (AXES_SHIFTED, 1),
    "eoffsoff": (AXES_SHIFTED, 0),
}
FOREIGN: Final = "routine in no file"
"""Since it ran its possible changes have not been set again: this, and a key of ``SHIFTS`` or
(side, name) of tools and work objects."""

_CONTINUES: Final = re.compile(
    r"(?:^|;|\bend\w+)\s*+(?:retry|trynext|exit|exitcycle)\s*+;\s*+$", re.IGNORECASE
)
_LEAVES: Final = re.compile(r"\b(?:return|raise)\b", re.IGNORECASE)


class RapidFlow(ControlFlow):
    """The control flow of a module that runs again and again, and whose routines others may call.

    Args:
        task: All modules.
        module: Name of the one that is followed.

    Attributes:
        own: (side, name) of tools and work objects that no other module can change.
    """

    def __init__(self, task: RapidTask, module: str) -> None:
        super().__init__()
        self.own: set[tuple[str, str]] = set()
        self._task, self._module = task, module
        self._caught: dict[str, str] = {}
        self._begins_again: dict[int, bool] = {}

    def restart(self, at: int, *, cycle: bool) -> None:
        """ExitCycle (``cycle``) begins main again, EXIT ends the program; data keep values."""
        self._begins_again[self._at] = cycle
        self._add(at, ())

    def catch(self, routine: str, text: str) -> None:
        """Enters the error handler of a routine: its text without comments."""
        self._caught[routine] = text

    def list_uncertain(self) -> list[str]:
        """Returns the routines that an error may end before they have set a requested variable."""
        effects = [one.effect for one in self._solved.values()]
        return sorted(
            name for name, routine in self._names.items()
            if routine in self._cut_short and any(each[routine] < AS_FOUND for each in effects)
        )  # fmt: skip

    def _list_cut_short(self) -> Collection[int]:
        """Returns the routines that an error may end at any place while the program continues.

        Those a handler returns from, and those without one that a routine with one calls; after
        RETRY it calls them again.
        """
        caught = {self._names[name]: text.lower() for name, text in self._caught.items()}
        calls = defaultdict[int, set[int]](set)
        for node, (routine, names) in enumerate(zip(self._routine, self._calls, strict=True)):
            calls[routine] |= {self._names[one] for one in names if one in self._names}
            if names and "retry" in caught.get(routine, ""):
                self._before[node].append(node)
        out = {
            k for k, text in caught.items() if _LEAVES.search(text) or not _CONTINUES.search(text)
        }
        if self._task.is_read_outside("error", self._module):
            out |= self._called_outside - caught.keys()
        waiting = [*(out | caught.keys())]
        while waiting:
            fresh = calls[waiting.pop()] - out - caught.keys()
            out |= fresh
            waiting += fresh
        return out

    @cached_property
    def _called_outside(self) -> set[int]:
        """The routines that other modules name."""
        names = self._names.items()
        return {k for name, k in names if self._task.is_read_outside(name, self._module)}

    def _is_set_outside(self, key: Hashable) -> bool:
        if key in (SHIFTED, AXES_SHIFTED):
            words = (word for word, (what, version) in SHIFTS.items() if version and what == key)
            return any(self._task.is_read_outside(word, self._module) for word in words)
        if not isinstance(key, tuple) or key[0] not in (TOOL, WORK) or key[:2] in self.own:
            return False
        return self._task.is_changed_outside(key[1], self._module)

    def _is_set_before(self, key: Hashable, routine: int) -> bool:
        return self._is_set_outside(key) and routine in self._called_outside

    def _ends_program(self, key: Hashable) -> Collection[int]:
        of_cycle = key in (SHIFTED, AXES_SHIFTED)  # these end where the program begins again
        return [node for node, cycle in self._begins_again.items() if cycle or not of_cycle]

    def _is_kept(self, key: Hashable) -> bool:
        return not isinstance(key, tuple) or key[0] != FOREIGN
