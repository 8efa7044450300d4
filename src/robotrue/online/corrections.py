"""Robot corrections from estimates: the negative error, low-passed, in the robot's own axes.

ABB's path correction is a displacement in the axes of the path: x along it, z as near the tool's z
as a right angle to x allows, y = z cross x.

While a robot may hold a correction there is a note on disk, so that no later start forgets it:
written before corrections begin, removed when they have ended at zero. A service that was killed,
lost its robot, or does not know what the robot holds leaves it; the next one requires confirmation
by the operator.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.online.answering_wire import RemoteGuard
from robotrue.online.estimates import EstimateBlock, doubt_words
from robotrue.online.guard import CorrectionGuard, GuardState
from robotrue.online.robot_correction import Correction, CorrectionMode

CUTOFF: Final = 2.0
"""Hz of the low-pass. A robot follows a correction tens of milliseconds late; what is faster would
come out of step and make the error larger. The static part of a cut is slower than this."""


Guard = CorrectionGuard | RemoteGuard
"""What corrections are handed to, here or in the answering process."""


class Corrections:
    """Minus the estimated error, low-passed, turned into the axes of the controller's correction.

    An invalid estimate goes to the guard as a fault, and the low-pass restarts after it.
    """

    def __init__(
        self, guard: Guard, R_base_frame: Callable[[Array], Array], *, cutoff: float = CUTOFF
    ) -> None:
        """Starts with no correction.

        Args:
            guard: Limits, ramps, watches; called by the link.
            R_base_frame: (dof,) rad as displayed to the (3, 3) axes of the controller's
                correction in base.
            cutoff: Hz of the first-order low-pass.

        Raises:
            ConfigurationError: A cut-off that is not above zero.
        """
        if not (math.isfinite(cutoff) and cutoff > 0.0):
            raise ConfigurationError(f"low-pass of {cutoff:g} Hz, expected more than zero.")
        self.guard, self._axes, self._cutoff = guard, R_base_frame, cutoff
        self._smooth = np.zeros(3)
        self._time = math.nan

    def take(self, estimates: EstimateBlock) -> None:
        """Passes the latest estimate's correction, or its invalidity, to the guard."""
        for time, error, valid in zip(
            estimates.host_time.tolist(), estimates.error, estimates.valid.tolist(), strict=True
        ):
            if not valid or math.isnan(time):
                self._time = math.nan
            elif math.isnan(self._time):
                self._time, self._smooth = time, np.zeros(3)
            else:
                passed = max(0.0, time - self._time)
                share = -math.expm1(-2.0 * math.pi * self._cutoff * passed)
                self._smooth = self._smooth + share * (error - self._smooth)
                self._time = time
        if math.isnan(self._time):
            words = doubt_words(int(estimates.doubt[-1]))
            self.guard.fault(f"the estimate is not valid: {words}")
            return
        shift = -(self._axes(estimates.joints[-1]).T @ self._smooth)
        wanted = Correction(shift=shift, turn=np.zeros(3), mode=CorrectionMode.ABSOLUTE)
        self.guard.want(wanted, self._time)


def fixed_axes(R_base_frame: Array) -> Callable[[Array], Array]:
    """Returns axes that are fixed in base for any joints: the robot root, or ``$BASE``."""
    axes = np.array(R_base_frame, dtype=np.float64)
    return lambda _joints: axes


_SPACING: Final = 0.25e-3
"""m between the points a direction is taken from; encoders are good to some hundredths of that."""
_POINTS: Final = 5
_LEAP: Final = 5e-3
"""m between two calls, some 10 ms apart, beyond which this is no cut and the points restart."""
_PLUNGE: Final = 0.1
"""Sine between path and tool axis below which y and z have no direction."""


class PathAxes:
    """Returns the axes of the path in base, (3, 3), as joints arrive; x is not corrected.

    The column along the path is zero: a tool that is late is not off its path, and controllers take
    no correction along it. All columns are zero, so that nothing is corrected, until the tool has
    moved by a millimetre, after a leap, and where it plunges along its own axis. While it stands
    the last direction holds.

    Fails when: the path turns within a millimetre: the axes are those of the chord.
    """

    def __init__(self, T_base_tool: Callable[[Array], Array]) -> None:
        """Starts without a direction.

        Args:
            T_base_tool: (dof,) rad as displayed to the (4, 4) pose of the tool point.
        """
        self._pose = T_base_tool
        self._points: deque[Array] = deque(maxlen=_POINTS)
        self._along = np.zeros(3)
        self._last: Array | None = None

    def __call__(self, joints: Array) -> Array:
        """Returns the axes at these joints (dof,) rad."""
        pose = self._pose(joints)
        point = pose[:3, 3]
        if self._last is not None and np.linalg.norm(point - self._last) > _LEAP:
            self._points.clear()
            self._along = np.zeros(3)
        self._last = point
        if not self._points or np.linalg.norm(point - self._points[-1]) >= _SPACING:
            self._points.append(point)
            chord = point - self._points[0]
            length = float(np.linalg.norm(chord))
            if len(self._points) == _POINTS and length >= _SPACING:
                self._along = chord / length
        return _across(self._along, pose[:3, 2])


def _across(along: Array, tool: Array) -> Array:
    axes = np.zeros((3, 3))
    upright = tool - along * float(along @ tool)
    size = float(np.linalg.norm(upright))
    if along.any() and size > _PLUNGE:
        axes[:, 2] = upright / size
        axes[:, 1] = np.cross(axes[:, 2], along)
    return axes


def note_path(peer: str) -> Path:
    """Returns where the note of a controller lies, in the user's folder for states."""
    home = Path.home() / ".local" / "state"
    if sys.platform == "win32":
        home = Path(os.environ.get("LOCALAPPDATA", home))
    base = Path(os.environ.get("XDG_STATE_HOME") or home)
    name = "".join(c if c.isalnum() or c in ".-" else "_" for c in peer)
    return base / "robotrue" / f"corrections-{name}.json"


def begin_note(peer: str, limit: float, *, confirmed: bool) -> None:
    """Writes the note of a controller that will be corrected.

    Args:
        peer: Its address.
        limit: m that it may hold from now on.
        confirmed: The operator states that it holds no correction now.

    Raises:
        ConfigurationError: There is a note, and no confirmation.
    """
    path = note_path(peer)
    if path.exists() and not confirmed:
        try:
            before = json.loads(path.read_bytes())
            correction = f"up to {before['may_hold_mm']:.3f} mm since {before['since']}"
        except (ValueError, KeyError, TypeError):
            correction = "an unknown correction"
        raise ConfigurationError(
            f"the controller {peer} may still apply {correction}: corrections did not end at zero.",
            source=path,
            hint="restart RSI or EGM on the controller, then --confirm-zero.",
        )
    _write(path, peer, limit)


def end_note(peer: str, state: GuardState) -> str:
    """Removes the note if the robot holds no correction; otherwise returns its text."""
    path = note_path(peer)
    if state.at_rest and state.farthest == 0.0:
        path.unlink(missing_ok=True)
        return ""
    _write(path, peer, state.farthest)
    return (
        f"the controller {peer} may still apply up to {state.farthest / MM:.3f} mm; before the "
        "next corrections restart RSI or EGM on it, then --confirm-zero"
    )


def _write(path: Path, peer: str, most: float) -> None:
    document = {
        "peer": peer,
        "may_hold_mm": most / MM,
        "since": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, json.dumps(document).encode())
