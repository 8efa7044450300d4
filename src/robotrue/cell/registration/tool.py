"""Tool point and tool axis from touches: orientations about a fixed point, on a plane.

A touch with the tip gives three equations and does not determine the turn of the tool about itself;
the choice of that turn is therefore an argument.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.cell.registration.fit import name_touches
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.observable import WEAKEST, orient_line
from robotrue.core.poses import pose
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolPoint(Columns):
    """A tool point found about a fixed point.

    Attributes:
        p_flange_tool: (3,) m.
        p_base_point: (3,) m, the fixed point.
        covariance: (6, 6) m^2 of both, the tool point in flange axes first.
        names: Of the poses.
        residuals: (n, 3) m in base: predicted tip less the fixed point.
        sigma: m per axis.
        sigma_source: ``stated`` or ``residuals``.
        weakest: (3,) direction in flange axes known worst.
        weakest_sigma: m, how well.
    """

    p_flange_tool: Annotated[Array, Column("3", unit="m")]
    p_base_point: Annotated[Array, Column("3", unit="m")]
    covariance: Annotated[Array, Column("6 6", unit="m^2")]
    names: Annotated[tuple[str, ...], Column("n")]
    residuals: Annotated[Array, Column("n 3", unit="m")]
    sigma: float
    sigma_source: str
    weakest: Annotated[Array, Column("3")]
    weakest_sigma: float

    @property
    def rms(self) -> float:
        """Root mean square distance of the tips from the fixed point, m."""
        return float(np.sqrt((self.residuals**2).sum(axis=1).mean()))


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolAxis(Columns):
    """A tool axis in the flange.

    Attributes:
        axis_in_flange: (3,) unit vector, out of the spindle.
        covariance: (3, 3) of it; zero along itself.
        residuals: (n,) rad, angle of each observation from it; empty where none is left over.
    """

    axis_in_flange: Annotated[Array, Column("3")]
    covariance: Annotated[Array, Column("3 3")]
    residuals: Annotated[Array, Column("n", unit="rad")]


def fit_tool_point(
    T_base_flange: Array,
    *,
    sigma: float | None = None,
    noise: Array | None = None,
    names: tuple[str, ...] | None = None,
    weakest: float = WEAKEST,
) -> ToolPoint:
    """Returns the tool point that stayed at one place while the flange took these poses.

    Linear least squares of R_i t + p_i = c over tool point t and fixed point c.

    Args:
        T_base_flange: (n, 4, 4), flange poses with the tip on the same fixed point.
        sigma: m per axis of one touch, the robot's error included. Not given: from the residuals.
        noise: (3n, 3n) m^2, joint covariance of the poses' position errors; changes the covariance
            of the result, not the result.
        names: Of the poses.
        weakest: Largest allowed ratio of the worst direction's standard deviation to one touch's.

    Raises:
        ShapeError: Wrong shapes.
        ObservabilityError: Fewer than three poses, or turned about parallel axes only, or by too
            little: names the direction that stays unknown.

    Fails when: the robot's orientation errors are large; they shift the tip by lever times angle
    and look like a longer tool.
    """
    T: Array = frozen(T_base_flange, (None, 4, 4), "T_base_flange")
    n = len(T)
    labels = name_touches(names, n)
    if n < 3:
        raise ObservabilityError(
            f"{n} flange poses, a tool point needs 3 or more orientations about two axes.",
            hint="touch the same point again with the tool tilted another way.",
        )
    R = T[:, :3, :3]
    _check_orientations(R, weakest)
    rows = np.concatenate([R, np.broadcast_to(-np.eye(3), (n, 3, 3))], axis=2).reshape(3 * n, 6)
    gain = np.linalg.pinv(rows)
    solution = gain @ -T[:, :3, 3].ravel()
    residuals = (rows @ solution + T[:, :3, 3].ravel()).reshape(n, 3)
    stated = sigma is not None or noise is not None
    scale = sigma if sigma is not None else float(np.sqrt((residuals**2).sum() / (3 * n - 6)))
    if noise is None:
        covariance = scale**2 * gain @ gain.T
    else:
        joint = frozen(noise, (3 * n, 3 * n), "noise")
        covariance = gain @ joint @ gain.T
        scale = float(np.sqrt(np.trace(joint) / (3 * n)))
    values, directions = np.linalg.eigh(covariance[:3, :3])
    return ToolPoint(
        p_flange_tool=solution[:3],
        p_base_point=solution[3:],
        covariance=0.5 * (covariance + covariance.T),
        names=labels,
        residuals=residuals,
        sigma=scale,
        sigma_source="stated" if stated else "residuals",
        weakest=orient_line(directions[:, -1]),
        weakest_sigma=float(np.sqrt(max(values[-1], 0.0))),
    )


def _check_orientations(R_base_flange: Array, weakest: float) -> None:
    """Passes if the orientations differ about two axes or more, by enough."""
    spread = (R_base_flange - R_base_flange.mean(axis=0)).reshape(-1, 3)
    _, values, directions = np.linalg.svd(spread)
    loose = values < 1.0 / weakest
    if not loose.any():
        return
    listed = "; ".join(
        f"({d[0]:+.2f}, {d[1]:+.2f}, {d[2]:+.2f}) "
        f"({'free' if v < 1e-6 else f'{1 / v:.0f} times one touch'})"
        for d, v in zip(map(orient_line, directions[loose]), values[loose], strict=True)
    )
    turns = np.einsum("nij,nij->n", R_base_flange, np.broadcast_to(R_base_flange[0], (1, 3, 3)))
    largest = float(np.arccos(np.clip(0.5 * (turns.min() - 1.0), -1.0, 1.0)))
    raise ObservabilityError(
        f"{len(R_base_flange)} orientations, at most {largest / DEG:.1f} deg from the first, leave "
        f"the tool point unknown along, in flange axes: {listed}. Allowed is {weakest:.0f} times "
        "one touch.",
        hint="tilt the tool about a second axis; turning it about itself never shows its length.",
    )


def fit_tool_axis_on_plane(
    R_base_flange: Array, normal_in_base: Array, *, sigma: float | None = None
) -> ToolAxis:
    """Returns the tool axis from flange orientations with the tool square on a known plane.

    Args:
        R_base_flange: (n, 3, 3), orientations with the tool's end flush on the plane, or its shank
            squared to it; best spread about the normal, so that a tilted table cancels.
        normal_in_base: (3,) of the plane, out of the material.
        sigma: rad per axis of one squaring; not given: from the scatter (two or more).

    Raises:
        ShapeError: Wrong shapes, no normal, or one squaring without a sigma.
        ImplausibleDataError: Axes that differ by more than 5 deg: not one tool, or not one plane.
    """
    R: Array = frozen(R_base_flange, (None, 3, 3), "R_base_flange")
    normal: Array = frozen(normal_in_base, (3,), "normal_in_base")
    length = float(np.linalg.norm(normal))
    if length < 1e-9 or not len(R) or (len(R) < 2 and sigma is None):
        raise ShapeError(
            f"{len(R)} squarings on a normal of length {length:g}: a direction and one squaring "
            "with its sigma, or two squarings, are needed."
        )
    # Out of the spindle is into the material.
    axes = -np.einsum("nji,j->ni", R, normal / length)
    axis = axes.mean(axis=0)
    axis = axis / np.linalg.norm(axis)
    off = np.arctan2(np.linalg.norm(np.cross(axes, axis), axis=1), axes @ axis)
    if off.max() > 5.0 * DEG:
        worst = int(np.argmax(off))
        raise ImplausibleDataError(
            f"squaring {worst + 1} puts the tool axis {off[worst] / DEG:.2f} deg from the mean of "
            f"all {len(R)}, allowed 5 deg.",
            hint="check that pose, and that all were on the same plane.",
        )
    scale = sigma if sigma is not None else float(np.sqrt((off**2).sum() / (2 * (len(R) - 1))))
    across = np.eye(3) - np.outer(axis, axis)
    return ToolAxis(
        axis_in_flange=axis,
        covariance=scale**2 / len(R) * across,
        residuals=off,
    )


def fit_tool_axis_between(short: ToolPoint, long: ToolPoint) -> ToolAxis:
    """Returns the tool axis through two tool points found with a short and a long gauge.

    Args:
        short: Tool point nearer to the flange.
        long: Tool point of the longer gauge in the same spindle.

    Raises:
        ObservabilityError: The two lie closer together than ten times what is known of them.
    """
    apart = long.p_flange_tool - short.p_flange_tool
    length = float(np.linalg.norm(apart))
    joint = short.covariance[:3, :3] + long.covariance[:3, :3]
    known = float(np.sqrt(np.linalg.eigvalsh(joint)[-1]))
    if length <= 10.0 * known or length == 0.0:
        raise ObservabilityError(
            f"the two tool points are {length / MM:.3g} mm apart and known to {known / MM:.3g} mm; "
            "they give no direction.",
            hint="use a longer gauge, or more orientations.",
        )
    axis = apart / length
    across = (np.eye(3) - np.outer(axis, axis)) / length
    return ToolAxis(
        axis_in_flange=axis,
        covariance=across @ joint @ across.T,
        residuals=np.empty(0),
    )


def tool_frame(p_flange_tool: Array, axis_in_flange: Array, x_in_flange: Array) -> Array:
    """Returns ``T_flange_tool`` (4, 4): z along the axis, x as near as can be to a direction.

    Args:
        p_flange_tool: (3,) m.
        axis_in_flange: (3,) tool axis; becomes z.
        x_in_flange: (3,) the rule for the turn about z, which no tip touch can see.

    Raises:
        ShapeError: x along the axis.
    """
    z = np.asarray(axis_in_flange, dtype=np.float64)
    z = z / np.linalg.norm(z)
    x = np.asarray(x_in_flange, dtype=np.float64)
    x = x - (x @ z) * z
    if np.linalg.norm(x) < 1e-6:
        raise ShapeError("x_in_flange lies along the tool axis and fixes no turn about it.")
    x = x / np.linalg.norm(x)
    return pose(np.stack([x, np.cross(z, x), z], axis=1), p_flange_tool)
