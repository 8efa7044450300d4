"""Windows of a milling pass: where the arm stood, what force acted, the error it made.

The paper's sample is a window of about a second: mean joints, peak and mean force, the error
predicted from the frequency response and the one measured. Ours adds the mean force as a vector.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns, concat
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.errors import ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSet(Columns):
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

    passes: Annotated[tuple[str, ...], Column("n")]
    joints: Annotated[Array, Column("n dof", unit="rad")]
    force: Annotated[Array, Column("n 3", unit="N")]
    force_peak: Annotated[Array, Column("n", unit="N")]
    force_mean: Annotated[Array, Column("n", unit="N")]
    predicted: Annotated[Array, Column("n", unit="m")]
    measured: Annotated[Array, Column("n", unit="m", nan=True)]
    source: str = ""
    provenance: Provenance = MEASURED

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
        return self.take(which)


def concatenate_windows(parts: Sequence[WindowSet]) -> WindowSet:
    """Returns several sets as one.

    Raises:
        ShapeError: None, or of arms with different numbers of joints.
    """
    if not parts or len({p.joints.shape[1] for p in parts}) != 1:
        raise ShapeError("window sets to join need to be of one arm, and one at least.")
    return concat(parts, source=parts[0].source, provenance=merge(p.provenance for p in parts))


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
