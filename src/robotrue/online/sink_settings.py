"""What every sink is told besides its address: the cell, what the data are, whose health."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from robotrue.core.provenance import MEASURED, Provenance
from robotrue.errors import ConfigurationError, MissingExtraError
from robotrue.online.link import Health

MOST_JOINTS = 12


def _nobody() -> tuple[Health, ...]:
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkSettings:
    """What a service says to its sinks.

    Attributes:
        cell: Name of the cell, in topics, titles and object trees; a word without blanks or
            ``/ + #``.
        note: Shown wherever an estimate is shown, "simulated" for one; empty says nothing.
        provenance: Of the streams and models: files of simulated estimates begin with a mark.
        joints: Joints of the arm.
        resume: Whether a file that stands there is gone on with (after a crash) or refused.
        healths: Asked once a second for the counters of the sources and sinks to be shown.
        nodesets: Folder of the OPC UA NodeSet files of the companion models; None leaves them out.
        environment: Where names, passwords and tokens are looked up.
    """

    cell: str = "cell"
    note: str = ""
    provenance: Provenance = MEASURED
    joints: int = 6
    resume: bool = False
    healths: Callable[[], Sequence[Health]] = _nobody
    nodesets: Path | None = None
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ, repr=False)

    def __post_init__(self) -> None:
        """Checks."""
        bad = sorted({c for c in self.cell if c in "/+#" or c.isspace() or not c.isprintable()})
        if bad or not self.cell:
            raise ConfigurationError(
                f"cell name {self.cell!r}, expected a word without blanks and / + #.",
                hint="name it as its machine is named: cell-3.",
            )
        if not 1 <= self.joints <= MOST_JOINTS:
            raise ConfigurationError(
                f"an arm of {self.joints} joints, expected 1 to {MOST_JOINTS}."
            )


LIVE: Final = 60.0
"""s; a sample older than this, or from later than now, is a replay and not live."""


def utc_seconds(host_time: float) -> float:
    """Returns s since 1970 in UTC at which the monotonic clock stood at ``host_time``.

    A replay has its own clock; what it gives now is stamped with now.
    """
    age = time.monotonic() - host_time
    return time.time() - (age if 0.0 <= age <= LIVE else 0.0)


def require_library(name: str, scheme: str) -> None:
    """Checks that the library of a sink is installed.

    Raises:
        MissingExtraError: It is not.
    """
    if find_spec(name) is None:
        raise MissingExtraError(f"{scheme}:// needs {name}.", hint="pip install 'robotrue[online]'")
