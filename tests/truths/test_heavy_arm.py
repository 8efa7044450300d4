"""The synthetic heavy arm, simulated by plain NumPy code that shares nothing with the library.

The truth lies inside the joint-spring class with exact masses: a best case.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from robotrue.calibration.estimate import estimate
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.settings import RP_PER_SIGMA, free_groups
from robotrue.calibration.terms.error_vector import StiffnessPrior
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_names
from robotrue.robot.statics import drive_torque

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import heavy_arm as bench
import heavy_arm_case as case

SETTINGS = FitSettings(payload=bench.load(), repeatability=RP_PER_SIGMA * case.REPEATABILITY_SD)
KNOWN = FitSettings(
    payload=bench.load(),
    repeatability=RP_PER_SIGMA * case.REPEATABILITY_SD,
    stiffness=StiffnessPrior(stiffness=case.STIFFNESS, relative_sd=np.array(0.2)),
)
DRAWS = 8


@pytest.fixture(scope="module")
def poses():
    joints = case.poses(bench.CALIBRATION + bench.TEST)
    return joints[: bench.CALIBRATION], joints[bench.CALIBRATION :]


def scores(poses, settings, loaded=0):
    """Mean and max, without and with force, mm, averaged over noise draws."""
    train, test = poses
    return np.mean(
        [
            bench.ours(
                fit(
                    bench.robot(),
                    bench.measurements(train, seed, loaded),
                    method="elastic",
                    settings=settings,
                ),
                test,
            )
            for seed in range(DRAWS)
        ],
        axis=0,
    )


def test_two_codes_agree_on_kinematics_and_torques(poses):
    _, test = poses
    np.testing.assert_allclose(
        forward(bench.robot(), test)[:, :3, 3], case.points(case.nominal_arm(), test), atol=1e-13
    )
    np.testing.assert_allclose(
        drive_torque(bench.robot(), test, bench.load(case.FORCE)),
        case.torque(case.nominal_arm(), test, case.FORCE),
        atol=1e-9,
    )


def test_published_sizes_of_the_case(poses):
    """Mean and max in mm, all printed digits: nominal, nominal under force, sag, force effect."""
    _, test = poses
    arm, compliance = case.true_arm(), 1.0 / case.STIFFNESS
    believed, rigid = case.points(case.nominal_arm(), test), case.points(arm, test)
    actual = case.points(arm, test, compliance)
    forced = case.points(arm, test, compliance, case.FORCE)
    sizes = []
    for a, b in ((actual, believed), (forced, believed), (actual, rigid), (forced, actual)):
        distance_mm = np.linalg.norm(a - b, axis=1) * 1e3
        sizes += [distance_mm.mean(), distance_mm.max()]
    published = [3.497, 8.055, 3.42, 7.77, 2.890, 4.815, 0.845, 2.134]
    digits = [3, 3, 2, 2, 3, 3, 3, 3]
    assert [round(float(s), d) for s, d in zip(sizes, digits, strict=True)] == published


def test_with_six_side_loaded_poses(poses):
    mean, _, loaded_mean, _ = scores(poses, SETTINGS, loaded=bench.LOADED)
    assert mean <= 0.016
    assert loaded_mean <= 0.035


def test_with_a_stiffness_prior(poses):
    mean, _, loaded_mean, _ = scores(poses, KNOWN)
    assert mean <= 0.016
    assert loaded_mean <= 0.035


def test_without_either_the_loaded_case_is_not_claimed(poses):
    train, _ = poses
    result = estimate(bench.robot(), bench.measurements(train, 0), SETTINGS, free_groups("elastic"))
    assert result.verdict.status == "conditional"
    assert [d.name for d in result.identifiability.harmful] == ["compliance1"]


def test_no_parameter_overwrites_another(poses):
    """Base, tool, geometry and compliance are estimated together, each under its own name."""
    train, _ = poses
    result = estimate(bench.robot(), bench.measurements(train, 0), SETTINGS, free_groups("elastic"))
    names = result.posterior.layout.names
    assert names == parameter_names(6)
    assert len(set(names)) == len(names)
    fixed = set(names) - set(result.identifiability.names)
    vertical = {"moment_x1", "moment_y1"}  # about a vertical axis nothing weighs
    assert fixed == {"tool_rx", "tool_ry", "tool_rz"} | vertical
    table = {name: (value, sd) for name, value, sd in result.table()}
    assert table["base_x"][1] > 0.0
    for joint in range(2, 6):
        value, sd = table[f"compliance{joint}"]
        truth = 1.0 / case.STIFFNESS[joint - 1]
        assert abs(value - truth) < 4.0 * sd
        assert sd < 0.05 * truth


def test_blind_compliance_keeps_its_prior_and_says_how_little_it_knows(poses):
    """Not a meaningless -91 rad/(N m) behind a fit that looks perfect."""
    train, _ = poses
    result = estimate(bench.robot(), bench.measurements(train, 0), SETTINGS, free_groups("elastic"))
    value, sd = {n: (v, s) for n, v, s in result.table()}["compliance1"]
    assert abs(value) < 1e-9
    assert sd > 0.5 / case.STIFFNESS[0]
