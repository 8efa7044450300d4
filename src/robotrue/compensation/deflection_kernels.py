"""The calibrated, loaded arm at given joints; formulae of :mod:`~compensation.calibrated_arm`.

The tests hold these kernels to a nanometre against :mod:`robotrue.robot.forward`,
:mod:`robotrue.robot.statics` and :mod:`robotrue.calibration.terms.term`.
"""

from __future__ import annotations

from robotrue.compensation.calibrated_arm import CalibratedArm
from robotrue.compensation.nominal_kernels import write_theta
from robotrue.core.arrays import Array
from robotrue.core.compiled import EXACT, SUMS, compile_kernel
from robotrue.core.sines import exponentials, sine_and_cosine
from robotrue.robot.chain import ORIGIN, Record
from robotrue.robot.chain_kernels import multiply, walk, write_load_torque


@compile_kernel(EXACT)
def locate(model: CalibratedArm, arm: Record, reuse: float, bump: Array, w: Record) -> None:
    """Writes the nominal and the actual chain at ``joints`` of the working memory.

    Args:
        model: ``CalibratedArm``.
        arm: One of its arms.
        reuse: rad; the smooth residual is computed again where a joint moved by more.
        bump: (2, m) work space.
        w: Of ``WORK_DTYPE``.
    """
    write_theta(arm, w)
    walk(arm.nominal, w.nominal)
    write_load_torque(arm.masses, w.payload, w.wrench, w.nominal)
    for i in range(6):
        torque = 0.0
        for k in range(6):
            torque += arm.coupling[k, i] * w.nominal.torque[k]
        w.shift[i] = (
            arm.compliance[i] * torque + arm.gear[i] * w.joints[i] + arm.backlash[i] * w.approach[i]
        )
    if len(model.harmonics) > 0:
        if model.consecutive:
            _add_ripple(model.ripple, w)
        else:
            _add_waves(model.harmonics, model.ripple, w)
    theta = w.actual.theta
    multiply(arm.coupling, w.shift, theta)
    for i in range(6):
        theta[i] += w.nominal.theta[i] + arm.offset[i]
    walk(arm.actual, w.actual)
    if bump.shape[1] > 0:
        moved = 0.0
        for i in range(6):
            moved = max(moved, abs(w.joints[i] - w.residual_at[i]))
        if not moved <= reuse:
            _write_residual(model, arm, bump, w)
        for r in range(3):
            w.actual.frame[6, r, ORIGIN] += w.residual[r]


@compile_kernel(EXACT)
def _add_ripple(ripple: Array, w: Record) -> None:
    """Adds A_k sin(k q) + B_k cos(k q), k = 1, 2, ..., to ``shift``, by Clenshaw's recurrence."""
    for i in range(6):
        sine, cosine = sine_and_cosine(w.joints[i])
        twice = 2.0 * cosine
        a = b = c = d = 0.0
        for k in range(len(ripple) - 1, -1, -1):
            a, b = (ripple[k, i] - b) + twice * a, a
            c, d = (ripple[k, 6 + i] - d) + twice * c, c
        w.shift[i] += sine * a + cosine * c - d


@compile_kernel(EXACT)
def _add_waves(harmonics: Array, ripple: Array, w: Record) -> None:
    """Adds A_k sin(N_k q) + B_k cos(N_k q) to ``shift``, any N_k."""
    for k in range(len(harmonics)):
        for i in range(6):
            sine, cosine = sine_and_cosine(harmonics[k] * w.joints[i])
            w.shift[i] += ripple[k, i] * sine + ripple[k, 6 + i] * cosine


@compile_kernel(EXACT)
def _write_residual(model: CalibratedArm, arm: Record, bump: Array, w: Record) -> None:
    """Writes the smooth residual sum_m W_m exp(-|s - C_m|^2 / 2), (3,) m."""
    for i in range(6):
        w.residual_at[i] = w.joints[i]
        sine, cosine = sine_and_cosine(w.joints[i])
        w.feature[i] = sine * arm.feature_scale[i]
        w.feature[6 + i] = cosine * arm.feature_scale[6 + i]
    _write_exponents(model.centres, model.half_square, w.feature, bump[0])
    exponentials(bump[0], bump[1])
    _sum_bumps(model.weights, bump[0], w.residual)


@compile_kernel(SUMS)
def _write_exponents(centres: Array, half_square: Array, feature: Array, bump: Array) -> None:
    """Writes -|s - C_m|^2 / 2 of all centres."""
    own = 0.0
    for k in range(12):
        own += feature[k] * feature[k]
    for m in range(len(bump)):
        u = -0.5 * own - half_square[m]
        for k in range(12):
            u += feature[k] * centres[k, m]
        bump[m] = u


@compile_kernel(SUMS)
def _sum_bumps(weights: Array, bump: Array, residual: Array) -> None:
    """Writes the weighted sums (3,) of all bumps."""
    x = y = z = 0.0
    for m in range(len(bump)):
        x += weights[0, m] * bump[m]
        y += weights[1, m] * bump[m]
        z += weights[2, m] * bump[m]
    residual[0], residual[1], residual[2] = x, y, z
