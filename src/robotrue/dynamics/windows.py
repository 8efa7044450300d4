"""Windows of a milling pass: where the arm stood, what force acted, the error it made.

The paper's sample is a window of about a second: mean joints, peak and mean force, the error
predicted from the frequency response and the one measured. Ours adds the mean force as a vector.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.errors import ShapeError

_OF_THE_SET: Final = ("passes", "source", "provenance")
"""Fields that are no array with a row for each window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSet:
    """Windows in the order they were cut, pass after pass.

    Attributes:
        passes: Name of the pass of each window.
        joints: (n, 6) rad, mean.
        force: (n, 3) N, mean force on the tool, base axes.
        force_peak: (n,) N, largest force of a turn of the spindle, either way along the direction
            the error is measured in, averaged over turns.
        force_mean: (n,) N, mean force along that direction.
        predicted: (n,) m, error by frequency response and force (eq. 1 of the paper).
        measured: (n,) m; NaN where nobody measured.
        source: File or experiment.
        provenance: Simulated or measured, and the files.
    """

    passes: tuple[str, ...]
    joints: Array
    force: Array
    force_peak: Array
    force_mean: Array
    predicted: Array
    measured: Array
    source: str = ""
    provenance: Provenance = MEASURED

    def __post_init__(self) -> None:
        """Freezes and checks shapes."""
        n = len(self.passes)
        object.__setattr__(self, "passes", tuple(self.passes))
        object.__setattr__(self, "joints", frozen(self.joints, (n, None), "joints"))
        object.__setattr__(self, "force", frozen(self.force, (n, 3), "force"))
        for name in ("force_peak", "force_mean", "predicted"):
            object.__setattr__(self, name, frozen(getattr(self, name), (n,), name))
        measured = frozen(self.measured, (n,), "measured", allow_nan=True)
        object.__setattr__(self, "measured", measured)

    def __len__(self) -> int:
        return len(self.passes)

    @property
    def deviation(self) -> Array:
        """(n,) m, measured less predicted, the e_0 of the paper."""
        return np.asarray(self.measured - self.predicted)

    @property
    def pass_names(self) -> tuple[str, ...]:
        """Passes in the order of their first window."""
        return tuple(dict.fromkeys(self.passes))

    @property
    def pass_index(self) -> IntArray:
        """(n,) which of :attr:`pass_names` each window is of."""
        at = {name: k for k, name in enumerate(self.pass_names)}
        return np.array([at[name] for name in self.passes], dtype=np.int64)

    def subset(self, which: IntArray | BoolArray) -> WindowSet:
        """Returns some of the windows, by index or mask."""
        rows = np.arange(len(self))[which]
        chosen: dict[str, Any] = {"passes": tuple(self.passes[i] for i in rows)}
        for field in fields(self):
            if field.name not in _OF_THE_SET:
                chosen[field.name] = getattr(self, field.name)[rows]
        return replace(self, **chosen)


def concatenated(parts: Sequence[WindowSet]) -> WindowSet:
    """Returns several sets as one.

    Raises:
        ShapeError: None, or of arms with different numbers of joints.
    """
    if not parts or len({p.joints.shape[1] for p in parts}) != 1:
        raise ShapeError("window sets to join need to be of one arm, and one at least.")
    values = {
        field.name: np.concatenate([getattr(p, field.name) for p in parts])
        for field in fields(WindowSet)
        if field.name not in _OF_THE_SET
    }
    return WindowSet(
        passes=tuple(name for p in parts for name in p.passes),
        source=parts[0].source,
        provenance=merge(p.provenance for p in parts),
        **values,
    )


def peaks_per_turn(signal: Array, samples_per_turn: float) -> Array:
    """Returns the largest value of each whole turn of the spindle (k,) of a signal (n,).

    Raises:
        ShapeError: Less than one turn.
    """
    turns = int(np.floor(len(signal) / samples_per_turn + 1e-9))
    if turns < 1:
        raise ShapeError(
            f"{len(signal)} samples, less than one turn of {samples_per_turn:.1f} samples."
        )
    edges = np.rint(np.arange(turns) * samples_per_turn).astype(np.int64)
    last = round(turns * samples_per_turn)
    return np.asarray(np.maximum.reduceat(signal[:last], edges))
