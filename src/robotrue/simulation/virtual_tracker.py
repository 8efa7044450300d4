"""A laser tracker whose noise is its specification, looking at a virtual robot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.provenance import Provenance
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementFrame, MeasurementSet
from robotrue.measurement.tracker import TRACKERS, TrackerSpecification, point_covariance
from robotrue.robot.statics import Load
from robotrue.simulation.virtual_robot import VirtualRobot, actual_pose

SECONDS_PER_POSE: Final = 20.0
"""Time from one stop to the next: drive, settle, average."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualTracker(Columns):
    """A tracker at its place.

    Attributes:
        T_base_tracker: (4, 4) its pose.
        specification: Its bounds, and how they are read.
        frame: ``"base"``: registered to the robot, points come out in base; ``"tracker"``: points
            come out in its own frame.
    """

    T_base_tracker: Annotated[Array, Column("4 4")] = field(
        default_factory=lambda: pose(np.eye(3), np.array([3.5, -2.0, 1.2]))
    )
    specification: TrackerSpecification = TRACKERS["API T3"]
    frame: MeasurementFrame = "base"

    @property
    def position(self) -> Array:
        """(3,) m, position of the tracker in the frame of its points."""
        return np.zeros(3) if self.frame == "tracker" else self.T_base_tracker[:3, 3].copy()


def observe(tracker: VirtualTracker, points: Array, rng: np.random.Generator) -> Array:
    """Returns what the tracker reads (n, 3) m, in its ``frame``, for true points (n, 3) m in base.

    Noise is drawn in the instrument's spherical frame: range, azimuth, elevation.

    Raises:
        ConfigurationError: A point lies within 1 mm of the instrument.
    """
    local = apply(inverse(tracker.T_base_tracker), points)
    distance = np.linalg.norm(local, axis=1)
    if (distance < 1e-3).any():
        raise ConfigurationError("a measured point lies inside the tracker; place it elsewhere.")
    sight = local / distance[:, None]
    azimuth = np.arctan2(sight[:, 1], sight[:, 0])
    side = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(len(local))], axis=1)
    draw = rng.standard_normal((len(local), 3))
    along = tracker.specification.sigma_range(distance) * draw[:, 0]
    across = tracker.specification.sigma_angle(distance)[:, None] * draw[:, 1:]
    read = local + along[:, None] * sight
    read += across[:, :1] * side + across[:, 1:] * np.cross(sight, side)
    return read if tracker.frame == "tracker" else apply(tracker.T_base_tracker, read)


def measure(
    virtual: VirtualRobot,
    tracker: VirtualTracker,
    joints: Array,
    *,
    seed: int,
    load: Load | None = None,
    campaign: int = 0,
    T_flange_tool: Array | None = None,
    name: str = "simulated",
) -> MeasurementSet:
    """Returns one campaign: every pose visited once in the order given, and measured.

    Each visit scatters by the robot's repeatability; the stated covariance is the instrument's
    alone. The approach direction is the sign of each joint's move from the pose before.

    Args:
        virtual: The arm.
        tracker: The instrument.
        joints: (n, dof) rad, commanded.
        seed: Of the noise; equal seeds give equal measurements.
        load: What the arm carries; None is its own payload.
        campaign: Number of the campaign, for the thermal drift.
        T_flange_tool: (4, 4) where the reflector sits; None is the tool of the robot model.
        name: Name of the set.
    """
    joints = np.asarray(joints, dtype=np.float64)
    n = len(joints)
    rng = np.random.default_rng([seed, 17, campaign])
    approach = np.zeros_like(joints)
    approach[1:] = np.sign(np.diff(joints, axis=0))
    true = actual_pose(
        virtual,
        joints,
        load,
        approach=approach,
        time=SECONDS_PER_POSE * np.arange(n, dtype=np.float64),
        campaign=campaign,
        T_flange_tool=T_flange_tool,
    )[:, :3, 3]
    true = true + virtual.repeatability * rng.standard_normal((n, 3))
    position = observe(tracker, true, rng)
    wrench = np.zeros((n, 6)) if load is None else np.broadcast_to(load.wrench, (n, 6))
    return MeasurementSet(
        joints=joints,
        position=position,
        covariance=point_covariance(tracker.specification, position, tracker.position),
        frame=tracker.frame,
        wrench=wrench,
        approach=approach,
        group_names=(name,),
        sources=(f"{name}: simulated seed={seed} campaign={campaign}, {virtual.name}",),
        provenance=Provenance(simulated=True, instrument=tracker.specification.name),
    )
