"""A jog of a wrist that holds a tool in a force sensor, simulated with known clocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

MASS, CENTRE = 18.5, np.array([0.012, -0.006, 0.145])


@dataclass(frozen=True)
class Jog:
    joint_time: np.ndarray
    joints: np.ndarray
    force_time: np.ndarray
    wrench: np.ndarray
    offset: float
    drift: float


def swing(time: np.ndarray, begin: float, length: float, size: float) -> np.ndarray:
    """There and back, softly."""
    u = np.clip((time - begin) / length, 0.0, 1.0)
    return size * np.sin(np.pi * u) ** 2


def wrist(time: np.ndarray, size: float, late: float) -> np.ndarray:
    """(n, 6) rad: joints 4 to 6 swing one after the other, and again ``late`` s later."""
    q = np.zeros((len(time), 6)) + np.array([0.1, -1.2, 1.4, 0.3, 0.8, -0.5])
    for begin in (0.0, late) if late else (0.0,):
        q[:, 3] += swing(time, begin + 1.6, 1.7, size)
        q[:, 4] += swing(time, begin + 2.5, 1.1, -0.8 * size)
        q[:, 5] += swing(time, begin + 4.2, 0.8, 0.6 * size)
    return q


def weighed(time: np.ndarray, size: float, late: float) -> np.ndarray:
    """(n, 6) N and N m of the held mass in the sensor's axes: gravity and inertia."""
    h = 1e-3

    def pose(t: np.ndarray) -> tuple[Rotation, np.ndarray]:
        q = wrist(t, size, late)
        turn = Rotation.from_euler("XYX", q[:, 3:6])
        return turn, turn.apply(np.array([0.2, 0.0, 0.0]) + CENTRE)

    turn, place = pose(time)
    bend = (pose(time + h)[1] - 2.0 * place + pose(time - h)[1]) / h**2
    force = turn.inv().apply(MASS * (np.array([0.0, 0.0, -9.81]) - bend))
    return np.hstack([force, np.cross(CENTRE, force)])


def jog(
    seed: int, *, offset: float = 0.137, drift: float = 0.0, size: float = 0.5, late: float = 0.0,
    noise: float = 0.4, length: float = 8.0,
) -> Jog:  # fmt: skip
    """Joints at 250 Hz with 0.2 ms of jitter and 3e-4 deg of noise, force at 1 kHz.

    The force's clock shows a time that is ``offset`` less than the joints', and drifts.
    """
    rng = np.random.default_rng(seed)
    end = length + late
    true_joint = np.arange(0.0, end, 4e-3) + rng.uniform(0.0, 4e-3)
    joints = wrist(true_joint, size, late) + np.deg2rad(3e-4) * rng.standard_normal(
        (len(true_joint), 6)
    )
    true_force = np.arange(0.0, end, 1e-3)
    wrench = weighed(true_force, size, late)
    wrench += noise * np.array([1, 1, 1, 0.075, 0.075, 0.075]) * rng.standard_normal(wrench.shape)
    middle = 0.5 * end
    return Jog(
        joint_time=np.maximum.accumulate(true_joint + 2e-4 * rng.standard_normal(len(true_joint))),
        joints=joints,
        force_time=true_force - offset - drift * (true_force - middle),
        wrench=wrench,
        offset=offset,
        drift=drift,
    )
