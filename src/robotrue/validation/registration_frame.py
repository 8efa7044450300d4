"""Registration with the arm's model as it is: the frame alone, with the warnings of the arm."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from robotrue.calibration.belief import Belief, add_variance
from robotrue.calibration.machined import tip_columns, unchanged_covariance
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.settings import FitSettings, prior_belief
from robotrue.cell.registration.ambiguity import symmetric_alternatives
from robotrue.cell.registration.fit import Noise, Registration, point_residuals
from robotrue.core.arrays import Array
from robotrue.core.poses import displacement_columns
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.validation.registered_part import FoundFrame, check_frame
from robotrue.validation.registration_methods import Method, fit_by_method
from robotrue.validation.touch_checks import check_exchanged, list_names
from robotrue.validation.validation_defaults import REGISTRATION_FIT, REGISTRATION_METHOD, TOUCH_MM

TOUCH: Final = TOUCH_MM * MM
"""One touch, per axis: a tip or ball by hand or by a trigger."""
TOOL: Final = 0.3 * MM
"""A tip whose place in the flange comes from a drawing or a pointing exercise, per axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """Noise, tool, tolerance, mesh. SI.

    Attributes:
        touch: m per axis, one touch: probe, surface, hand; without the arm.
        robot: m per axis, the arm's error beyond a rigid motion of the part, for detecting wrong
            touches; default: the model's own at the touches, or that of a nominal arm.
        tool_sigma: m per axis, uncertainty of the tip in the flange; 0: unchanged since the model
            was made. Default: 0 where the tip is the point the model was made with, else 0.3 mm.
        tolerance: m that machined points must meet; default: not checked.
        fit: ``auto``, ``frame`` (the model stays as it is) or ``joint``.
        method: How the frame alone is fitted to the touches; only ``touches`` goes with ``joint``.
        T_flange_tool: (4, 4) of the tip; default: the tool of the model.
        mesh: The part; touches with a normal then lie on it.
        on_mesh: m, largest distance of a nominal point from it.
        arm: Payload, repeatability and priors of the arm.
        belief: Prior of a nominal arm, where it is more than those priors.
    """

    touch: float = TOUCH
    robot: float | None = None
    tool_sigma: float | None = None
    tolerance: float | None = None
    fit: Literal["auto", "frame", "joint"] = REGISTRATION_FIT
    method: Method = REGISTRATION_METHOD
    T_flange_tool: Array | None = None
    mesh: TriangleMesh | None = None
    on_mesh: float = 0.2 * MM
    arm: FitSettings = field(default_factory=FitSettings)
    belief: Belief | None = None

    def __post_init__(self) -> None:
        """Refuses invalid sizes.

        Raises:
            ConfigurationError: Negative, not finite, or 0 where nothing is exact.
        """
        for name, zero in (
            ("touch", False),
            ("robot", True),
            ("tool_sigma", True),
            ("tolerance", False),
            ("on_mesh", False),
        ):
            value = getattr(self, name)
            if value is not None and not (0.0 if zero else 1e-9) <= value < 0.1:
                raise ConfigurationError(
                    f"{name.replace('_', ' ')} is {value / MM:g} mm, expected "
                    f"{'0' if zero else 'above 0'} to 100 mm.",
                    hint="sizes are in mm on the command line and in m in Python.",
                )
        if self.fit not in ("auto", "frame", "joint"):
            raise ConfigurationError(
                f"fit {self.fit!r}, expected auto, frame or joint.", hint="--fit auto"
            )
        if self.fit == "joint" and self.method != REGISTRATION_METHOD:
            raise ConfigurationError(
                f"method {self.method} makes the frame alone, fit joint estimates the arm as well.",
                hint="--fit frame, or leave the method out.",
            )


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
    """Returns whether the touching tip is the tool point of the model."""
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
    """Returns the arm's error beyond a rigid motion of the part, m per axis.

    With joints it follows from the arm's prior: small where all touches have one posture, up to a
    millimetre for a nominal arm that touches from all sides.
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
    rigid = displacement_columns(lever).reshape(-1, 6)
    left = off - rigid @ np.linalg.lstsq(rigid, off, rcond=None)[0]
    distorted = (left**2).sum() / max(len(left) - 6, 1)
    visit = belief.white**2 + belief.repeatability**2
    return float(np.sqrt(belief.inflation * (distorted + visit)))


def frame_alone(
    arm: ErrorModel,
    found: CheckedTouches,
    settings: RegistrationSettings,
    *,
    placed: Array | None = None,
    reasons: tuple[str, ...] = (),
) -> FoundFrame:
    """Returns the frame of one part; the model of the arm is unchanged.

    Args:
        arm: The model.
        found: The touches.
        settings: Noise, tool, tolerance, method.
        placed: (4, 4) ``T_base_part`` stated in addition to the touches; default: their fit.
        reasons: Against cutting, found elsewhere.

    Raises:
        ObservabilityError: An undetermined motion.
        ImplausibleDataError: Exchanged names, or half the touches against the others.
        ConvergenceError: No convergence.
    """
    fit, gain = fit_by_method(settings.method, found.touches, found.in_base, noise=found.noise)
    if placed is not None:
        left = point_residuals(placed, found.touches.point, found.in_base)
        fit = replace(fit, T_base_part=placed, residuals=left)
    belief = arm_belief(arm, settings) if found.touches.has_joints else None
    machined = None
    if belief is not None:
        fit, machined = _with_arm(belief, fit, gain, found, settings)
    return finish_frame(found, fit, machined, settings.tolerance, reasons)


def finish_frame(
    found: CheckedTouches,
    fit: Registration,
    machined: Array | None,
    tolerance: float | None,
    reasons: tuple[str, ...] = (),
) -> FoundFrame:
    """Returns a fitted frame with its verdict; touches that fit each other's place raise.

    Args:
        found: The touches, where the model that was fitted has the tip.
        fit: The frame.
        machined: (n, 3, 3) m^2 in part; None takes the frame's share alone.
        tolerance: m that machined points must keep with 95 %; None: not checked.
        reasons: Against cutting, found elsewhere.
    """
    check_exchanged(
        found.touches,
        found.in_base,
        fit.T_base_part,
        ~fit.believed,
        tolerance=GOOD * found.noise.sigma,
    )
    return check_frame(
        found.name,
        fit,
        found.touches.point,
        machined,
        tolerance=tolerance,
        reasons=reasons,
        doubts=found.doubts + _other_poses(found.touches, found.in_base, fit),
    )


def _other_poses(touches: ProbingSet, in_base: Array, fit: Registration) -> tuple[str, ...]:
    """Returns a warning where the touched mesh looks the same in another pose.

    Where three feature points are touched their names decide, without a warning.
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
        f"The touches {list_names(names)} fit the part equally well when it is turned by {turns}; "
        "only their nominal points decide. Probe a feature that the other side does not have.",
    )


def _with_arm(
    belief: Belief,
    fit: Registration,
    gain: Array,
    found: CheckedTouches,
    settings: RegistrationSettings,
) -> tuple[Registration, Array]:
    """The fit with the arm's own errors in its covariance, and machined points with both.

    Neighbouring touches share the arm's error; machining in the same posture shares it too.
    """
    query = touch_query(found.touches.joints, belief.robot, settings)
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
    """Returns the prior of the arm; None for a model without joint covariance."""
    if arm.calibrated:
        belief = arm.belief()
        if belief is None:
            return None
        variance = np.zeros(len(belief.mean))
        variance[parameter_slice(belief.robot.dof, "tool")][:3] = (settings.tool_sigma or 0.0) ** 2
        return add_variance(belief, variance)
    if settings.belief is not None:
        return settings.belief
    robot = arm.robot
    if settings.T_flange_tool is not None:
        robot = robot.with_tool(settings.T_flange_tool)
    known = TOOL if settings.tool_sigma is None else max(settings.tool_sigma, 1e-6)
    scales = replace(settings.arm.scales, tool=known)
    return prior_belief(robot.nominal(), replace(settings.arm, scales=scales))
