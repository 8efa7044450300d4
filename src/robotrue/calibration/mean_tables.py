"""The mean of an error model as flat arrays: what a scalar kernel can evaluate in a microsecond.

    q_drive  = (1 + gear) q + ripple(q) + backlash * approach + compliance * torque(q, load)
    T_actual = chain(theta = joint_map @ q_drive + theta_0 + dtheta) ; p += residual(q)

with ``ripple_i(q_i) = sum_k A[i, k] sin(N_k q_i) + B[i, k] cos(N_k q_i)`` and
``residual(q) = sum_m W[m] exp(-|s(q) - C[m]|^2 / 2)``, ``s(q) = scale * [sin q, cos q]``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.robot.model import RobotModel


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanTables(Columns):
    """Mean of a rigid-flexible model with joint ripple and a smooth residual.

    Attributes:
        robot: The actual robot: nominal geometry plus identified errors.
        harmonics: (h,) cycles per revolution N.
        ripple_sin: (dof, h) rad, A.
        ripple_cos: (dof, h) rad, B.
        backlash: (dof,) rad per unit of approach sign.
        centres: (m, 2 dof) scaled feature centres C; m = 0 without a smooth residual.
        scale: (2 dof,) 1 / length of each feature.
        weights: (m, 3) m, W, base axes.
    """

    robot: RobotModel
    harmonics: Annotated[Array, Column("h")]
    ripple_sin: Annotated[Array, Column("dof h", unit="rad")]
    ripple_cos: Annotated[Array, Column("dof h", unit="rad")]
    backlash: Annotated[Array, Column("dof", unit="rad")]
    centres: Annotated[Array, Column("m features")]
    scale: Annotated[Array, Column("features")]
    weights: Annotated[Array, Column("m 3", unit="m")]

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        dof = self.robot.dof
        self._check_columns(dof=dof, features=2 * dof)


def rigid_tables(robot: RobotModel) -> MeanTables:
    """Returns tables without ripple, backlash or residual: geometry and compliance alone."""
    dof = robot.dof
    return MeanTables(
        robot=robot,
        harmonics=np.zeros(0),
        ripple_sin=np.zeros((dof, 0)),
        ripple_cos=np.zeros((dof, 0)),
        backlash=np.zeros(dof),
        centres=np.zeros((0, 2 * dof)),
        scale=np.ones(2 * dof),
        weights=np.zeros((0, 3)),
    )
