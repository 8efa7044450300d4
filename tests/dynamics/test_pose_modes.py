"""Modes from masses and joint stiffness against energies, statics and each other."""

from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.dynamics.pose_modes import FlexibleArm, pose_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.errors import ModelMismatchError, ReachError, ShapeError
from robotrue.robot.forward import drive_jacobian, walk
from robotrue.robot.presets import preset

JOINTS = np.array([-0.4, 0.1, 0.9, -0.5, -0.9, 0.3])


def some_arm(name="irb6660", seed=1):
    rng = np.random.default_rng(seed)
    robot = preset(name)
    n = robot.dof
    tool = np.eye(4)
    tool[:3, 3] = [0.32, 0.01, 0.16]
    spread = rng.uniform(0.3, 1.0, (n, 3, 3))
    return FlexibleArm(
        robot=replace(
            robot,
            link_mass=rng.uniform(20.0, 300.0, n),
            link_com=rng.uniform(-0.2, 0.2, (n, 3)),
            T_flange_tool=tool,
        ),
        link_inertia=spread @ np.swapaxes(spread, 1, 2) * 5.0,
        stiffness=np.full(n, 1e6),
        damping=np.full(n, 0.03),
        payload_mass=60.0,
        payload_com=np.array([0.15, 0.0, 0.12]),
        payload_inertia=np.diag([1.0, 1.2, 1.1]),
    )


@pytest.mark.parametrize("name", ["irb6660", "kr160"])
def test_mass_matrix_is_the_kinetic_energy(name):
    """Twice the energy at joint speeds v, from finite differences of every link's motion."""
    arm = some_arm(name)
    robot, rng, step = arm.robot, np.random.default_rng(2), 1e-5
    mass, jacobian = arm.mass_and_jacobian(JOINTS)
    for _ in range(3):
        v = rng.normal(size=6)
        states = [walk(robot, (JOINTS + s * step * v)[None]) for s in (-1.0, 1.0)]
        energy = 0.0
        for i in range(7):
            link = min(i, 5)
            com = robot.link_com[i] if i < 6 else arm.payload_com
            weight = robot.link_mass[i] if i < 6 else arm.payload_mass
            inertia = arm.link_inertia[i] if i < 6 else arm.payload_inertia
            places = [s.link_position[0, link] + s.link_rotation[0, link] @ com for s in states]
            speed = (places[1] - places[0]) / (2 * step)
            before, after = (s.link_rotation[0, link] for s in states)
            turn = rotation_vector_from_matrix((before.T @ after)[None])[0] / (2 * step)
            energy += weight * speed @ speed + turn @ inertia @ turn
        assert v @ mass @ v == pytest.approx(energy, rel=1e-6)
    state = walk(robot, JOINTS[None])
    np.testing.assert_allclose(jacobian, drive_jacobian(robot, state)[0], atol=1e-12)


def test_rod_moves_the_forearm_without_turning_it():
    arm = some_arm()
    _, jacobian = arm.mass_and_jacobian(JOINTS)
    np.testing.assert_allclose(jacobian[3:, 1], 0.0, atol=1e-12)
    assert np.linalg.norm(jacobian[:3, 1]) > 0.5


def test_shapes_are_normalised_and_give_the_static_deflection():
    arm = some_arm()
    modes = pose_modes(arm, JOINTS)
    mass, _ = arm.mass_and_jacobian(JOINTS)
    omega = 2 * np.pi * modes.frequency
    assert (np.diff(modes.frequency) > 0.0).all()
    np.testing.assert_allclose(modes.shape.T @ mass @ modes.shape, np.eye(6), atol=1e-9)
    stiff = modes.shape.T @ np.diag(arm.stiffness) @ modes.shape
    np.testing.assert_allclose(stiff, np.diag(omega**2), rtol=1e-9, atol=1e-6 * omega[-1] ** 2)
    np.testing.assert_allclose(modes.oscillators().static, modes.static[:3, :3], rtol=1e-9)


def test_joints_do_not_jump_when_the_pose_moves():
    arm = some_arm()
    here, there = pose_modes(arm, JOINTS), pose_modes(arm, JOINTS + 0.002)
    eta = np.random.default_rng(3).normal(size=6)
    np.testing.assert_allclose(
        there.shape @ (there.carry(here) @ eta), here.shape @ eta, rtol=1e-9, atol=1e-15
    )


def test_slow_move_under_a_standing_force_rings_less_than_it_moves():
    """Fifty refreshes on the way: the tool follows the static deflection."""
    arm, force = some_arm(), np.array([[-30.0, -4.0, 20.0]])
    path = JOINTS + np.linspace(0.0, 0.05, 51)[:, None]
    modes = pose_modes(arm, path[0])
    stream = ModalFilter(modes.oscillators(), 20e3)
    stream.settle(force[0])
    static, found = [], []
    for joints in path[1:]:
        after = pose_modes(arm, joints)
        stream.change(after.oscillators(), after.carry(modes))
        modes = after
        found.append(stream.push(np.repeat(force, 800, axis=0)).mean(axis=0))
        static.append(modes.static[:3, :3] @ force[0])
    moved = np.abs(static[-1] - static[0]).max()
    assert np.abs(np.array(found) - static).max() < 0.05 * moved


def test_pose_outside_the_limits_is_refused():
    arm = some_arm()
    with pytest.raises(ReachError, match=r"joint 2 at 120\.000 deg"):
        pose_modes(arm, np.array([0.0, np.deg2rad(120.0), 0.9, 0.0, 0.0, 0.0]))
    with pytest.raises(ReachError, match="joint 1 at nan"):
        pose_modes(arm, np.array([np.nan, 0.0, 0.9, 0.0, 0.0, 0.0]))


def test_arm_without_masses_is_refused():
    arm = some_arm()
    with pytest.raises(ModelMismatchError, match="no link masses"):
        replace(arm, robot=preset("irb6660"), payload_mass=0.0)
    with pytest.raises(ShapeError, match="stiffness"):
        replace(arm, stiffness=np.zeros(6))
