"""The predicted error over a cylinder or a cube of the workspace, and how alike its sectors are.

A grid fills the region; along one coordinate (the angle of a cylinder, y of a cube) it falls into
sectors of equal grids, so that every point of one has its counterpart in the next. The attitude of
the tool either turns with the angle about joint 1 or is fixed in base. Points that the nominal arm
cannot take are empty (NaN): they are not points without error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from scipy.special import chdtri

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.deng2022.similarity import similarity
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.error_vector import PER_JOINT_GROUPS, compliance_scale, moment_prior
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import pose
from robotrue.core.regions import CylinderRegion, Region, grid_coordinates, points_at
from robotrue.core.rotations import matrix_from_abc, wrap
from robotrue.errors import ObservabilityError, ReachError, ShapeError
from robotrue.robot.forward import forward, walk
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.inverse_numeric import solve, solve_global
from robotrue.robot.model import RobotModel, moment_slice, parameter_slice
from robotrue.robot.opw import opw_geometry
from robotrue.robot.statics import NO_LOAD, Load
from robotrue.validation.validation_defaults import MAP_ATTITUDE, MAP_SECTORS

Attitude: TypeAlias = Literal["turning", "fixed"]
"""``turning``: with the angle about joint 1. ``fixed``: in base."""
FEWEST_SHARED: Final = 5
"""Points two sectors must share for a similarity to be stated."""
_SEEDS: Final = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkspaceMap(Columns):
    """Predicted errors at the points of a grid, actual minus commanded, base axes.

    Attributes:
        region: Where.
        counts: Grid values along each coordinate.
        along: Coordinate that is divided into sectors, 0 to 2.
        sectors: How many.
        attitude: Attitude of the tool.
        coordinates: (n, 3) of the region, last one fastest.
        point: (n, 3) m, base.
        joints: (n, dof) rad; NaN where the arm cannot take the pose.
        error: (n, 3) m; NaN likewise.
        covariance: (n, 3, 3) m^2 about it; NaN likewise.
    """

    region: Region
    counts: tuple[int, int, int]
    along: int
    sectors: int
    attitude: Attitude
    coordinates: Annotated[Array, Column("n 3", nan=True)]
    point: Annotated[Array, Column("n 3", unit="m", nan=True)]
    joints: Annotated[Array, Column("n dof", unit="rad", nan=True)]
    error: Annotated[Array, Column("n 3", unit="m", nan=True)]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2", nan=True)]

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        self._check_columns(n=int(np.prod(self.counts)))

    @property
    def reachable(self) -> BoolArray:
        """(n,) True where the arm can take the pose."""
        return np.asarray(np.isfinite(self.joints).all(axis=1))

    @property
    def norm(self) -> Array:
        """(n,) m, length of the predicted error."""
        return np.asarray(np.linalg.norm(self.error, axis=1))

    @property
    def sd(self) -> Array:
        """(n, 3) m, standard deviation along each base axis."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def bound(self) -> Array:
        """(n,) m; see :func:`radius_95`: what a compensated pose keeps with 95 %."""
        return radius_95(self.covariance)

    @property
    def sector(self) -> IntArray:
        """(n,) sector of each point, 0 .. sectors - 1."""
        value = np.unravel_index(np.arange(len(self.point)), self.counts)[self.along]
        return np.asarray(value * self.sectors // self.counts[self.along])

    def grid(self, values: Array) -> Array:
        """Returns values (n, ...) as an array over the three coordinates."""
        return np.reshape(values, (*self.counts, *np.shape(values)[1:]))


def radius_95(covariance: Array) -> Array:
    """Returns the radius in m that holds 95 % of N(0, C), shape (n,), for C (n, 3, 3) m^2.

    Two moments: the squared length is taken as g chi2(h) with g = tr(C^2) / tr(C) and
    h = tr(C)^2 / tr(C^2) (Satterthwaite 1946). Exact for a sphere and for a line, within 1 %
    between. NaN where C is not known.
    """
    first = np.trace(covariance, axis1=1, axis2=2)
    second = np.einsum("nij,nji->n", covariance, covariance)
    return np.asarray(np.sqrt(second / first * chdtri(first**2 / second, 0.05)))


def error_map(
    model: ErrorModel,
    region: Region,
    counts: tuple[int, int, int],
    *,
    tool_abc: Array,
    attitude: Attitude = MAP_ATTITUDE,
    sectors: int = MAP_SECTORS,
    near: Array | None = None,
    load: Load = NO_LOAD,
    T_flange_tool: Array | None = None,
) -> WorkspaceMap:
    """Returns the predicted error over a grid of the region.

    Args:
        model: Any error model.
        region: Cylinder or cube in base.
        counts: Grid values along each coordinate; those along the sectors, the angle of a
            cylinder or y of a cube, a multiple of their number.
        tool_abc: (3,) rad, KUKA A, B, C of the tool in base; for ``turning`` at angle 0.
        attitude: Attitude of the tool.
        sectors: How many.
        near: (dof,) rad, a posture of the branch wanted; the middle of the training range, or of
            the limits, if None. It is turned about joint 1 to each point.
        load: One payload.
        T_flange_tool: (4, 4) requested point; the measured point if None.

    Raises:
        ShapeError: Counts that do not divide into the sectors.
        ReachError: Not one point can be taken.
    """
    axis = 0 if isinstance(region, CylinderRegion) else 1
    if sectors < 1 or counts[axis] % sectors:
        raise ShapeError(
            f"{counts[axis]} grid values do not fall into {sectors} sectors.",
            hint="a multiple of the number of sectors.",
        )
    robot = model.robot.nominal()
    if T_flange_tool is not None:
        robot = robot.with_tool(T_flange_tool)
    coordinates = grid_coordinates(region, counts)
    point = points_at(region, coordinates)
    start = _posture(model, robot) if near is None else np.asarray(near, dtype=np.float64)
    joints = _joints(robot, _poses(point, tool_abc, attitude), start)
    able = np.isfinite(joints).all(axis=1)
    if not able.any():
        raise ReachError(
            f"none of {len(point)} points of the region can be taken with this attitude.",
            hint="another attitude of the tool, or a region nearer to the robot.",
        )
    error, covariance = np.full((len(point), 3), np.nan), np.full((len(point), 3, 3), np.nan)
    seen = model.predict(Query(joints=joints[able], load=load, T_flange_tool=T_flange_tool))
    error[able], covariance[able] = seen.error, seen.covariance
    return WorkspaceMap(
        region=region,
        counts=counts,
        along=axis,
        sectors=sectors,
        attitude=attitude,
        coordinates=coordinates,
        point=point,
        joints=joints,
        error=error,
        covariance=covariance,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SectorSimilarity:
    """Similarity of the errors of two sectors at corresponding points, -1 to 1.

    Attributes:
        first: Sector, from 0.
        second: Sector.
        points: Corresponding points both can take.
        vector: Cosine of the normalised error vectors (Deng et al. 2022, eq. 9-10); NaN where it
            cannot be stated.
        axis: (3,) cosine of each base component over the points.
        norm: Cosine of the lengths over the points.
    """

    first: int
    second: int
    points: int
    vector: float
    axis: Array
    norm: float


def sector_similarities(found: WorkspaceMap) -> tuple[SectorSimilarity, ...]:
    """Returns the similarity of every two sectors, neighbours of the first sector first.

    Similar errors in base axes are what a transfer between sectors of a fixed attitude can use;
    errors that turn with joint 1 look unlike here and are the same to a model of the arm.
    """
    errors = [_sort_errors(found, k) for k in range(found.sectors)]
    return tuple(
        _compare_sectors(errors[i], errors[k], i, k)
        for i in range(found.sectors)
        for k in range(i + 1, found.sectors)
    )


def _sort_errors(found: WorkspaceMap, sector: int) -> Array:
    """Returns the errors of a sector in the order of its grid."""
    return np.asarray(found.error[found.sector == sector])


def _compare_sectors(a: Array, b: Array, first: int, second: int) -> SectorSimilarity:
    both = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    a, b = a[both], b[both]
    vector, axis, norm = np.nan, np.full(3, np.nan), np.nan
    if len(a) >= FEWEST_SHARED:
        try:
            vector = similarity(a, b)
        except ObservabilityError:
            vector = np.nan
        axis = np.array([_cosine(a[:, k], b[:, k]) for k in range(3)])
        norm = _cosine(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
    return SectorSimilarity(
        first=first, second=second, points=len(a), vector=vector, axis=axis, norm=norm
    )


def _cosine(a: Array, b: Array) -> float:
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else float("nan")


def build_prior_model(robot: RobotModel, settings: FitSettings) -> CalibratedModel:
    """Returns the prior model of an arm before any measurement: stated stiffness, prior scales.

    The mean is the deflection of the stated stiffness (nothing without one), the covariance that
    of the joint errors; base and tool are taken as known.
    """
    dof = robot.dof
    errors, sd = np.zeros_like(robot.errors), np.zeros_like(robot.errors)
    for group in PER_JOINT_GROUPS:
        sd[parameter_slice(dof, group)] = getattr(settings.scales, group)
    errors[moment_slice(dof)], sd[moment_slice(dof)] = moment_prior(robot)
    place = parameter_slice(dof, "compliance")
    if settings.stiffness is None:
        sd[place] = compliance_scale(robot, float(settings.payload.mass[0]))
    else:
        errors[place] = 1.0 / settings.stiffness.stiffness
        sd[place] = settings.stiffness.relative_sd * errors[place]
    return CalibratedModel(
        robot=robot,
        errors=errors,
        covariance=np.diag(sd**2),
        repeatability=settings.repeatability_sd,
        white=0.0,
        summary={
            "method": "prior",
            "rows": 0,
            "verdict": "conditional",
            "doubts": ["nothing was measured: stated stiffness and prior scales only."],
        },
    )


def _posture(model: ErrorModel, robot: RobotModel) -> Array:
    trained = model.training_summary().joint_range
    if trained is not None and trained.shape == (2, robot.dof):
        return np.asarray(trained.mean(axis=0))
    return np.asarray(np.clip(robot.limits, -np.pi, np.pi).mean(axis=1))


def _poses(point: Array, tool_abc: Array, attitude: Attitude) -> Array:
    rotation = matrix_from_abc(np.asarray(tool_abc, dtype=np.float64))
    if attitude == "fixed":
        return pose(rotation, point)
    heading = np.zeros((len(point), 3))
    heading[:, 0] = np.arctan2(point[:, 1], point[:, 0])
    return pose(matrix_from_abc(heading) @ rotation, point)


def _joints(robot: RobotModel, poses: Array, posture: Array) -> Array:
    """Joints (n, dof) rad in the branch of the posture turned towards each pose; NaN: no way."""
    state = walk(robot, posture[None])
    turn = np.sign(state.joint_axis[0, 0, 2]) or 1.0
    x, y, _ = forward(robot, posture[None])[0, :3, 3]
    near = np.tile(posture, (len(poses), 1))
    heading = np.arctan2(poses[:, 1, 3], poses[:, 0, 3])
    near[:, 0] += turn * wrap(heading - np.arctan2(y, x))
    near[:, 0] = np.clip(near[:, 0], *robot.limits[0])
    if opw_geometry(robot) is not None:
        return inverse_batch(robot, poses, near=near)
    found = solve(robot, poses, near)
    low, high = robot.limits.T
    good = found.converged & ((found.joints >= low) & (found.joints <= high)).all(axis=1)
    joints = np.where(good[:, None], found.joints, np.nan)
    rest = np.flatnonzero(~good)
    if len(rest):
        again = solve_global(robot, poses[rest], near=near[rest], seeds=_SEEDS)
        joints[rest] = np.where(again.converged[:, None], again.joints, np.nan)
    return joints


SAMPLES: Final = 512
"""Poses; a power of two keeps the sequence balanced."""
SEED: Final = 9283


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownPlaces:
    """Poses spread evenly over the training range.

    Attributes:
        joints: (n, dof) rad.
        position: (n, 3) m in base, of the nominal arm.
        radius: (n,) m that holds 95 % of what a compensated pose keeps.
    """

    joints: Array
    position: Array
    radius: Array


def known_places(
    model: ErrorModel, *, load: Load = NO_LOAD, samples: int = SAMPLES
) -> KnownPlaces | None:
    """Returns a sample of the training range; None where the model keeps no range.

    Poses are a scrambled Sobol sequence in the box of joint values of the training data, so not
    every one of them need be free of collisions.

    Args:
        model: Any error model.
        load: One payload.
        samples: A power of two.
    """
    stated, dof = model.training_summary().joint_range, model.robot.dof
    if stated is None or stated.shape != (2, dof):
        return None
    low, high = stated
    from scipy.stats import qmc  # takes longer to import than most commands run

    unit = qmc.Sobol(dof, rng=np.random.default_rng(SEED)).random(samples)
    joints = low + unit * (high - low)
    prediction = model.predict(Query(joints=joints, load=load))
    return KnownPlaces(
        joints=joints,
        position=forward(model.robot.nominal(), joints)[:, :3, 3],
        radius=radius_95(prediction.covariance),
    )
