"""Tool point and tool axis from touches in joints, with the arm's errors in their uncertainty.

From a probed table (Feng, Liang, Xi 2018, eq. 5-8): each touch of a known point of the table with
the tool's tip gives the whole tool point, so one orientation is enough, and errors of the arm
common to probe and tool cancel. From one unmeasured fixed point: three orientations or more. A
touch with the tip does not determine the turn about the tool's axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

import numpy as np
from scipy.stats import chi2

from robotrue.calibration.belief import Belief
from robotrue.calibration.machined import tip_columns
from robotrue.calibration.model import ErrorModel, Query
from robotrue.cell.registration.fit import Registration
from robotrue.cell.registration.tool import fit_tool_point
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, displacement_columns, pose
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.validation.part_registration import check_rows, check_touches
from robotrue.validation.registration_frame import (
    RegistrationSettings,
    arm_belief,
    tips,
    touch_query,
)
from robotrue.validation.registration_methods import fit_by_method
from robotrue.validation.touch_checks import file_of, naming

ONE_PLACE: Final = 1e-6
"""m; nominal points closer together are one place."""
WRONG: Final = 0.9999
"""A touch further off than a good one in this share of cases is refused."""
STEPS: Final = 3
LEVER: Final = 1.0
"""m, between the two points whose motion shows the arm's attitude error."""
MOST_APART: Final = 5.0 * DEG
"""Largest angle of one squaring from the mean of all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedTool(Columns):
    """A tool point.

    Attributes:
        p_flange_tool: (3,) m.
        covariance: (3, 3) m^2 in flange axes: touches, table, arm.
        names: Of the touches.
        residuals: (n, 3) m in base, predicted minus touched position of the tip.
        table: Frame of the table; None: an unmeasured fixed point.
        doubts: What the touches do not determine, one sentence each.
    """

    p_flange_tool: Annotated[Array, Column("3", unit="m")]
    covariance: Annotated[Array, Column("3 3", unit="m^2")]
    names: Annotated[tuple[str, ...], Column("n")]
    residuals: Annotated[Array, Column("n 3", unit="m")]
    table: Registration | None = None
    doubts: tuple[str, ...] = ()

    @property
    def region(self) -> float:
        """m, the tool point lies within this of the truth 95 times in 100 or more."""
        return float(np.sqrt(chi2.ppf(0.95, 3) * np.linalg.eigvalsh(self.covariance)[-1]))

    @property
    def rms(self) -> float:
        """Root mean square distance of the residuals, m."""
        return float(np.sqrt((self.residuals**2).sum(axis=1).mean()))


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedAxis(Columns):
    """A tool axis.

    Attributes:
        axis_in_flange: (3,) unit vector, out of the spindle.
        covariance: (3, 3) rad^2 of it; zero along itself.
        names: Of the squarings, or of the two gauges.
        residuals: (n,) rad, angle of each squaring from the mean; empty for gauges.
    """

    axis_in_flange: Annotated[Array, Column("3")]
    covariance: Annotated[Array, Column("3 3")]
    names: tuple[str, ...]
    residuals: Annotated[Array, Column("n", unit="rad")]

    @property
    def region(self) -> float:
        """rad, the axis lies within this of the truth 95 times in 100 or more."""
        return float(np.sqrt(chi2.ppf(0.95, 2) * np.linalg.eigvalsh(self.covariance)[-1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class _FoundTip:
    """A tool point and what its errors come from.

    Attributes:
        tool: It.
        arm: (3, r) m, its step per unit of every independent error of the arm.
        own: (3, 3n) its step per error of its touches.
        table: (3, 3m) its step per error of the table's touches; (3, 0) without a table.
    """

    tool: CalibratedTool
    arm: Array
    own: Array
    table: Array


def calibrate_tool(
    arm: ErrorModel,
    touches: ProbingSet,
    *,
    table: ProbingSet | None = None,
    settings: RegistrationSettings | None = None,
) -> CalibratedTool:
    """Returns the tool point from touches with its tip.

    Args:
        arm: The model that touched; :class:`NominalModel` without one.
        touches: In joints, with the tool: of points of the table, or of one fixed point.
        table: In joints or base, with the probe whose tip ``settings`` names: three points of the
            table or more. Not given: all touches are of one place.
        settings: Noise, the probe, the tip roughly (the model's tool if not given).

    Raises:
        ConfigurationError: Touches without joints, or with normals; several places, no table.
        ObservabilityError: Too few touches or orientations.
        ImplausibleDataError: Wrong units, exchanged points, a touch that is not of this table.
        ModelMismatchError: Joints of another robot.
    """
    settings = RegistrationSettings() if settings is None else settings
    (found,) = _find_tips(arm, (touches,), table, settings)
    return found.tool


def _find_tips(
    arm: ErrorModel,
    gauges: tuple[ProbingSet, ...],
    table: ProbingSet | None,
    settings: RegistrationSettings,
) -> list[_FoundTip]:
    """The tip of each gauge, about a fixed point or from the table."""
    for touches in gauges:
        _check_touches(arm, touches)
    out = []
    if table is None:
        for touches in gauges:
            with naming(touches):
                out.append(_about_fixed_point(arm, touches, settings))
        return out
    check_rows(arm, table, ("table",))
    if not table.has_joints:
        raise ConfigurationError(
            "the touches of the table are measured points; the arm's share of a tool point needs "
            "the joints they were touched with.",
            source=file_of(table),
            hint="columns j1_deg, j2_deg, ... at each touch.",
        )
    with naming(table):
        found = check_touches(arm, "table", table, settings)
        frame, gain = fit_by_method("touches", table, found.in_base, noise=found.noise)
    for touches in gauges:
        with naming(touches):
            out.append(_from_table(arm, touches, table, frame, gain, settings))
    return out


def _check_touches(arm: ErrorModel, touches: ProbingSet) -> None:
    check_rows(arm, touches, ("tool",))
    if not touches.has_joints or not touches.full.all():
        lack = "joints" if not touches.has_joints else "only points: a normal fixes one direction"
        raise ConfigurationError(
            f"touches with a tool's tip need {lack}.",
            source=file_of(touches),
            hint="name,px_mm,py_mm,pz_mm,j1_deg,j2_deg,...",
        )


def _from_table(
    arm: ErrorModel,
    touches: ProbingSet,
    table: ProbingSet,
    frame: Registration,
    gain: Array,
    settings: RegistrationSettings,
) -> _FoundTip:
    """Eq. 7-8: the tip is where the table's point is."""
    place = apply(frame.T_base_part, touches.point)
    flange = arm.robot.nominal().with_tool(np.eye(4))
    turn = forward(flange, touches.joints)[:, :3, :3]
    tool = np.zeros(3)
    for _ in range(STEPS):  # a model's attitude error acts on the length of the tool
        off = place - tips(arm, touches.joints, _with_tip(settings, tool))
        tool = tool + np.einsum("nji,nj->ni", turn, off).mean(axis=0)
    residuals = tips(arm, touches.joints, _with_tip(settings, tool)) - place
    n = len(touches)
    half, lift, visit = _joint_errors(arm, touches, table, frame, gain, tool, settings)
    white = visit * (lift @ lift.T + np.eye(3 * n))
    mean = np.concatenate(list(np.swapaxes(turn, 1, 2)), axis=1) / n
    lifted = mean @ half
    covariance = lifted @ lifted.T + mean @ white @ mean.T
    own = np.eye(3 * n) - np.concatenate(list(turn), axis=0) @ mean
    spread = own @ (half @ half.T + white) @ own.T
    _check_residuals(touches, residuals, spread)
    doubts = () if n > 1 else ("One touch has no redundancy: probe more points.",)
    found = CalibratedTool(
        p_flange_tool=tool,
        covariance=0.5 * (covariance + covariance.T),
        names=touches.labels,
        residuals=residuals,
        table=frame,
        doubts=doubts,
    )
    return _FoundTip(tool=found, arm=lifted, own=mean, table=mean @ lift)


def _joint_errors(
    arm: ErrorModel,
    touches: ProbingSet,
    table: ProbingSet,
    frame: Registration,
    gain: Array,
    tool: Array,
    settings: RegistrationSettings,
) -> tuple[Array, Array, float]:
    """Errors of place less tip: root (3n, r) of what probe and tool share.

    Then the step (3n, 3m) of the places per error of the table's touches, and the variance of one
    touch.
    """
    belief = _belief(arm, settings)
    probed = _tip_roots(belief, touch_query(table.joints, belief.robot, settings))
    tipped = _tip_roots(belief, _tool_query(touches.joints, tool, settings))
    lever = touches.point @ frame.T_base_part[:3, :3].T
    lift = displacement_columns(lever).reshape(-1, 6) @ gain
    visit = belief.inflation * belief.visit + settings.touch**2
    half = np.sqrt(belief.inflation) * (lift @ probed - tipped)
    return half, np.asarray(lift), float(visit)


def _about_fixed_point(
    arm: ErrorModel, touches: ProbingSet, settings: RegistrationSettings
) -> _FoundTip:
    """One place, three orientations or more."""
    spread = np.ptp(touches.point, axis=0).max()
    if spread > ONE_PLACE:
        raise ConfigurationError(
            f"touches of places up to {spread / MM:.3f} mm apart, and no table they are on.",
            hint="--table TOUCHES.csv, what the probe touched of it; or one fixed point in all "
            "rows (equal px_mm, py_mm, pz_mm).",
        )
    tool = arm.robot.T_flange_tool[:3, 3]
    flange = forward(arm.robot.nominal().with_tool(np.eye(4)), touches.joints)
    for _ in range(STEPS if arm.calibrated else 1):
        tip = tips(arm, touches.joints, _with_tip(settings, tool))
        at = pose(flange[:, :3, :3], tip - flange[:, :3, :3] @ tool)
        fit = fit_tool_point(at, sigma=settings.touch, names=touches.labels)
        tool = fit.p_flange_tool
    belief = _belief(arm, settings)
    half = _tip_roots(belief, _tool_query(touches.joints, tool, settings))
    half = np.sqrt(belief.inflation) * half
    visit = belief.inflation * belief.visit + settings.touch**2
    n = len(touches)
    rows = np.concatenate(
        [flange[:, :3, :3], np.broadcast_to(-np.eye(3), (n, 3, 3))], axis=2
    ).reshape(3 * n, 6)
    gain = np.linalg.pinv(rows)
    noise = half @ half.T + visit * np.eye(3 * n)
    own = np.eye(3 * n) - rows @ gain
    _check_residuals(touches, fit.residuals, own @ noise @ own.T)
    covariance = gain[:3] @ noise @ gain[:3].T
    found = CalibratedTool(
        p_flange_tool=tool,
        covariance=0.5 * (covariance + covariance.T),
        names=touches.labels,
        residuals=fit.residuals,
        doubts=("Three touches have little redundancy: probe one or two more points.",)
        if n == 3
        else (),
    )
    return _FoundTip(tool=found, arm=gain[:3] @ half, own=gain[:3], table=np.zeros((3, 0)))


def axis_between(
    arm: ErrorModel,
    short: ProbingSet,
    long: ProbingSet,
    *,
    table: ProbingSet | None = None,
    settings: RegistrationSettings | None = None,
) -> CalibratedAxis:
    """Returns the tool axis through two gauges of different length.

    Args:
        arm: The model that touched.
        short: With the short gauge.
        long: With the long one in the same spindle.
        table: With the probe whose tip ``settings`` names, as in :func:`calibrate_tool`: the gauges
            touched its points. Not given: each touched a fixed point.
        settings: Noise.

    Raises:
        ConfigurationError: Touches without joints, or of several places.
        ObservabilityError: Too few orientations, or gauges too alike.
        ImplausibleDataError: A touch that is not of the fixed point.
    """
    settings = RegistrationSettings() if settings is None else settings
    found = _find_tips(arm, (short, long), table, settings)
    apart = found[1].tool.p_flange_tool - found[0].tool.p_flange_tool
    length = float(np.linalg.norm(apart))
    belief = _belief(arm, settings)
    visit = belief.inflation * belief.visit + settings.touch**2
    shared, table_step = (
        long_part - short_part
        for short_part, long_part in (
            (found[0].arm, found[1].arm), (found[0].table, found[1].table),
        )
    )  # fmt: skip
    touched = table_step @ table_step.T + sum(each.own @ each.own.T for each in found)
    joint = shared @ shared.T + visit * touched
    known = float(np.sqrt(np.linalg.eigvalsh(joint)[-1]))
    if length <= 10.0 * known:
        raise ObservabilityError(
            f"the two gauges end {length / MM:.3g} mm apart, known to {known / MM:.3g} mm; they "
            "give no direction.",
            source=file_of(long),
            hint="a longer second gauge, or more orientations.",
        )
    axis = apart / length
    across = (np.eye(3) - np.outer(axis, axis)) / length
    return CalibratedAxis(
        axis_in_flange=axis,
        covariance=across @ joint @ across.T,
        names=("short", "long"),
        residuals=np.empty(0),
    )


def axis_on_plane(
    arm: ErrorModel,
    squarings: ProbingSet,
    normal_in_base: Array,
    *,
    sigma: float,
    settings: RegistrationSettings | None = None,
) -> CalibratedAxis:
    """Returns the tool axis from a tool squared on a plane, best turned about the normal.

    Args:
        arm: The model.
        squarings: Their joints are used, their points are not.
        normal_in_base: (3,) of the plane, out of the material.
        sigma: rad per axis of one squaring.
        settings: With the prior of the arm.

    Raises:
        ConfigurationError: No joints, no normal, or a sigma that is not positive.
        ImplausibleDataError: A squaring more than 5 deg from the mean of all.
    """
    settings = RegistrationSettings() if settings is None else settings
    _check_touches(arm, squarings)
    length = float(np.linalg.norm(normal_in_base))
    if not length > 0.0 or not sigma > 0.0:
        raise ConfigurationError(
            f"a normal of length {length:g} and {sigma / DEG:g} deg, expected both above 0.",
            hint="--normal 0,0,1",
        )
    robot = arm.robot.nominal().with_tool(np.eye(4))
    turn = forward(robot, squarings.joints)[:, :3, :3]
    normal = np.asarray(normal_in_base) / length
    axes = -np.einsum("nji,j->ni", turn, normal)
    axis = axes.mean(axis=0) / np.linalg.norm(axes.mean(axis=0))
    off = np.arctan2(np.linalg.norm(np.cross(axes, axis), axis=1), axes @ axis)
    if off.max() > MOST_APART:
        worst = int(np.argmax(off))
        raise ImplausibleDataError(
            f"squaring {squarings.labels[worst]} puts the axis {off[worst] / DEG:.2f} deg from the "
            f"mean of all {len(off)}, allowed {MOST_APART / DEG:g} deg.",
            source=file_of(squarings),
            line=int(squarings.lines[worst]) if len(squarings.lines) else None,
            hint="check that pose, and that all were on the same plane.",
        )
    belief = _belief(arm, settings)
    # A point on the axis moves against the flange as the arm turns: the attitude error times lever.
    near, far = (
        _tip_roots(belief, _tool_query(squarings.joints, size * axis, settings))
        for size in (0.0, LEVER)
    )
    mean = np.concatenate(list(np.swapaxes(turn, 1, 2)), axis=1) / len(turn)
    across = np.eye(3) - np.outer(axis, axis)
    half = np.sqrt(belief.inflation) * across @ mean @ (far - near) / LEVER
    covariance = half @ half.T + sigma**2 / len(turn) * across
    return CalibratedAxis(
        axis_in_flange=axis, covariance=covariance, names=squarings.labels, residuals=off
    )


def _with_tip(settings: RegistrationSettings, tool: Array) -> RegistrationSettings:
    return replace(settings, T_flange_tool=pose(np.eye(3), tool))


def _tool_query(joints: Array, tool: Array, settings: RegistrationSettings) -> Query:
    """Returns postures of a tip that is not in the model."""
    return Query(joints=joints, load=settings.arm.payload, T_flange_tool=pose(np.eye(3), tool))


def _belief(arm: ErrorModel, settings: RegistrationSettings) -> Belief:
    belief = arm_belief(arm, settings)
    if belief is None:
        raise ConfigurationError(
            "the model keeps no joint covariance; the uncertainty of a tool cannot be derived "
            "from it.",
            hint="a model of robotrue calibrate, or the bare cell.",
        )
    return belief


def _tip_roots(belief: Belief, query: Query) -> Array:
    """Motion (3n, r) of the tips per unit of every independent error of the arm."""
    columns = np.asarray(tip_columns(belief, query) @ belief.root.T)
    return np.asarray(columns.reshape(3 * len(query.joints), -1))


def _check_residuals(touches: ProbingSet, residuals: Array, spread: Array) -> None:
    """Passes if every touch agrees with its place within arm, table and touch.

    Raises:
        ImplausibleDataError: One does not; names it, with its distance.
    """
    n = len(touches)
    if n < 2:
        return
    blocks = np.einsum("iaib->iab", spread.reshape(n, 3, n, 3))
    limit = np.sqrt(chi2.ppf(WRONG, 3) * np.linalg.eigvalsh(blocks)[:, -1])
    far = np.linalg.norm(residuals, axis=1)
    worst = int(np.argmax(far / limit))
    if far[worst] > limit[worst]:
        raise ImplausibleDataError(
            f"touch {touches.labels[worst]} is {far[worst] / MM:.3f} mm from where the others put "
            f"the tip, arm and touch explain {limit[worst] / MM:.3f} mm.",
            source=file_of(touches),
            line=int(touches.lines[worst]) if len(touches.lines) else None,
            hint="another point of the table, a slipped touch, a changed tool or wrong units.",
        )
