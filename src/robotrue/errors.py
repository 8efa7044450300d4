"""All error classes of robotrue.

::

    RobotrueError
    ├── ConfigurationError   cell.toml, a preset name, an option
    │   └── DatabaseDownError   the database of a workspace does not answer; may pass by itself
    ├── FormatError          a file that is not what its reader expects
    ├── ImplausibleDataError readable but impossible numbers
    ├── ShapeError           an array of the wrong shape, dtype or with NaN
    ├── ObservabilityError   the data do not determine a requested quantity
    ├── ConvergenceError     an iteration that did not reach its tolerance
    ├── ReachError           an unreachable pose
    ├── ModelMismatchError   two objects of different robots or models
    ├── StepError            a compensated program with a step in its path
    ├── ArchiveError         a damaged model file, or one of a newer robotrue
    └── MissingExtraError    an optional package that is not installed

Every message states the fault, the value with its unit, the allowed values, the source, and a
remedy. Programs read the same facts from fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


class RobotrueError(Exception):
    """Root of all error classes.

    Attributes:
        source: File with the fault, if any.
        line: One-based line of that file, if any.
        hint: Remedy.
        detail: JSON values for programs, empty for most errors.
        exit_code: Exit code of the command line.
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
    """The database of a workspace does not answer; a later attempt may succeed."""


class FormatError(RobotrueError):
    """A file that is not what its reader expects: truncated, mis-encoded, wrong columns."""


class ImplausibleDataError(RobotrueError):
    """Readable but impossible numbers: wrong unit, mirrored axes, wrong robot."""


class ShapeError(RobotrueError):
    """An array of the wrong shape or type, or with values that are not finite."""


class ObservabilityError(RobotrueError):
    """The data do not determine a requested quantity; the message names it and a remedy."""


class ConvergenceError(RobotrueError):
    """An iteration that did not reach its tolerance."""


class ReachError(RobotrueError):
    """An unreachable pose: out of reach, beyond a joint limit, singular."""


class ModelMismatchError(RobotrueError):
    """Two objects that do not match: another robot, another model, another tool."""


class StepError(RobotrueError):
    """A step between an uncompensated and a compensated target, larger than allowed.

    ``detail`` holds the steps.
    """

    exit_code = 2


class ArchiveError(RobotrueError):
    """A model file that is damaged, incomplete, or written by a newer robotrue."""


class MissingExtraError(RobotrueError):
    """A required optional package that is not installed."""
