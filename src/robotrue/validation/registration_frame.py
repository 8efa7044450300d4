"""Registration with the arm's model as it is: the frame alone, doubted as far as the arm is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, add_variance
from robotrue.calibration.machined import tip_columns, unchanged_covariance
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.priors import prior_belief
from robotrue.cell.registration.fit import Noise, Registration
from robotrue.cell.registration.symmetry import symmetric_alternatives
from robotrue.cell.registration.touches import fit_touches, touch_gain
from robotrue.core.arrays import Array
from robotrue.core.rotations import skew
from robotrue.core.units import DEG, MM
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.validation.registered_part import FoundFrame, check_frame
from robotrue.validation.registration_settings import TOOL, RegistrationSettings
from robotrue.validation.touch_checks import check_exchanged, list_names

NOMINAL_ROBOT: Final = 0.35 * MM
"""Error per axis of a nominal arm that is no rigid motion of the part: simulated, 0.3 to 0.5 mm."""
CALIBRATED_ROBOT: Final = 0.06 * MM
"""The same of a calibrated arm whose postures are not known."""
GOOD: Final = 4.0
"""A good touch lies within this many sigma of its place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedTouches:
    """Touches of one part that passed the checks.

    Attributes:
        name: Of the part.
        touches: Of the part.
        in_base: (n, 3) m, where the model has the tip.
        noise: Touch and arm.
        doubts: What the checks could not rule out.
    """

    name: str
    touches: ProbingSet
    in_base: Array
    noise: Noise
    doubts: tuple[str, ...]


def tips(arm: ErrorModel, joints: Array, settings: RegistrationSettings) -> Array:
    """Returns where the model has the tip at joints (n, dof) rad, (n, 3) m in base."""
    robot = arm.robot.nominal()
    tool = settings.T_flange_tool
    point = forward(robot if tool is None else robot.with_tool(tool), joints)[:, :3, 3]
    if not arm.calibrated:
        return np.asarray(point)
    return np.asarray(point + arm.predict(touch_query(joints, robot, settings)).error)


def same_tool(robot: RobotModel, settings: RegistrationSettings) -> bool:
    """Returns whether the tip that touches is the point the model speaks of."""
    tool = settings.T_flange_tool
    return tool is None or np.allclose(tool, robot.T_flange_tool, rtol=0.0, atol=1e-9)


def touch_query(joints: Array, robot: RobotModel, settings: RegistrationSettings) -> Query:
    """Returns the touches as postures; another tool than the measured one is named."""
    return Query(
        joints=joints,
        load=settings.arm.payload,
        T_flange_tool=None if same_tool(robot, settings) else settings.T_flange_tool,
    )


def robot_share(arm: ErrorModel, touches: ProbingSet, settings: RegistrationSettings) -> float:
    """Returns m per axis by which the arm may be off besides a rigid motion of the part.

    With joints from what is believed of the arm: small where all touches have one posture, up to a
    millimetre of a nominal arm that touches from all sides.
    """
    if settings.robot is not None:
        return settings.robot
    belief = arm_belief(arm, settings) if touches.has_joints else None
    if belief is None:
        return CALIBRATED_ROBOT if arm.calibrated else NOMINAL_ROBOT
    query = touch_query(touches.joints, belief.robot, settings)
    off = (tip_columns(belief, query) @ belief.root.T).reshape(3 * len(touches), -1)
    base = tips(arm, touches.joints, settings)
    lever = base - base.mean(axis=0)
    shift = np.broadcast_to(np.eye(3), (len(base), 3, 3))
    rigid = np.concatenate([shift, -skew(lever)], axis=2).reshape(-1, 6)
    left = off - rigid @ np.linalg.lstsq(rigid, off, rcond=None)[0]
    distorted = (left**2).sum() / max(len(left) - 6, 1)
    visit = belief.white**2 + belief.repeatability**2
    return float(np.sqrt(belief.inflation * (distorted + visit)))


def frame_alone(
    arm: ErrorModel, found: CheckedTouches, settings: RegistrationSettings
) -> FoundFrame:
    """Returns the frame of one part, the model of the arm left as it is.

    Raises:
        ObservabilityError: A motion left open.
        ImplausibleDataError: Exchanged names, or half the touches against the rest.
        ConvergenceError: No rest.
    """
    fit = fit_touches(found.touches, found.in_base, noise=found.noise)
    check_exchanged(
        found.touches,
        found.in_base,
        fit.T_base_part,
        ~fit.believed,
        tolerance=GOOD * found.noise.sigma,
    )
    doubts = found.doubts + other_poses(found.touches, found.in_base, fit)
    belief = arm_belief(arm, settings) if found.touches.has_joints else None
    machined = None
    if belief is not None:
        fit, machined = _with_arm(belief, fit, found, settings)
    return check_frame(
        found.name,
        fit,
        found.touches.point,
        machined,
        tolerance=settings.tolerance,
        doubts=doubts,
    )


def other_poses(touches: ProbingSet, in_base: Array, fit: Registration) -> tuple[str, ...]:
    """Returns a doubt where the touched mesh looks the same in another pose.

    Where three feature points are touched their names decide, and nothing is said.
    """
    on = touches.touched != NO_SURFACE
    if int(touches.full.sum()) >= 3 or not on.any():
        return ()
    names = tuple(label for label, mine in zip(touches.labels, on, strict=True) if mine)
    found = symmetric_alternatives(
        touches.subset(on), in_base[on], fit.T_base_part, sigma=fit.sigma, believed=fit.believed[on]
    )
    if not found:
        return ()
    turns = "; ".join(
        f"{a.angle / DEG:.0f} deg about ({', '.join(f'{v + 0.0:+.2f}' for v in a.axis_in_part)})"
        for a in found
    )
    return (
        f"The touches {list_names(names)} fit the part as well turned by {turns}; only their "
        "nominal points say which. Touch a feature that the other side does not have.",
    )


def _with_arm(
    belief: Belief, fit: Registration, found: CheckedTouches, settings: RegistrationSettings
) -> tuple[Registration, Array]:
    """The fit with the arm's own errors in its covariance, and machined points with both.

    Neighbouring touches share the arm's error; machining in the same posture shares it too.
    """
    query = touch_query(found.touches.joints, belief.robot, settings)
    gain = touch_gain(found.touches, found.in_base, fit.T_base_part, fit.believed)
    half = (tip_columns(belief, query) @ belief.root.T).reshape(gain.shape[1], -1)
    visit = belief.white**2 + belief.repeatability**2 + settings.touch**2
    lifted = gain @ half
    covariance = belief.inflation * (lifted @ lifted.T + visit * gain @ gain.T)
    machined = unchanged_covariance(
        belief,
        query,
        query,
        points=found.touches.point,
        T_base_part=fit.T_base_part,
        gain=gain,
        touch_sigma=settings.touch,
    )
    return replace(fit, covariance=0.5 * (covariance + covariance.T)), machined


def arm_belief(arm: ErrorModel, settings: RegistrationSettings) -> Belief | None:
    """Returns what is believed of the arm; None for a model that keeps no joint covariance."""
    if arm.calibrated:
        belief = arm.belief()
        if belief is None:
            return None
        variance = np.zeros(len(belief.mean))
        variance[parameter_slice(belief.robot.dof, "tool")][:3] = (settings.tool_sigma or 0.0) ** 2
        return add_variance(belief, variance)
    robot = arm.robot
    if settings.T_flange_tool is not None:
        robot = robot.with_tool(settings.T_flange_tool)
    known = TOOL if settings.tool_sigma is None else max(settings.tool_sigma, 1e-6)
    scales = replace(settings.arm.scales, tool=known)
    return prior_belief(robot.nominal(), replace(settings.arm, scales=scales))
