"""The benchmark's virtual cells and campaigns by name: S0, S1, S2, S4, attitude A or B. Simulated.

====  =======  ===================  ==========================  ===============================
name  level f  repeatability, 1 s.  tracker (15 um + 5 um/m)    represents
====  =======  ===================  ==========================  ===============================
S0    0        0.014 mm per axis    bound read as two sigma     an arm the chain describes
S1    2        0.014 mm per axis    bound read as two sigma     a good arm, ISO 9283 RP 0.05 mm
S2    3        0.060 mm per axis    bound read as one sigma     the scatter of the paper
S4    4        0.014 mm per axis    bound read as two sigma     un-modelled effects twice as large
====  =======  ===================  ==========================  ===============================

Suffix A: the tool's attitude turns with joint 1. B: it is fixed in the base, the workspace 100 mm
lower. Within a campaign the thermal drift is continuous; two campaigns drift independently.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import qmc

from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.error_vector import PriorScales, StiffnessPrior
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.inverse import inverse_batch
from robotrue.simulation.plans import (
    POSTURE,
    VALIDATION,
    Attitude,
    Region,
    cylinder_poses,
    with_attitude,
)
from robotrue.simulation.presets import VirtualCell, deng2022
from robotrue.simulation.virtual_robot import actual_pose, nominal_pose
from robotrue.simulation.virtual_tracker import measure
from robotrue_reproductions.deng2022.sampling_plan import PaperPlan, paper_plan

SCENARIOS: Final = ("S0A", "S1A", "S2A", "S4A", "S0B", "S1B", "S2B", "S4B")
STIFFNESS_SD: Final = 0.5
"""Relative, of the stiffness the user read in Table 2."""
CALIBRATION: Final = 0
CHECK: Final = 9
"""Numbers of the campaigns that measure the plan and, on another day, the check poses."""
SOURCE: Final = 1
"""Number of the campaign of a source region that was measured before."""

_LEVEL: Final = {"S0": 0.0, "S1": 2.0, "S2": 3.0, "S4": 4.0}
_WHOLE: Final = Region()


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One simulated arm of a scenario.

    Attributes:
        name: Of :data:`SCENARIOS`.
        seed: Of the arm, its campaigns and its plans.
        attitude: Convention A (``turning``) or B (``fixed``).
        cell: What the user knows, and the truth.
        plan: The paper's plan for this seed; also holds the 50 check poses.
    """

    name: str
    seed: int
    attitude: Attitude
    cell: VirtualCell
    plan: PaperPlan

    @property
    def settings(self) -> FitSettings:
        """What the user of the cell fits with: its facts, stiffness of Table 2 known to 50 %."""
        known = self.cell.known
        return FitSettings(
            payload=known.payload,
            repeatability=known.repeatability,
            scales=PriorScales(tool=known.target_sigma),
            stiffness=StiffnessPrior(
                stiffness=1.0 / known.compliance_prior, relative_sd=np.array(STIFFNESS_SD)
            ),
        )


def scenario(name: str, seed: int) -> Scenario:
    """Returns one simulated arm of a scenario; equal seeds give equal arms and campaigns.

    Args:
        name: Of :data:`SCENARIOS`.
        seed: Any non-negative integer.

    Raises:
        ConfigurationError: No such scenario.
    """
    if name not in SCENARIOS:
        raise ConfigurationError(f"no scenario {name!r}; scenarios are {list(SCENARIOS)}.")
    attitude: Attitude = "turning" if name[2] == "A" else "fixed"
    rough = name.startswith("S2")
    cell = deng2022(
        seed,
        level=_LEVEL[name[:2]],
        repeatability=(0.060 if rough else 0.014) * MM,
        region=with_attitude(VALIDATION, attitude),
    )
    if rough:
        bounds = replace(cell.tracker.specification, divisor=1.0)
        cell = replace(
            cell,
            tracker=replace(cell.tracker, specification=bounds),
            known=replace(cell.known, tracker=bounds),
        )
    plan = paper_plan(cell.known.measured_robot, seed, attitude)
    return Scenario(name=name, seed=seed, attitude=attitude, cell=cell, plan=plan)


def measure_joints(
    case: Scenario, joints: Array, *, campaign: int = CALIBRATION, name: str = "simulated"
) -> MeasurementSet:
    """Returns one campaign over joints (n, 6) rad in the order given, positions in base.

    Args:
        case: The arm.
        joints: (n, 6) rad, commanded.
        campaign: Its number: noise and thermal drift are its own.
        name: Name of the set.
    """
    return measure(
        case.cell.robot,
        case.cell.tracker,
        joints,
        seed=case.seed,
        campaign=campaign,
        T_flange_tool=case.cell.T_flange_target,
        name=name,
    )


def whole(case: Scenario, n: int) -> MeasurementSet:
    """Returns plan W: n Sobol poses over the whole workspace, angles -40 to 40 deg.

    Fewer poses are the first of more poses; only the noise is drawn again.
    """
    return measure_joints(case, sobol_joints(case, n), name=f"W{n}")


def source(case: Scenario, *, campaign: int = SOURCE) -> MeasurementSet:
    """Returns the 126 source poses of the paper, angles -40 to -30 deg, by default an own day."""
    return measure_joints(case, case.plan.source, campaign=campaign, name="source")


def target(case: Scenario, n: int, *, campaign: int = CALIBRATION) -> MeasurementSet:
    """Returns n Sobol poses over the target domain, angles -30 to 40 deg; n = 0 has no rows."""
    region = replace(_WHOLE, angle=(-30 * DEG, 40 * DEG))
    return measure_joints(
        case, sobol_joints(case, n, region), campaign=campaign, name=f"target {n}"
    )


def transfer(case: Scenario, n: int) -> MeasurementSet:
    """Returns plan T: 126 source poses and n target poses in **one** campaign, groups 0 and 1.

    This is the note's transfer test. For a source of another day take :func:`source` and
    :func:`target`.
    """
    region = replace(_WHOLE, angle=(-30 * DEG, 40 * DEG))
    joints = np.concatenate([case.plan.source, sobol_joints(case, n, region)])
    return _set_groups(measure_joints(case, joints, name="T"), len(case.plan.source))


def paper(case: Scenario) -> MeasurementSet:
    """Returns plan P206: 126 source poses (group 0) and 5 x 16 target poses (group 1)."""
    joints = np.concatenate([case.plan.source, case.plan.target])
    return _set_groups(measure_joints(case, joints, name="P206"), len(case.plan.source))


def validation(case: Scenario) -> MeasurementSet:
    """Returns plan V: the 378 poses of the validation region, angles -20 to 20 deg."""
    return measure_joints(case, case.plan.validation, name="V378")


def check(case: Scenario) -> MeasurementSet:
    """Returns the 50 check poses, angles -20 to 20 deg, measured on another day."""
    return measure_joints(case, case.plan.check, campaign=CHECK, name="check")


def raw_errors(case: Scenario, rows: MeasurementSet) -> Array:
    """Returns measured minus commanded (n, 3) m, as the paper measures before compensation."""
    known = case.cell.known
    commanded = nominal_pose(case.cell.robot, rows.joints, known.T_flange_target)[:, :3, 3]
    return np.asarray(rows.position - commanded)


def floor(case: Scenario) -> float:
    """Returns the mean distance in m of the check measurement from the truth without any noise.

    Thermal drift counts as noise: no calibration of another day can know it. A model cannot do
    better on the check poses, chance aside.
    """
    rows = check(case)
    true = actual_pose(
        case.cell.robot,
        rows.joints,
        approach=rows.approach,
        T_flange_tool=case.cell.T_flange_target,
    )[:, :3, 3]
    return float(np.linalg.norm(rows.position - true, axis=1).mean())


def sobol_joints(case: Scenario, n: int, region: Region = _WHOLE) -> Array:
    """Returns n postures (n, 6) rad: scrambled Sobol points of a region that can be reached.

    Args:
        case: The arm; its seed scrambles.
        n: How many; fewer are the first of more.
        region: In the sense of convention A; it is lowered for B.

    Raises:
        ReachError: Fewer than n of 8 n + 64 poses can be taken.
    """
    where = with_attitude(region, case.attitude)
    places = qmc.Sobol(6, scramble=True, rng=np.random.default_rng([case.seed, 37]))
    power = int(np.ceil(np.log2(8 * n + 64)))
    unit = places.random_base2(power)
    low, high = np.array([where.angle, where.radius, where.height]).T
    place = low + unit[:, :3] * (high - low)
    turn = (2.0 * unit[:, 3:] - 1.0) * where.turn
    poses = cylinder_poses(place[:, 0], place[:, 1], place[:, 2], turn, case.attitude)
    joints = inverse_batch(case.cell.known.measured_robot, poses, near=POSTURE)
    able = joints[np.isfinite(joints).all(axis=1)]
    if len(able) < n:
        raise ReachError(f"only {len(able)} of {len(joints)} Sobol poses can be taken.")
    return np.asarray(able[:n])


def _set_groups(rows: MeasurementSet, first: int) -> MeasurementSet:
    """The set with its rows from ``first`` on as a separate group."""
    group = (np.arange(len(rows)) >= first).astype(np.int64)
    return replace(rows, group=group, group_names=("source", "target"), sources=rows.sources * 2)
