"""Frames in force at each place of a KRL program, over all control-flow paths.

Places are twice the line: there are calls, branches and loops; what a line sets is one after. After
a call of a routine in no given file base and tool are not known until they are set again.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.control_flow import AS_FOUND, ControlFlow

BASE: Final = 0
TOOL: Final = 1
ON_ROBOT: Final = 2
PENDING: Final = 3
"""FDAT_ACT: what an inline form hands to the next BAS call; 0 is nothing."""
FOREIGN_BASE: Final = 4
FOREIGN_TOOL: Final = 5
"""One-based line of a call that leaves the files of this program, since the frame was set; or 0."""
_KEYS: Final = range(6)
_HANDED_OVER: Final = (BASE, TOOL, ON_ROBOT)


# Calls that leave frames alone: operators, statements and functions of the controller itself.
HARMLESS: Final = frozenset(
    """and or not exor b_and b_or b_exor b_not if while until for switch case wait sec halt return
    repeat to step then do sin cos tan acos atan2 sqrt abs round trunc inv_pos forward inverse
    toframe invop pulse bas cr_process_file signal cast_from cast_to copen cclose cread cwrite
    sread swrite strlen strcomp strcopy stradd strfind strclear strdeclen strtoint strtoreal
    strtobool b_not varstate get_sig_inf set_sys_data wait_for on_error_proceed err_raise msg
    msgnotify msgquit msgdialog msgstate set_kdo_values timer_limit spline spl lin ptp circ slin
    sptp scirc lin_rel ptp_rel circ_rel trigger interrupt when delay distance path prio onstart
    anin anout pto ezero delete_backward_buffer svel_cp svel_joint stool stool2 sbase sipo_mode
    sload
    ir_stopm rob_stop rob_stop_release is_key_pressed set_krl_msg set_krl_dlg exists_krl_msg
    exists_krl_dlg clear_krl_msg krl_fopen krl_fclose krl_fread krl_fwrite krl_fputs cioctl lk
    strtoframe strtopos strtoe6pos mbx_rec wsostatus
    sacc_cp sacc_joint sapo sapo_ptp sori_typ sjerk sgear_jerk use_cm_pro_values ek k_root k_type
    k_offs time_block""".split()
)

PURE: Final = frozenset(
    """and or not exor b_and b_or b_exor b_not if while until for switch case wait sec return repeat
    do sin cos tan acos atan2 sqrt abs round trunc inv_pos forward inverse toframe pulse bas
    varstate when stool stool2 sbase sipo_mode sload sacc_cp sacc_joint sapo sapo_ptp sori_typ
    sjerk svel_cp svel_joint sgear_jerk use_cm_pro_values ek k_root k_type k_offs time_block
    cr_process_file strlen strcomp is_key_pressed msgnotify msgquit cwrite swrite krl_fwrite
    krl_fputs wait_for set_kdo_values delay distance path prio onstart trigger interrupt
    spline halt""".split()
)
"""Those of them that change no variable handed over."""


class KrlFlow(ControlFlow):
    """The ways through the main text; variables and frames are followed on the same graph.

    Args:
        harmless: Routines, in lower case, that leave frames alone wherever they are.
    """

    def __init__(self, harmless: Iterable[str] = ()) -> None:
        super().__init__(mains=1)
        self._harmless = HARMLESS.union(harmless)
        self._takes: set[int] = set()
        self._triggers: set[int] = set()
        self._restores: dict[int, int] = {}
        self._saved: list[int] = []
        self._instead: dict[tuple[int, int], int] = {}
        self._copied: dict[tuple[Hashable, int], list[int]] = defaultdict(list)
        self._pending: list[tuple[int, int, int]] = [(0, 0, 0)]

    def put(self, at: int, key: int, version: int) -> None:
        """Sets a frame, or the holder of the part."""
        self.set(at, key, version)
        if key <= TOOL:
            self.set(at, FOREIGN_BASE + key, 0)

    def pend(self, at: int, base: int, tool: int, on_robot: bool) -> None:
        """Remembers what FDAT_ACT passes."""
        self._pending.append((base, tool, int(on_robot)))
        self.set(at, PENDING, len(self._pending) - 1)

    def take_pending(self, at: int) -> None:
        """Sets FDAT_ACT: ``BAS(#FRAMES)``, ``BAS(#PTP_PARAMS)``, ``BAS(#CP_PARAMS)``."""
        what = "comes from an FDAT_ACT that depends on the path here"
        self._takes.add(self._add(at, [self._at], what))

    def trigger(self, at: int, names: Iterable[str]) -> None:
        """Passes a trigger: a routine in no file may run from here on, as if it were called."""
        self._triggers.add(self.call(at, names))

    def start(self, at: int, name: str, *, handler: bool = False) -> None:
        """Begins a routine."""
        self._saved = []
        super().start(at, name, handler=handler)

    def save(self, at: int) -> None:
        """Remembers the frames in force before what is set at this line, for :meth:`restore`."""
        self._saved.append(self._add(at, [self._at]))
        self._add(at, [self._at])

    def restore(self, at: int) -> None:
        """Restores the state of the last :meth:`save`; variables stay as they are."""
        if self._saved:
            node = self._add(at, [self._at])
            self._restores[node] = self._saved.pop()

    def is_harmless(self, name: str) -> bool:
        """Returns true if a routine never changes frames, wherever it is called."""
        return name.partition("@")[0] in self._harmless

    # Routines followed once for every call

    def rename(self, frames: Mapping[tuple[int, int], int]) -> None:
        """Gives frames their indices: from key and placeholder index."""
        for key in (BASE, TOOL):
            self._sets[key] = [(at, frames.get((key, one), one)) for at, one in self._sets[key]]
            for (of, _), versions in self._copied.items():
                if of == key:
                    versions[:] = [frames.get((key, one), one) for one in versions]

    def calls_of(self, name: str) -> list[int]:
        """Returns the nodes of a routine that call others."""
        routine = self._names.get(name, -1)
        return [n for n, of in enumerate(self._routine) if of == routine and self._calls[n]]

    def copy_routine(
        self, name: str, frames: Mapping[tuple[int, int], int]
    ) -> tuple[int, dict[int, int]]:
        """Enters a copy of a routine for one call, with other frames; nothing is moved to in it.

        Returns:
            The copy, and its nodes by node of the routine.
        """
        self._finish()
        routine = self._names[name]
        nodes = [node for node, of in enumerate(self._routine) if of == routine]
        new = {node: len(self._place) + k for k, node in enumerate(nodes)}
        self._first.append(new[self._first[routine]])
        self._last.append([new[node] for node in self._last[routine] if node in new])
        for node in nodes:
            self._place.append(self._place[node])
            self._what.append(self._what[node])
            self._before.append([new[one] for one in self._before[node] if one in new])
            self._calls.append(self._calls[node])
            self._routine.append(len(self._first) - 1)
            if node in self._takes:
                self._takes.add(new[node])
            if node in self._restores:
                self._restores[new[node]] = new[self._restores[node]]
        for key in _KEYS:
            for at, version in sorted(self._sets[key], key=lambda one: one[0]):
                node = int(np.searchsorted(self._place[: self._drawn], at, side="right")) - 1
                if node in new:
                    self._copied[key, new[node]].append(frames.get((key, version), version))
        return len(self._first) - 1, new

    def lead(self, node: int, name: str, copy: int) -> None:
        """Makes a call of a routine one of a copy of it."""
        self._instead[node, self._names[name]] = copy

    def _finish(self) -> None:
        if self._drawn < 0:
            super()._finish()
            for line in self.foreign_calls():
                for key in (FOREIGN_BASE, FOREIGN_TOOL):
                    self.set(2 * line - 2, key, line)

    # Answers

    @property
    def places(self) -> IntArray:
        """Places at which frames may change, rising."""
        self._finish()
        sets = [at for key in _KEYS for at, _ in self._sets[key]]
        return np.unique(np.array([*self._place[: self._drawn], *sets], np.int64))

    def foreign_calls(self) -> dict[int, tuple[str, ...]]:
        """Returns the routines in no file that each one-based line calls."""
        calls = {}
        for at, names in zip(self._place, self._calls, strict=True):
            absent = tuple(name for name in names if name not in self._names)
            if absent:
                calls[at // 2 + 1] = absent
        return calls

    def changing_handlers(self) -> list[str]:
        """Returns the routines that interrupts and triggers start and that change frames."""
        return self._setting_handlers([self._solve_all(key) for key in _HANDED_OVER])

    def absent_handlers(self) -> list[str]:
        """Returns the routines in no file that interrupts start."""
        called = {name for names in self._calls for name in names}
        return sorted(self._handlers - self._names.keys() - self._harmless - called)

    # Data flow

    def _enter(self, key: Hashable, node: int) -> list[int]:
        """Enters the routine of a trigger; values of variables are not requested then."""
        if node in self._triggers and key not in _KEYS:
            return []
        return super()._enter(key, node)

    def _pass_through(self, key: Hashable, node: int) -> list[int]:
        if node in self._triggers:
            return []
        if key not in _KEYS or not self._instead:
            return super()._pass_through(key, node)
        return [self._instead.get((node, one), one) for one in super()._pass_through(key, node)]

    def _come_from(self, key: Hashable, node: int) -> list[int]:
        if node in self._restores and key in _KEYS:
            return [self._restores[node]]
        return super()._come_from(key, node)

    def _started_anywhere(self, key: Hashable) -> list[int]:
        return super()._started_anywhere(key) if key in _KEYS else []

    def _is_certain(self, key: Hashable) -> bool:
        if key == ON_ROBOT:
            held = [*(held for _, _, held in self._pending), *(v for _, v in self._sets[ON_ROBOT])]
            return not any(held)
        return key in (FOREIGN_BASE, FOREIGN_TOOL)

    def _pass_node(self, key: Hashable, node: int, mark: int) -> int:
        if node not in self._takes or not isinstance(key, int) or key == PENDING:
            return mark
        pending = self._solve_all(PENDING).relative[node]
        if pending == AS_FOUND and self._routine[node] <= 1:
            return mark  # nothing was handed over since the program began
        if pending > 0:
            return self._pending[pending][key] if key in _HANDED_OVER else 0
        return self.mark_of(node) if pending < 0 and key in _HANDED_OVER else mark

    def _versions_behind(
        self, key: Hashable, node: int, behind: Mapping[int, list[int]]
    ) -> Sequence[int]:
        if node >= self._drawn:
            return self._copied.get((key, node), ())
        return super()._versions_behind(key, node, behind)
