"""What the links weigh: learned where nobody states it, told from compliance by a known load."""

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.calibration.terms.error_vector import assumed_masses, moment_prior
from robotrue.calibration.update import update_model
from robotrue.core.robust import chi_point
from robotrue.robot.forward import forward, walk
from robotrue.robot.model import moment_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, add_moments, deflect_arm, drive_torque, stated_torque

SETTINGS = FitSettings(payload=PAYLOAD, repeatability=4e-5)
SIDE = np.array([0.0, 300.0, -150.0, 0.0, 0.0, 0.0])


def bare(robot):
    """The arm as most users know it: no masses."""
    return replace(robot, link_mass=np.empty(0), link_com=np.empty(0))


def wrenches(n, loaded):
    out = np.zeros((n, 6))
    out[:loaded] = 800.0 * SIDE / 335.0
    return out


@pytest.fixture(scope="module")
def case():
    rng = np.random.default_rng(4)
    robot = arm()
    actual = planted(robot, rng)
    joints, test = postures(robot, 60, rng), postures(robot, 100, rng)
    sets = {k: measure(actual, joints, rng, sd=2e-5, wrench=wrenches(60, k)) for k in (0, 20)}
    return robot, actual, sets, test


def judge(model, actual, test, wrench):
    """Mean error in mm and share inside the stated 95 % region, without instrument."""
    load = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=wrench[None])
    truth = deflect_arm(actual, test, load)[0].position
    off = truth - forward(actual.nominal(), test)[:, :3, 3]
    told = model.predict(Query(joints=test, load=load))
    off -= told.error
    squared = np.einsum("ni,ni->n", off, np.linalg.solve(told.covariance, off[:, :, None])[:, :, 0])
    inside = float((squared <= chi_point(0.95, 3) ** 2).mean())
    return float(np.linalg.norm(off, axis=1).mean() * 1e3), inside


@pytest.mark.parametrize("name", ["kr160", "UR10", "Franka Panda", "irb6660"])
def test_moments_of_masses_that_are_the_prior_give_their_torque(name):
    """An arm without masses whose moments are those of masses bends as if it had these."""
    robot = bare(preset(name))
    mean, sd = moment_prior(robot)
    # Beams from joint to joint, as the prior has them, told as link masses.
    frame = walk(robot, np.zeros((1, robot.dof)))
    ends = np.vstack([frame.joint_origin[0], frame.flange_position])
    about = 0.5 * (ends[:-1] + ends[1:]) - frame.link_position[0]
    com = np.einsum("nji,nj->ni", frame.link_rotation[0], about)
    heavy = replace(robot, link_mass=assumed_masses(robot), link_com=com)
    joints = np.random.default_rng(0).uniform(-2.0, 2.0, (6, robot.dof))
    none, weight = stated_torque(robot, joints, Load())
    assert not none.any()
    np.testing.assert_allclose(add_moments(weight, mean), drive_torque(heavy, joints), atol=1e-9)
    assert (sd[1 : robot.dof] > 0.0).all()
    assert sd[0] == 0.0  # axis 1 is vertical


def test_stated_masses_make_the_prior_narrow():
    stated, sd = moment_prior(arm())
    _, wide = moment_prior(bare(arm()))
    assert not stated.any()
    assert (sd[1:4] > 0.0).all()
    assert (sd[1:4] < 0.2 * wide[1:4]).all()
    plate = replace(bare(arm()), total_mass=320.0)
    mean, known = moment_prior(plate)
    assert (known[1:3] < 0.6 * wide[1:3]).all()
    assert assumed_masses(plate).sum() == pytest.approx(250.0, rel=0.05)
    assert abs(mean[1] - 120.0) < 2.0 * known[1]  # what this arm's masses come to


def test_no_masses_unloaded(case):
    robot, actual, sets, test = case
    model = fit(bare(robot), sets[0], method="elastic", settings=SETTINGS)
    mean, inside = judge(model, actual, test, np.zeros(6))
    assert mean < 0.025
    assert inside >= 0.93
    told = " ".join(model.training_summary().warnings)
    assert "product of link weight and drive compliance" in told
    assert "known force or a second payload" in told


def test_no_masses_and_a_known_pull(case):
    robot, actual, sets, test = case
    model = fit(bare(robot), sets[20], method="elastic", settings=SETTINGS)
    for wrench in (np.zeros(6), SIDE):
        mean, inside = judge(model, actual, test, wrench)
        assert mean < 0.02
        assert inside >= 0.93
    np.testing.assert_allclose(model.errors[36:39], actual.error("compliance")[:3], rtol=0.03)
    assert not any("link weight and" in line for line in model.training_summary().warnings)


def test_the_archive_and_an_update_keep_what_the_links_weigh(case):
    robot, actual, sets, test = case
    plate = replace(bare(robot), total_mass=320.0)
    first = fit(plate, sets[0], method="elastic", settings=SETTINGS)
    back = open_model(first.to_archive())
    assert isinstance(back, CalibratedModel)
    assert back.robot.total_mass == 320.0
    np.testing.assert_array_equal(back.errors, first.errors)
    later = update_model(back, sets[20].subset(np.arange(20)), settings=SETTINGS)
    place = moment_slice(6)
    before, after = (np.diagonal(m.covariance)[place] for m in (first, later))
    assert after[1] < 0.2 * before[1]
    assert judge(later, actual, test, SIDE)[0] < 0.1
    tables = later.mean_tables()
    assert tables is not None
    np.testing.assert_array_equal(tables.robot.moments, later.errors[place])
