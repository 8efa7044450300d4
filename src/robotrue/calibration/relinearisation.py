"""Renewal of a linear fit at its own mean: linearisation, robust weights and noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.estimator import NOISE_FLOOR
from robotrue.calibration.learned_assembly import LinearFit
from robotrue.calibration.observations import linearise_all
from robotrue.calibration.parameters import retract
from robotrue.calibration.scale_learning import learn
from robotrue.core.robust import weights as robust_weights

ROUNDS: Final = (8, 5)
"""Steps of learning in each renewal of linearisation, weights and noise after the ladder."""
MOST_RENEWALS: Final = 6
BEND: Final = 0.1
"""Miss of the linear prediction, over the noise of a row, that a settled linearisation has."""


def renew_linearisation(at: LinearFit, *, steps: int) -> LinearFit:
    """Returns the fit with new linearisation, robust weights and noise."""
    design, fit = at.design, at.weights
    robust = np.zeros(len(design.weights))
    for item in design.rows():
        scale = np.repeat(np.sqrt(fit.noise), 3)[: item.values.shape[1]]
        off = (item.values - item.columns @ fit.mean) / scale
        robust[item.rows] = robust_weights(np.linalg.norm(off, axis=1), off.shape[1], design.loss)
    step = np.zeros(design.layout.size)
    step[design.free] = fit.mean[: len(design.free)] - design.offset
    physical = len(design.free)
    values = np.zeros(len(design.values))
    values[design.active[physical:]] = fit.mean[physical:]
    moved = replace(
        design,
        state=retract(design.layout, design.state, step),
        values=values,
        noise=np.maximum(design.white_noise(fit.noise), NOISE_FLOOR),
        weights=robust,
    )
    sums = moved.sums()
    weights = learn(sums, moved.groups(fit.scales()), np.ones(len(sums)), steps=steps)
    return LinearFit(design=moved, sums=sums, weights=weights)


def settle_linearisation(at: LinearFit) -> LinearFit:
    """Returns the fit with its linearisation renewed until the arm follows it.

    The effect of a mass moment on a compliant joint is a product of two parameters: where poses
    determine it poorly, a step is large, and the arm that was moved by it misses the points that
    the linear model fits (measured UR10, 2,218 poses: 0.28 mm instead of 0.06 mm).
    """
    for _ in range(MOST_RENEWALS):
        design = at.design
        noise = at.weights.noise[0] * (design.instrument()[0] + design.noise[0])
        if measure_bend(at) <= BEND * float(np.sqrt(noise)):
            break
        at = renew_linearisation(at, steps=ROUNDS[-1])
    return at


def measure_bend(at: LinearFit) -> float:
    """Returns the rms per axis, m, by which the arm at the fit misses the linear prediction."""
    design = at.design
    step = np.zeros(design.layout.size)
    step[design.free] = at.weights.mean[: len(design.free)] - design.offset
    moved = retract(design.layout, design.state, step)
    squares, count = 0.0, 0
    for before, after in zip(
        linearise_all(design.observations, design.layout, design.state),
        linearise_all(design.observations, design.layout, moved),
        strict=True,
    ):
        missed = after.residual - before.residual + before.jacobian @ step
        squares, count = squares + float((missed[:, :3] ** 2).sum()), count + 3 * len(missed)
    return float(np.sqrt(squares / count))
