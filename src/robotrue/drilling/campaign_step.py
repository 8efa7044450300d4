"""Whether the calibration plane, or the foot, moved while a campaign was made.

The rows of a campaign are in the order of its clamps. If the plane is knocked after clamp k, every
tilt that is stated from there on is off by the same angle, and no cause explains it: a step does.
The best of all steps is compared with the residuals of the regression without one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.drilling.campaign import Campaign, conditions, tilt_seen
from robotrue.drilling.foot import Foot
from robotrue.drilling.regression import columns

FEWEST: Final = 20
"""Clamps below which a step explains much by chance."""
ENDS: Final = 5
"""Clamps on either side of a step, at least."""
CLEAR: Final = 0.75
"""Share of the squared residuals a step must explain; by chance .35 of 30 clamps (simulated)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignStep(Columns):
    """A step of the stated tilts.

    Attributes:
        clamp: Number of the first clamp after it, from 1.
        tilt: (2,) rad, by which the tilts stated from there on changed against the readings.
        share: Of the squared residuals that it explains.
    """

    clamp: int
    tilt: Annotated[Array, Column("2", unit="rad")]
    share: float


def find_step(foot: Foot, campaign: Campaign) -> CampaignStep | None:
    """Returns the step that explains most of what the causes leave; None where none is clear."""
    n = len(campaign)
    if n < FEWEST:
        return None
    causes = conditions(foot, campaign.order, campaign.clamps)
    off = campaign.tilt - tilt_seen(foot, campaign.order, campaign.clamps.readings)
    basis, _ = np.linalg.qr(columns("interactions", causes)[1])
    residual = off - basis @ (basis.T @ off)
    steps = (np.arange(n)[:, None] >= np.arange(ENDS, n - ENDS + 1)).astype(float)
    steps -= basis @ (basis.T @ steps)
    size = np.maximum(np.sum(steps**2, axis=0), 1.0)
    height = steps.T @ residual / size[:, None]
    share = size * np.sum(height**2, axis=1) / max(float(np.sum(residual**2)), 1e-30)
    best = int(np.argmax(share))
    if share[best] < CLEAR:
        return None
    return CampaignStep(clamp=best + ENDS + 1, tilt=height[best], share=float(share[best]))
