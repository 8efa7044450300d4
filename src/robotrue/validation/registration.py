"""``register``: from touches to the part's frame, checked, judged, and tied to a model of the arm.

Touches in joints are taken through the model that is given: a calibrated one or the nominal arm.
Where there are enough of them arm, tool and frames are estimated together; else the model stays as
it is and the frame alone is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from robotrue.calibration.belief import Belief, belief_of
from robotrue.calibration.identity import identity_of
from robotrue.calibration.machined import tip_columns, unchanged_covariance
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.prior_belief import prior_belief
from robotrue.calibration.settings import FitSettings
from robotrue.cell.registration.fit import Noise, Registration
from robotrue.cell.registration.touches import fit_touches, touch_gain
from robotrue.core.arrays import Array
from robotrue.core.mesh import TriangleMesh
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError, ShapeError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.validation.registered_part import FoundFrame, RegisteredPart, judged
from robotrue.validation.touch_checks import (
    check_exchanged,
    check_mirror,
    check_on_mesh,
    check_order,
    check_pattern_of,
    check_units,
)

NOMINAL_ROBOT: Final = 0.35 * MM
"""Error per axis of a nominal arm that is no rigid motion of the part: simulated, 0.3 to 0.5 mm."""
CALIBRATED_ROBOT: Final = 0.06 * MM
"""The same of a calibrated arm whose postures are not known."""
GOOD: Final = 4.0
"""A good touch lies within this many sigma of its place."""
NOMINAL_COST: Final = (
    "The frame was found with the nominal arm, from touches too few to learn it. In simulation "
    "(20 points) such a frame machines to 0.19 mm rms on the side and in the postures it was "
    "touched in, and to 1.6 mm on another side; a calibrated arm keeps 0.09 to 0.13 mm on both. "
    "Touch each side for itself (column part), or more points, or calibrate."
)
"""What a plain frame of a nominal arm costs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """What registering is told besides arm and touches. SI.

    Attributes:
        touch: m per axis, one touch: probe, surface, hand.
        robot: m per axis, the arm's error that is no rigid motion of the part, for telling wrong
            touches; default: the model's own at the touches, or that of a nominal arm.
        tool_sigma: m per axis, how well the tip is known in the flange; 0: unchanged since the
            model was made.
        tolerance: m that machined points must keep; default: not judged.
        fit: ``auto``, ``frame`` (the model stays as it is) or ``joint``.
        T_flange_tool: (4, 4) of the tip; default: the tool of the model.
        mesh: The part; touches with a normal then lie on it.
        on_mesh: m, how far a nominal point may be off it.
        arm: Payload, repeatability and priors of the arm.
    """

    touch: float = 0.05 * MM
    robot: float | None = None
    tool_sigma: float = 0.0
    tolerance: float | None = None
    fit: Literal["auto", "frame", "joint"] = "auto"
    T_flange_tool: Array | None = None
    mesh: TriangleMesh | None = None
    on_mesh: float = 0.2 * MM
    arm: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        """Refuses sizes that cannot be.

        Raises:
            ConfigurationError: Negative, not finite, or a tolerance of 0.
        """
        for name in ("touch", "robot", "tool_sigma", "tolerance", "on_mesh"):
            value = getattr(self, name)
            least = 0.0 if name in ("robot", "tool_sigma") else 1e-9
            if value is not None and not least <= value < 0.1:
                raise ConfigurationError(
                    f"{name} is {value / MM:g} mm, expected {'0' if least == 0.0 else 'above 0'} "
                    "to 100 mm."
                )


def register(
    arm: ErrorModel | RobotModel,
    touches: ProbingSet,
    *,
    parts: Sequence[str] = ("part",),
    settings: RegistrationSettings | None = None,
) -> RegisteredPart:
    """Returns where the parts stand, with covariance, verdict and the model they belong to.

    Args:
        arm: The model that touched and that will machine; a robot is the nominal arm.
        touches: Of one part or several; their ``part`` counts ``parts``.
        parts: Names.
        settings: Noise, tool, tolerance, mesh.

    Raises:
        ObservabilityError: Collinear or coincident points, too few touches, a motion left open.
        ImplausibleDataError: Wrong units, exchanged names, a mirrored part, points off the part,
            half of the touches contradicting the rest.
        ModelMismatchError: Joints of another robot.
        ConvergenceError: A fit that comes to no rest.

    Fails when: touches of a flat pattern belong to the mirrored part: they fit it upside down.
    """
    settings = RegistrationSettings() if settings is None else settings
    _check_rows(arm, touches, parts)
    in_base = tips(arm, touches, settings)
    checked = [
        _checked(arm, touches.subset(touches.part == k), in_base[touches.part == k], settings)
        for k in range(len(parts))
    ]
    identity = identity_of(arm)
    return RegisteredPart(
        route="frame",
        frames=tuple(
            _frame(arm, name, found, settings) for name, found in zip(parts, checked, strict=True)
        ),
        identity=identity,
        touched_with=identity,
        doubts=(NOMINAL_COST,) if isinstance(arm, RobotModel) and touches.has_joints else (),
    )


def tips(
    arm: ErrorModel | RobotModel, touches: ProbingSet, settings: RegistrationSettings
) -> Array:
    """Returns where the model has the tip at every touch, (n, 3) m in base."""
    if not touches.has_joints:
        return touches.position
    return _tips_at(arm, touches.joints, settings)


def _tips_at(arm: ErrorModel | RobotModel, joints: Array, settings: RegistrationSettings) -> Array:
    robot = arm.nominal() if isinstance(arm, RobotModel) else arm.robot.nominal()
    tool = settings.T_flange_tool
    point = forward(robot if tool is None else robot.with_tool(tool), joints)[:, :3, 3]
    if isinstance(arm, RobotModel):
        return np.asarray(point)
    return np.asarray(point + arm.predict(_query(joints, robot, settings)).error)


def _query(joints: Array, robot: RobotModel, settings: RegistrationSettings) -> Query:
    """The touches as postures; another tool than the measured one is named."""
    tool = settings.T_flange_tool
    same = tool is None or np.allclose(tool, robot.T_flange_tool, rtol=0.0, atol=1e-9)
    return Query(joints=joints, load=settings.arm.payload, T_flange_tool=None if same else tool)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Checked:
    """Touches of one part that passed the checks.

    Attributes:
        touches: Of the part.
        in_base: (n, 3) m, where the tip was.
        noise: Touch and arm.
        doubts: What the checks could not rule out.
    """

    touches: ProbingSet
    in_base: Array
    noise: Noise
    doubts: tuple[str, ...]


def _check_rows(arm: ErrorModel | RobotModel, touches: ProbingSet, parts: Sequence[str]) -> None:
    robot = arm if isinstance(arm, RobotModel) else arm.robot
    if touches.has_joints and touches.joints.shape[1] != robot.dof:
        raise ModelMismatchError(
            f"{touches.joints.shape[1]} joint columns, {robot.name} has {robot.dof} joints.",
            source=touches.source.split(" sha256:")[0] or None,
            hint="one column j1_deg, j2_deg, ... per joint.",
        )
    if touches.parts != tuple(range(len(parts))):
        raise ShapeError(f"touches of parts {touches.parts}, names for {len(parts)}: {parts}.")


def _checked(
    arm: ErrorModel | RobotModel,
    touches: ProbingSet,
    in_base: Array,
    settings: RegistrationSettings,
) -> _Checked:
    check_pattern_of(touches)
    check_units(
        touches,
        in_base,
        (lambda joints: _tips_at(arm, joints, settings)) if touches.has_joints else None,
    )
    doubts: tuple[str, ...] = ()
    if settings.mesh is not None:
        doubts += check_on_mesh(touches, settings.mesh, tolerance=settings.on_mesh)
        touches = _on_mesh(touches, settings.mesh)
    noise = Noise(touch=settings.touch, robot=_robot_share(arm, touches, settings))
    check_mirror(touches, in_base, sigma=noise.sigma)
    doubts += check_order(touches, in_base, tolerance=GOOD * noise.sigma)
    return _Checked(touches=touches, in_base=in_base, noise=noise, doubts=doubts)


def _robot_share(
    arm: ErrorModel | RobotModel, touches: ProbingSet, settings: RegistrationSettings
) -> float:
    """Error per axis, m, by which the arm may be off besides a rigid motion of the part."""
    if settings.robot is not None:
        return settings.robot
    if isinstance(arm, RobotModel):
        return NOMINAL_ROBOT
    if not touches.has_joints:
        return CALIBRATED_ROBOT
    covariance = arm.predict(_query(touches.joints, arm.robot, settings)).covariance
    return float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean() / 3.0))


def _on_mesh(touches: ProbingSet, mesh: TriangleMesh) -> ProbingSet:
    """The touches with a normal as touches of the mesh: it may be curved between them."""
    on = ~touches.full
    return replace(
        touches,
        surfaces=(mesh,),
        touched=np.where(on, 0, -1),
        normal=np.full_like(touches.normal, np.nan),
    )


def _frame(
    arm: ErrorModel | RobotModel, name: str, found: _Checked, settings: RegistrationSettings
) -> FoundFrame:
    """The frame alone, the model as it is."""
    fit = fit_touches(found.touches, found.in_base, noise=found.noise)
    check_exchanged(
        found.touches,
        found.in_base,
        fit.T_base_part,
        ~fit.believed,
        tolerance=GOOD * found.noise.sigma,
    )
    fit, machined = _with_arm(arm, fit, found, settings)
    return judged(
        name,
        fit,
        found.touches.point,
        machined,
        tolerance=settings.tolerance,
        doubts=found.doubts,
    )


def _with_arm(
    arm: ErrorModel | RobotModel,
    fit: Registration,
    found: _Checked,
    settings: RegistrationSettings,
) -> tuple[Registration, Array | None]:
    """The fit with the arm's own errors in its covariance, and machined points with both.

    Neighbouring touches share the arm's error; machining in the same posture shares it too.
    """
    belief = _belief(arm, settings) if found.touches.has_joints else None
    if belief is None:
        return fit, None
    query = _query(found.touches.joints, belief.robot, settings)
    gain = touch_gain(found.touches, found.in_base, fit.T_base_part, fit.believed)
    n = len(found.touches)
    half = (tip_columns(belief, query) @ belief.root.T).reshape(3 * n, -1)
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


def _belief(arm: ErrorModel | RobotModel, settings: RegistrationSettings) -> Belief | None:
    """What is believed of the arm; None for a model that keeps no joint covariance."""
    if isinstance(arm, RobotModel):
        robot = arm if settings.T_flange_tool is None else arm.with_tool(settings.T_flange_tool)
        return prior_belief(robot.nominal(), settings.arm)
    try:
        return belief_of(arm)
    except ConfigurationError:
        return None
