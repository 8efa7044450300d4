"""A learned fit of all rows, and the same refitted without some of them.

A refit costs no more than solving the linear model again: the rows left out leave the sums; scales,
noise and weights are learned anew, from where learning starts and not from what all rows learned: a
scale remembers a region that is left out (measured on a UR10: 0.18 mm in place of 0.46 mm). As
between held-out blocks, linearisation, robust weights, the bands of ripple in use and the basis of
the smooth residual are those of all rows. The width of a refit comes from the held-out rows it
still has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.estimate import Estimate
from robotrue.calibration.evidence import learn
from robotrue.calibration.held_out_blocks import (
    HeldOutRows,
    count_freedom,
    sums_without,
    widen,
)
from robotrue.calibration.learned_assembly import LinearFit, assemble_model
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import BoolArray

STEPS: Final = 12
"""Of learning without the rows left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeFit:
    """A learned fit of all rows.

    Attributes:
        physical: The estimate it began with.
        at: Design, sums and posterior weights.
        held_out: Every row predicted from the other blocks, with a factor of one.
        settings: Of the fit.
        notes: What the summary says besides.
        base: The fit it was built on by adding a smooth residual; None if it was not.
    """

    physical: Estimate
    at: LinearFit
    held_out: HeldOutRows
    settings: FitSettings
    notes: Mapping[str, object]
    base: WholeFit | None = None

    def model(self) -> CalibratedModel:
        """Returns the error model."""
        return self._assemble(self.at, widen_covariance(self.at, self.held_out))

    def refit(self, left_out: BoolArray, begin: LinearFit | None = None) -> LinearFit:
        """Returns the linear fit of the rows that are not left out.

        Args:
            left_out: Mask over the rows of the fit.
            begin: The same refit of the base, whose scales learning starts from.
        """
        design = self.at.design
        others = sums_without(design, self.at.sums, left_out)
        scales: dict[str, float] = {}
        noise = np.ones(len(others))
        if begin is not None:
            scales = {group.name: group.sd for group in begin.weights.groups}
            noise = begin.weights.noise
        weights = learn(others, design.groups(scales), noise, steps=STEPS)
        return LinearFit(design=design, sums=others, weights=weights)

    def model_of(self, refit: LinearFit, left_out: BoolArray) -> CalibratedModel:
        """Returns the error model of a refit, as wide as its own held-out rows ask for."""
        kept = ~left_out
        design = replace(refit.design, weights=refit.design.weights[kept])
        known = widen_covariance(replace(refit, design=design), self.held_out.part(kept))
        return self._assemble(refit, known)

    def _assemble(self, at: LinearFit, held_out: HeldOutRows) -> CalibratedModel:
        return assemble_model(self.physical, at, held_out, self.settings, dict(self.notes))


def widen_covariance(at: LinearFit, found: HeldOutRows) -> HeldOutRows:
    """Returns the held-out rows with the factor that the covariance of the fit gets."""
    physical = int(at.design.active[: len(at.design.free)].sum())
    freedom = count_freedom(at.sums, at.weights, physical)
    return widen(found, at.design.weights > 0.0, freedom)
