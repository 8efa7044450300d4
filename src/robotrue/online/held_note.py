"""A note on disk while a robot may hold a correction, so that no later start forgets it.

Written before corrections begin, removed when they have ended at zero. A service that was killed,
lost its robot, or does not know what the robot holds leaves it; the next one asks the operator.
"""

from __future__ import annotations

import json
import os
import sys
from datetime import UTC, datetime
from pathlib import Path

from robotrue.core.files import write_atomic
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.online.guard import GuardState


def note_path(peer: str) -> Path:
    """Returns where the note of a controller lies, in the user's folder for states."""
    home = Path.home() / ".local" / "state"
    if sys.platform == "win32":
        home = Path(os.environ.get("LOCALAPPDATA", home))
    base = Path(os.environ.get("XDG_STATE_HOME") or home)
    name = "".join(c if c.isalnum() or c in ".-" else "_" for c in peer)
    return base / "robotrue" / f"corrections-{name}.json"


def begin_note(peer: str, limit: float, *, confirmed: bool) -> None:
    """Writes the note of a controller that is going to be corrected.

    Args:
        peer: Its address.
        limit: m that it may hold from now on.
        confirmed: The operator says that it holds no correction now.

    Raises:
        ConfigurationError: There is a note, and nobody confirmed.
    """
    path = note_path(peer)
    if path.exists() and not confirmed:
        try:
            before = json.loads(path.read_bytes())
            told = f"up to {before['may_hold_mm']:.3f} mm since {before['since']}"
        except (ValueError, KeyError, TypeError):
            told = "an unknown correction"
        raise ConfigurationError(
            f"the controller {peer} may still hold {told}: corrections did not end at zero.",
            source=path,
            hint="start RSI or EGM anew on the controller, then --confirm-zero.",
        )
    _write(path, peer, limit)


def end_note(peer: str, state: GuardState) -> str:
    """Removes the note where the robot was left without correction; else returns what is left."""
    path = note_path(peer)
    if state.at_rest and state.farthest == 0.0:
        path.unlink(missing_ok=True)
        return ""
    _write(path, peer, state.farthest)
    return (
        f"the controller {peer} may still hold up to {state.farthest / MM:.3f} mm; before the next "
        "corrections start RSI or EGM anew on it, then --confirm-zero"
    )


def _write(path: Path, peer: str, most: float) -> None:
    document = {
        "peer": peer,
        "may_hold_mm": most / MM,
        "since": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, json.dumps(document).encode())
