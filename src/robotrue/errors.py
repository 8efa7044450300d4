"""Every error robotrue raises on purpose.

::

    RobotrueError
    ├── ConfigurationError   cell.toml, a preset name, an option
    │   └── DatabaseDownError   the database of a workspace does not answer; may pass by itself
    ├── FormatError          a file that is not what its reader expects
    ├── ImplausibleDataError readable numbers that cannot be what they claim
    ├── ShapeError           an array of the wrong shape, dtype or with NaN
    ├── ObservabilityError   the data cannot determine what was asked
    ├── ConvergenceError     an iteration that did not reach its tolerance
    ├── ReachError           a pose the robot cannot take
    ├── ModelMismatchError   two things that do not belong to the same robot or model
    ├── StepError            a compensated program with a ledge in its path
    ├── ArchiveError         a model file that is damaged or from the future
    └── MissingExtraError    an optional package that is not installed

Every message says what was wrong, the value with its unit, what is allowed, where it came from,
and one thing to try. The same facts are fields, for programs.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


class RobotrueError(Exception):
    """Root of all errors raised on purpose.

    Attributes:
        source: File the fault was found in, if any.
        line: One-based line of that file, if any.
        hint: One thing to try.
        detail: JSON values for programs, empty for most errors.
        exit_code: What the command line exits with.
    """

    exit_code = 1

    def __init__(
        self,
        message: str,
        *,
        source: str | Path | None = None,
        line: int | None = None,
        hint: str | None = None,
    ) -> None:
        self.message = message
        self.source = str(source) if source is not None else None
        self.line = line
        self.hint = hint
        self.detail: Mapping[str, object] = {}
        super().__init__(self._compose())

    def rename_source(self, source: str) -> None:
        """States another source, as the text does from now on."""
        self.source = source
        self.args = (self._compose(),)

    def _compose(self) -> str:
        place = ""
        if self.source is not None:
            place = self.source + (f":{self.line}" if self.line is not None else "") + ": "
        tail = f" Try: {self.hint}" if self.hint else ""
        return f"{place}{self.message}{tail}"


class ConfigurationError(RobotrueError):
    """A cell file, preset name or option that cannot be used."""


class DatabaseDownError(ConfigurationError):
    """The database of a workspace does not answer; it may do so again later."""


class FormatError(RobotrueError):
    """A file that is not what its reader expects: truncated, mis-encoded, wrong columns."""


class ImplausibleDataError(RobotrueError):
    """Readable numbers that cannot be what they claim: wrong unit, mirrored axes, wrong robot."""


class ShapeError(RobotrueError):
    """An array of the wrong shape or type, or with values that are not finite."""


class ObservabilityError(RobotrueError):
    """The data cannot determine what was asked; the message names the combination and its cure."""


class ConvergenceError(RobotrueError):
    """An iteration that did not reach its tolerance."""


class ReachError(RobotrueError):
    """A pose the robot cannot take: out of reach, beyond a joint limit, singular."""


class ModelMismatchError(RobotrueError):
    """Two things that do not belong together: another robot, another model, another tool."""


class StepError(RobotrueError):
    """A step between a target left alone and a compensated one, larger than allowed.

    ``detail`` holds the steps.
    """

    exit_code = 2


class ArchiveError(RobotrueError):
    """A model file that is damaged, incomplete, or written by a newer robotrue."""


class MissingExtraError(RobotrueError):
    """An optional package that is needed here and not installed."""
