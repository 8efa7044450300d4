"""First moments of the links: what torques of gravity show of masses, and kernels that carry it."""

from dataclasses import replace

import numpy as np
import pytest

from robotrue.robot.chain import link_frames, link_masses
from robotrue.robot.forward import walk
from robotrue.robot.model import moment_slice
from robotrue.robot.statics import Load, add_moments, drive_torque, stated_torque, weight_torque

from .arms import arm, heavy, random_joints

ARMS = ["kr160", "irb6660", "Franka Panda", "odd-dh", "odd-mdh"]


def moved(robot, link, k, metres):
    """The arm with one centre of mass moved along axis k of its link."""
    com = np.array(robot.link_com)
    com[link, k] += metres
    return replace(robot, link_com=com)


@pytest.mark.parametrize("name", ARMS)
def test_a_moment_across_the_axis_is_a_centre_of_mass_moved(name):
    robot = heavy(arm(name), 3)
    joints = random_joints(robot, 5, 4)
    for link in range(robot.dof):
        errors = np.zeros(len(robot.errors))
        errors[moment_slice(robot.dof).start + link] = 7.0
        along_x = moved(robot, link, 0, 7.0 / robot.link_mass[link])
        np.testing.assert_allclose(
            drive_torque(robot.with_errors(errors), joints), drive_torque(along_x, joints)
        )


@pytest.mark.parametrize("name", ARMS)
def test_torque_is_that_of_the_stated_masses_and_of_the_moments(name):
    robot, rng = heavy(arm(name), 5), np.random.default_rng(6)
    errors = np.zeros(len(robot.errors))
    errors[moment_slice(robot.dof)] = rng.normal(size=2 * robot.dof)
    robot, joints = robot.with_errors(errors), random_joints(robot, 5, 7)
    load = Load(mass=np.array([30.0]), wrench=np.full((1, 6), 20.0))
    stated, weight = stated_torque(robot, joints, load)
    np.testing.assert_allclose(stated, drive_torque(robot.nominal(), joints, load))
    np.testing.assert_allclose(
        stated + add_moments(weight, robot.moments), drive_torque(robot, joints, load)
    )


def test_two_moments_for_each_link_behind_the_first_are_all_that_gravity_shows():
    robot = arm("kr160")
    weight = weight_torque(robot, walk(robot, random_joints(robot, 50, 8)))
    rank = np.linalg.matrix_rank(weight.reshape(-1, 12), tol=1e-6)
    assert rank == 10  # of twelve: those about a vertical axis load no drive
    tilted = replace(robot, gravity=np.array([1.0, 0.0, -9.7]))
    weight = weight_torque(tilted, walk(tilted, random_joints(robot, 50, 8)))
    assert np.linalg.matrix_rank(weight.reshape(-1, 12), tol=1e-6) == 12


def test_kernels_are_given_the_moments():
    robot = heavy(arm("kr160"), 9)
    errors = np.zeros(len(robot.errors))
    errors[moment_slice(6).start + 2] = 5.0
    frames = link_frames(robot)
    there = link_masses(robot.with_errors(errors), frames)["moment"][0]
    shifted = link_masses(moved(robot, 2, 0, 5.0 / robot.link_mass[2]), frames)["moment"][0]
    np.testing.assert_allclose(there, shifted, atol=1e-12)
