"""A shift in which an arm warms, to practise on. Simulated.

    python -m robotrue.simulation.warm_shift FOLDER [--seed N] [--drift UM]

writes ``cell.toml``, ``early.csv`` (60 poses of the first four hours), ``late.csv`` (60 of the last
four) and ``part.src``, a program. The arm is a KR160 R1570 with geometric errors of .3 mm and .02
deg, joint springs, and a joint ripple. The hall warms by some kelvin and the arm by itself; every
link and joint follows with a different lag (20 to 90 min) and rise (.7 to 1.3), links grow by 11e-6
to 23e-6 per kelvin, joint zeros turn, and all of it is scaled to a mean tool point error of 0.1 mm
at the end. One sensor on the upper arm, good to .1 K, is what the files state. All sizes are
assumed, and no error model has this truth among its parameters.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.calibration.terms.thermal import link_lengths
from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM, UM
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import drive_jacobian, parameter_jacobian, walk
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm

EARLY: Final = 60
LATE: Final = 60
SHIFT: Final = 8 * 3600.0
REPEATABILITY: Final = 28.0 * UM
TRACKER: Final = 12.0 * UM
"""m, sd per axis."""
RIPPLE: Final = 0.0025 * DEG
PERIODS: Final = np.array([3.0, 2.0, 4.0, 5.0, 3.0, 2.0])
LOAD: Final = Load(mass=np.array([80.0]), com=np.array([[0.0, 0.05, 0.12]]))
COLD: Final = 291.15
SENSOR: Final = 0.1
"""K, of the sensor when the shift begins, and its noise."""
SENSOR_LAG: Final = 2400.0
"""s, of the place where it sits."""
DRIFT: Final = 100.0 * UM


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmArm:
    """An arm as it was built, and how it warms.

    Attributes:
        robot: With its errors, cold.
        rise: (dof,) of each link and joint, over that of the sensor's place.
        lag: (dof,) s.
        growth: (dof,) 1/K.
        zero: (dof,) rad/K.
        own: K by which the arm warms by itself.
        hall: K by which the hall warms in the shift.
    """

    robot: RobotModel
    rise: Array
    lag: Array
    growth: Array
    zero: Array
    own: float
    hall: float

    def warmth(self, time: Array, lag: Array) -> Array:
        """K above the cold start at times (n,), of bodies of a lag (k,): (n, k)."""
        t, lag = time[:, None], lag[None, :]
        share = -np.expm1(-t / lag)
        return np.asarray(self.own * share + self.hall / SHIFT * (t - lag * share))

    def drift(self, joints: Array, time: Array) -> Array:
        """What warmth does to the tool point, (n, 3) m."""
        kelvin = self.rise * self.warmth(time, self.lag)
        state = walk(self.robot, joints)
        strain = np.column_stack([kelvin * self.growth, kelvin[:, -1] * self.growth[-1]])
        moved = (
            parameter_jacobian(self.robot, state, joints)[:, :3]
            @ (strain @ link_lengths(self.robot))[:, :, None]
        )
        turned = drive_jacobian(self.robot, state)[:, :3] @ (kelvin * self.zero)[:, :, None]
        return np.asarray((moved + turned)[:, :, 0])


def arm_as_built(nominal: RobotModel, rng: np.random.Generator) -> RobotModel:
    """A KR160 with geometric errors of .3 mm and .02 deg, and joint springs."""
    errors, dof = np.zeros(len(nominal.errors)), nominal.dof
    sizes = {"theta": 0.02 * DEG, "alpha": 0.02 * DEG, "d": 0.3 * MM, "a": 0.3 * MM}
    for name, sd in sizes.items():
        errors[parameter_slice(dof, name)] = rng.normal(0.0, sd, dof)
    springs = np.array([1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5])
    errors[parameter_slice(dof, "compliance")] = 1.0 / springs
    return nominal.with_errors(errors)


def true_arm(nominal: RobotModel, rng: np.random.Generator, drift: float = DRIFT) -> WarmArm:
    """A KR160 as it was built; its tool point is off by ``drift`` m after a shift, in the mean."""
    dof = nominal.dof
    arm = WarmArm(
        robot=arm_as_built(nominal, rng),
        rise=rng.uniform(0.7, 1.3, dof),
        lag=rng.uniform(20.0, 90.0, dof) * 60.0,
        growth=rng.uniform(11e-6, 23e-6, dof),
        zero=rng.normal(0.0, 5e-6, dof),
        own=float(rng.uniform(4.0, 8.0)),
        hall=float(rng.uniform(0.0, 5.0)),
    )
    joints = joints_of(nominal, 200, rng)
    size = np.linalg.norm(arm.drift(joints, np.full(200, SHIFT)), axis=1).mean()
    return replace(arm, own=arm.own * drift / size, hall=arm.hall * drift / size)


def joints_of(robot: RobotModel, count: int, rng: np.random.Generator) -> Array:
    """Postures (n, 6) rad over half the joint ranges."""
    low, high = robot.limits.T
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    return np.asarray(middle + 0.5 * half * rng.uniform(-1.0, 1.0, (count, robot.dof)))


def points_of(robot: RobotModel, joints: Array) -> Array:
    """Where the reflector of the cold arm is, (n, 3) m in base."""
    ripple = RIPPLE * np.sin(PERIODS * joints + np.arange(robot.dof))
    return deflect_arm(robot, joints, LOAD, ripple)[0].position


def measure_shift(
    nominal: RobotModel, arm: WarmArm, rng: np.random.Generator
) -> tuple[MeasurementSet, Array]:
    """Rows of the whole shift, early ones first, and where the tool point truly was, (n, 3) m."""
    n = EARLY + LATE
    joints, time = joints_of(nominal, n, rng), np.linspace(0.0, SHIFT, n)
    true = points_of(arm.robot, joints) + arm.drift(joints, time)
    noise = np.hypot(REPEATABILITY, TRACKER)
    sensor = COLD + arm.warmth(time, np.array([SENSOR_LAG]))[:, 0] + rng.normal(0.0, SENSOR, n)
    rows = MeasurementSet(
        joints=joints,
        position=true + rng.normal(0.0, noise, true.shape),
        covariance=np.tile(TRACKER**2 * np.eye(3), (n, 1, 1)),
        temperature=sensor,
        time=time,
        provenance=Provenance(simulated=True, instrument="virtual tracker"),
    )
    return rows, true


CELL: Final = f"""schema = 1
[robot]
preset = "KUKA KR160 R1570"
[payload]
mass_kg = {LOAD.mass[0]:g}
centre_of_mass_mm = [{", ".join(f"{x / MM:g}" for x in LOAD.com[0])}]
[repeatability]
mm = {REPEATABILITY * 3.6158 / MM:.4f}
"""
PROGRAM: Final = """DEF part()
$TOOL = {X 0, Y 0, Z 0, A 0, B 0, C 0}
$BASE = {X 0, Y 0, Z 0, A 0, B 0, C 0}
PTP {A1 0, A2 -90, A3 90, A4 0, A5 30, A6 0}
LIN {X 1200, Y -200, Z 900, A 0, B 90, C 0}
LIN {X 1200, Y 200, Z 900, A 0, B 90, C 0}
END
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Writes the files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drift", type=float, default=DRIFT / UM, metavar="UM")
    asked = parser.parse_args(arguments)
    asked.folder.mkdir(parents=True, exist_ok=True)
    rng, nominal = np.random.default_rng(asked.seed), preset("KR160")
    rows, _ = measure_shift(nominal, true_arm(nominal, rng, asked.drift * UM), rng)
    write_canonical(asked.folder / "early.csv", rows.subset(np.arange(EARLY)))
    write_canonical(asked.folder / "late.csv", rows.subset(np.arange(EARLY, EARLY + LATE)))
    (asked.folder / "cell.toml").write_text(CELL, encoding="utf-8")
    (asked.folder / "part.src").write_text(PROGRAM, encoding="utf-8")


if __name__ == "__main__":
    main()
