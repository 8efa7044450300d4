"""Working memory of the kernels: one array per quantity, so that no view is made in the loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robotrue.compensation.pack import Pack
from robotrue.core.arrays import Array


class Scratch(NamedTuple):
    """Everything one target needs while it is solved; (6,) unless said."""

    nominal: Array  # (7, 12) C_0..C_6 with the tool of the target
    actual: Array  # (7, 12)
    sine: Array  # of q
    cosine: Array
    start_sine: Array  # of the nominal q
    start_cosine: Array
    theta_sine: Array
    theta_cosine: Array
    bent_sine: Array  # of theta of the actual arm
    bent_cosine: Array
    shift: Array  # torque, then drive-side shift
    step: Array  # q minus nominal q
    smooth_at: Array  # step at which the smooth residual was evaluated
    error: Array
    spare: Array
    joints: Array
    theta: Array
    trial: Array
    told: Array  # (12,) nominal pose
    real: Array  # (12,) actual pose
    target: Array  # (12,)
    hand: Array  # (12,)
    axis: Array  # (6, 3) of the actual arm
    origin: Array  # (6, 3)
    told_axis: Array  # (6, 3)
    told_origin: Array  # (6, 3)
    moment: Array  # (6, 3)
    jacobian: Array  # (6, 6)
    inverse: Array  # (6, 6)
    order: Array  # (6,) pivots
    bump_power: Array  # (m,)
    bump: Array  # (m,)
    smooth: Array  # (3,)
    centre: Array  # (3,)
    payload: Array  # (3,)


_SHAPES = {
    "nominal": (7, 12), "actual": (7, 12), "told": (12,), "real": (12,), "target": (12,),
    "hand": (12,), "axis": (6, 3), "origin": (6, 3), "told_axis": (6, 3), "told_origin": (6, 3),
    "moment": (6, 3), "jacobian": (6, 6), "inverse": (6, 6),
    "smooth": (3,), "centre": (3,), "payload": (3,),
}  # fmt: skip


def scratch(pack: Pack) -> Scratch:
    """Returns working memory for one thread."""
    count = len(pack.centre_bias)
    shapes = {name: _SHAPES.get(name, (6,)) for name in Scratch._fields}
    shapes["bump"] = shapes["bump_power"] = (count,)
    return Scratch(**{name: np.zeros(shape) for name, shape in shapes.items()})
