"""What every registration returns: the part's frame in base and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, pose, propagate_covariance
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """How far a good touch may lie from where the frame puts it, one standard deviation per axis.

    Attributes:
        touch: m, the touch itself: probe, surface, hand.
        robot: m, the error of the arm that is not a rigid motion of the whole part: about 0.3 to
            0.5 mm without a calibrated model, its stated position uncertainty with one.

    Both must be given: a bound without the robot's share rejects good points.
    """

    touch: float
    robot: float

    def __post_init__(self) -> None:
        """Checks the two numbers.

        Raises:
            ShapeError: A negative or infinite value, or both zero.
        """
        values = (self.touch, self.robot)
        if not all(0.0 <= v < np.inf for v in values) or sum(values) == 0.0:
            raise ShapeError(
                f"noise of {self.touch:g} m (touch) and {self.robot:g} m (robot), expected finite "
                "values of 0 or more, not both 0."
            )

    @property
    def sigma(self) -> float:
        """Both together, m per axis."""
        return float(np.hypot(self.touch, self.robot))


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration(Columns):
    """A part's frame in the robot base, found from touches.

    Attributes:
        method: Name of the fit.
        T_base_part: (4, 4) m.
        covariance: (6, 6) of the displacement of the part's origin (m) and its left rotation
            vector (rad), both in base axes.
        names: Name of each touch.
        residuals: (n, 3) m in base, touched minus where the frame puts it; along the surface
            normal alone where a touch fixes only that.
        outliers: Names the fit did not believe; their residuals are listed but not fitted.
        sigma: m per axis (per touch of a surface), the noise the covariance was scaled with.
        sigma_source: ``stated``, or ``residuals`` where nothing was stated.
        degrees_of_freedom: Equations of the believed touches less six.
    """

    method: str
    T_base_part: Annotated[Array, Column("4 4", unit="m")]
    covariance: Annotated[Array, Column("6 6")]
    names: Annotated[tuple[str, ...], Column("n")]
    residuals: Annotated[Array, Column("n 3", unit="m")]
    outliers: tuple[str, ...] = ()
    sigma: float
    sigma_source: str
    degrees_of_freedom: int

    @property
    def distances(self) -> Array:
        """Length of each residual, (n,) m."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    @property
    def believed(self) -> BoolArray:
        """(n,) True where the touch was fitted."""
        return np.array([name not in self.outliers for name in self.names])

    @property
    def rms(self) -> float:
        """Root mean square distance of the believed touches, m."""
        return float(np.sqrt(np.mean(self.distances[self.believed] ** 2)))

    @property
    def misfit(self) -> float:
        """Residuals over stated noise: about 1 where it explains them; NaN with none to spare.

        Far above 1 the noise was stated too small, or the frame is a wrong one.
        """
        if self.degrees_of_freedom < 1:
            return float("nan")
        square = float((self.distances[self.believed] ** 2).sum())
        return float(np.sqrt(square / self.degrees_of_freedom) / self.sigma)


def point_covariance(registration: Registration, points: Array) -> Array:
    """Returns the covariance (n, 3, 3) m^2, in base, of part points (n, 3) m.

    The frame's share alone. Touching and machining share the robot's own error, which is not in
    here: see the joint estimate for that.

    Args:
        registration: The frame.
        points: (n, 3) m in part.
    """
    lever = np.asarray(points) @ registration.T_base_part[:3, :3].T
    return propagate_covariance(registration.covariance, lever)


def displace_frame(T_base_part: Array, step: Array) -> Array:
    """Returns the frame displaced by a step (6,): origin (m), then left rotation vector (rad)."""
    turn = matrix_from_rotation_vector(step[3:])
    return pose(turn @ T_base_part[:3, :3], T_base_part[:3, 3] + step[:3])


def name_touches(names: tuple[str, ...] | None, n: int) -> tuple[str, ...]:
    """Returns the names given, or "1" to "n".

    Raises:
        ShapeError: Another number of names, or two alike.
    """
    found = tuple(str(i + 1) for i in range(n)) if names is None else tuple(names)
    if len(found) != n or len(set(found)) != n:
        raise ShapeError(f"{len(found)} names ({len(set(found))} different) for {n} touches.")
    return found


def point_residuals(T_base_part: Array, in_part: Array, in_base: Array) -> Array:
    """Returns touched minus predicted points (n, 3) m in base."""
    return np.asarray(in_base - apply(T_base_part, in_part))
