"""Faults that simulated controllers and sensors show on demand, so that a user meets them early."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robotrue.errors import ConfigurationError

_USUAL: Final = 0.5
"""s that a fault lasts where nothing is said."""
LEAP: Final = 60.0
"""s by which a clock leaps."""


class FaultKind(enum.Enum):
    """What goes wrong; not every simulator knows every kind."""

    GAP = "gap"
    """Packets are lost: the count goes on, nothing arrives."""
    SILENCE = "silence"
    """The other side is gone: it neither sends nor answers, and comes back as after a restart."""
    REPEAT = "repeat"
    """Each packet comes twice."""
    REORDER = "reorder"
    """Packets come in swapped pairs."""
    NAN = "nan"
    """Values that are not a number."""
    SATURATION = "saturation"
    """The sensor is at the end of its range."""
    HANG = "hang"
    """Records go on while the measurement in them stands still."""
    STATUS = "status"
    """The sensor says that it is not well."""
    JUMP = "jump"
    """The sender's clock leaps by a minute and stays there."""
    GARBLE = "garble"
    """Bytes of another protocol."""
    LATE = "late"
    """Packets are held back and come in a bunch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault.

    Attributes:
        kind: What.
        start: s since the simulator began.
        duration: s.
    """

    kind: FaultKind
    start: float
    duration: float = _USUAL

    def __post_init__(self) -> None:
        """Checks."""
        if not (0.0 <= self.start < math.inf and 0.0 < self.duration < math.inf):
            raise ConfigurationError(
                f"fault {self.kind.value} from {self.start:g} s for {self.duration:g} s; both have "
                "to be finite, the second above zero."
            )


def parse_fault(text: str, known: Sequence[FaultKind]) -> Fault:
    """Returns the fault that ``KIND@START_S`` or ``KIND@START_S+DURATION_S`` names.

    Args:
        text: For example ``gap@10+0.5``.
        known: What this simulator can do.

    Raises:
        ConfigurationError: Another form, or a kind that is not known here.
    """
    kind, _, when = text.partition("@")
    start, plus, duration = when.partition("+")
    try:
        return Fault(
            kind=next(k for k in known if k.value == kind),
            start=float(start),
            duration=float(duration) if plus else _USUAL,
        )
    except (StopIteration, ValueError):
        raise ConfigurationError(
            f"fault {text!r}, expected KIND@START_S+DURATION_S with one of "
            f"{', '.join(k.value for k in known)}.",
            hint=f"--fault {known[0].value}@10+0.5",
        ) from None


def showing(faults: Sequence[Fault], kind: FaultKind, since: float) -> bool:
    """Returns whether a kind of fault shows at a time (s since the simulator began)."""
    return any(f.kind is kind and f.start <= since < f.start + f.duration for f in faults)


def clock_leap(faults: Sequence[Fault], since: float) -> float:
    """Returns s by which the sender's clock has leapt at a time (s since the simulator began)."""
    return LEAP * sum(f.kind is FaultKind.JUMP and f.start <= since for f in faults)
