"""How well a model knows the tool point over the joint ranges it was trained in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import qmc

from robotrue.calibration.model import ErrorModel, Query
from robotrue.core.arrays import Array
from robotrue.robot.forward import forward
from robotrue.robot.statics import NO_LOAD, Load
from robotrue.validation.error_map import radius_95

SAMPLES: Final = 512
"""Poses; a power of two keeps the sequence balanced."""
SEED: Final = 9283


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownPlaces:
    """Poses spread evenly over the training range.

    Attributes:
        joints: (n, dof) rad.
        position: (n, 3) m in base, of the nominal arm.
        radius: (n,) m that holds 95 % of what a compensated pose keeps.
    """

    joints: Array
    position: Array
    radius: Array


def known_places(
    model: ErrorModel, *, load: Load = NO_LOAD, samples: int = SAMPLES
) -> KnownPlaces | None:
    """Returns a sample of the training range; None where the model keeps no range.

    Poses are a scrambled Sobol sequence in the box of joint values of the training data, so not
    every one of them need be free of collisions.

    Args:
        model: Any error model.
        load: One payload.
        samples: A power of two.
    """
    stated, dof = model.training_summary().joint_range, model.robot.dof
    if stated is None or stated.shape != (2, dof):
        return None
    low, high = stated
    unit = qmc.Sobol(dof, rng=np.random.default_rng(SEED)).random(samples)
    joints = low + unit * (high - low)
    prediction = model.predict(Query(joints=joints, load=load))
    return KnownPlaces(
        joints=joints,
        position=forward(model.robot.nominal(), joints)[:, :3, 3],
        radius=radius_95(prediction.covariance),
    )
