"""The calibrated, loaded arm at given joints; formulae of :mod:`~compensation.calibrated_arm`.

The tests hold these kernels to a nanometre against :mod:`robotrue.robot.forward`,
:mod:`robotrue.robot.statics` and :mod:`robotrue.calibration.tables`.
"""

from __future__ import annotations

from typing import Any

from robotrue.compensation.nominal_kernels import write_theta
from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, SUMS, compiled
from robotrue.core.exponentials import exponentials
from robotrue.core.sines import sine_and_cosine
from robotrue.robot.chain import ORIGIN
from robotrue.robot.chain_kernels import multiply, walk, write_load_torque


@compiled(EXACT)
def locate(model: Any, arm: Any, reuse: float, bump: Array, w: Any) -> None:
    """Writes the nominal and the actual chain at ``joints`` of the working memory.

    Args:
        model: ``CalibratedArm``.
        arm: That of its arms which is meant.
        reuse: rad; the smooth residual is computed anew where a joint moved by more.
        bump: (m,) work space.
        w: Of ``WORK_DTYPE``.
    """
    write_theta(arm, w)
    walk(arm.nominal, w.nominal)
    write_load_torque(arm.masses, w.payload, w.wrench, w.nominal)
    _write_drive_torque(arm, w)
    for i in range(6):
        w.shift[i] = (
            arm.compliance[i] * w.drive_torque[i]
            + arm.gear[i] * w.joints[i]
            + arm.backlash[i] * w.approach[i]
        )
    if len(model.harmonics) > 0:
        if model.consecutive:
            _add_ripple(model.ripple, w)
        else:
            _add_waves(model.harmonics, model.ripple, w)
    theta = w.actual.theta
    if arm.coupled:
        multiply(arm.coupling, w.shift, theta)
    else:
        for i in range(6):
            theta[i] = w.shift[i]
    for i in range(6):
        theta[i] += w.nominal.theta[i] + arm.offset[i]
    walk(arm.actual, w.actual)
    if len(bump) > 0:
        moved = 0.0
        for i in range(6):
            moved = max(moved, abs(w.joints[i] - w.residual_at[i]))
        if not moved <= reuse:
            _write_residual(model, arm, bump, w)
        for r in range(3):
            w.actual.frame[6, r, ORIGIN] += w.residual[r]


@compiled(EXACT)
def _write_drive_torque(arm: Any, w: Any) -> None:
    """Writes the load torque on the drives (6,) N m."""
    torque = w.nominal.torque
    for i in range(6):
        if arm.coupled:
            w.drive_torque[i] = 0.0
            for k in range(6):
                w.drive_torque[i] += arm.coupling[k, i] * torque[k]
        else:
            w.drive_torque[i] = torque[i]


@compiled(EXACT)
def _add_ripple(ripple: Array, w: Any) -> None:
    """Adds A_k sin(k q) + B_k cos(k q), k = 1, 2, ..., to ``shift``, by Clenshaw's recurrence.

    Both sums of all drives are carried abreast: twelve numbers, as a row of ``ripple`` has them.
    """
    sums, before = w.sum, w.sum_before
    for i in range(6):
        w.feature[i], w.feature[6 + i] = sine_and_cosine(w.joints[i])
        w.twice_cosine[i] = w.twice_cosine[6 + i] = 2.0 * w.feature[6 + i]
    for i in range(12):
        sums[i] = before[i] = 0.0
    for k in range(len(ripple) - 1, -1, -1):
        for i in range(12):
            now = (ripple[k, i] - before[i]) + w.twice_cosine[i] * sums[i]
            before[i] = sums[i]
            sums[i] = now
    for i in range(6):
        w.shift[i] += w.feature[i] * sums[i] + w.feature[6 + i] * sums[6 + i] - before[6 + i]


@compiled(EXACT)
def _add_waves(harmonics: Array, ripple: Array, w: Any) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to ``shift``, any N_k."""
    for k in range(len(harmonics)):
        for i in range(6):
            sine, cosine = sine_and_cosine(harmonics[k] * w.joints[i])
            w.shift[i] += ripple[k, i] * sine + ripple[k, 6 + i] * cosine


@compiled(EXACT)
def _write_residual(model: Any, arm: Any, bump: Array, w: Any) -> None:
    """Writes the smooth residual sum_m W_m exp(-|s - C_m|^2 / 2), (3,) m."""
    for i in range(6):
        w.residual_at[i] = w.joints[i]
        sine, cosine = sine_and_cosine(w.joints[i])
        w.feature[i] = sine * arm.feature_scale[i]
        w.feature[6 + i] = cosine * arm.feature_scale[6 + i]
    _write_exponents(model.centres, model.half_square, w.feature, bump)
    exponentials(bump)
    _sum_bumps(model.weights, bump, w.residual)


@compiled(SUMS)
def _write_exponents(centres: Array, half_square: Array, feature: Array, bump: Array) -> None:
    """Writes -|s - C_m|^2 / 2 of all centres, four features at a time."""
    own = 0.0
    for k in range(12):
        own += feature[k] * feature[k]
    for m in range(len(bump)):
        bump[m] = -0.5 * own - half_square[m]
    for k in range(0, 12, 4):
        a, b, c, d = feature[k], feature[k + 1], feature[k + 2], feature[k + 3]
        for m in range(len(bump)):
            bump[m] += (
                a * centres[k, m] + b * centres[k + 1, m] + c * centres[k + 2, m]
                + d * centres[k + 3, m]
            )  # fmt: skip


@compiled(SUMS)
def _sum_bumps(weights: Array, bump: Array, residual: Array) -> None:
    """Writes the weighted sums (3,) of all bumps."""
    for r in range(3):
        total = 0.0
        for m in range(len(bump)):
            total += weights[r, m] * bump[m]
        residual[r] = total
