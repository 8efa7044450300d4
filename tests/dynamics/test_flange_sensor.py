"""Mass, centre and offsets come back at the stated rate; gravity and inertia come off."""

import numpy as np
import pytest

from robotrue.core.archive import Archive
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.dynamics.flange_sensor import (
    centre_acceleration,
    held_tool_from_archive,
    held_tool_remarks,
    identify_held_tool,
    process_wrench,
)
from robotrue.errors import ArchiveError, ImplausibleDataError, ObservabilityError, ShapeError

MASS, CENTRE = 18.5, np.array([12e-3, -6e-3, 145e-3])
FORCE_0, MOMENT_0 = np.array([5.0, -3.0, 8.0]), np.array([0.2, 0.1, -0.3])
QUARTERS = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [2, 0, 0]])
SIX = matrix_from_rotation_vector(QUARTERS * np.pi / 2)
TILT = matrix_from_rotation_vector(np.array([0.02, -0.01, 0.0]))


def readings(R, noise=1.0, seed=0, acceleration=None):
    """N, N m of an unnoticed tilt of the base, offsets and noise."""
    rng = np.random.default_rng(seed)
    pull = TILT @ [0.0, 0.0, -9.80665 * MASS] - MASS * (0.0 if acceleration is None
                                                        else acceleration)  # fmt: skip
    force = np.einsum("nji,nj->ni", R, np.broadcast_to(pull, (len(R), 3)))
    moment = np.cross(CENTRE, force)
    return np.hstack([
        force + FORCE_0 + 0.4 * noise * rng.normal(size=force.shape),
        moment + MOMENT_0 + 0.03 * noise * rng.normal(size=force.shape),
    ])  # fmt: skip


def test_six_wrist_poses():
    """Noise .4 N and .03 N m: mass to .018 kg, centre to .1-.2 mm, and said so."""
    found = [identify_held_tool(SIX, readings(SIX, seed=seed)) for seed in range(200)]
    mass = np.array([f.mass for f in found]) - MASS
    centre = np.array([f.centre for f in found]) - CENTRE
    assert mass.std() < 0.020
    assert abs(mass.mean()) < 0.004
    assert (centre.std(axis=0) < 0.2e-3).all()
    assert found[0].condition == pytest.approx(2.236, abs=0.01)
    assert (mass / [f.mass_sd for f in found]).std() == pytest.approx(1.1, abs=0.2)
    off = centre / np.array([f.centre_sd for f in found])
    assert (off.std(axis=0) < 1.35).all()
    assert (off.std(axis=0) > 0.75).all()


def test_it_rebuilds_from_its_archive():
    tool = identify_held_tool(SIX, readings(SIX))
    again = held_tool_from_archive(tool.to_archive(source="here"))
    assert again.mass == tool.mass
    np.testing.assert_array_equal(again.centre, tool.centre)
    with pytest.raises(ArchiveError, match="expected 'held-tool'"):
        held_tool_from_archive(Archive(kind="other", schema=1, document={}, arrays={}))


def test_tilt_of_the_base_is_absorbed():
    tool = identify_held_tool(SIX, readings(SIX, noise=0.0))
    assert tool.mass == pytest.approx(MASS, rel=1e-12)
    np.testing.assert_allclose(tool.centre, CENTRE, atol=1e-12)
    np.testing.assert_allclose(tool.weight_in_base / MASS / -9.80665, TILT[:, 2], atol=1e-12)
    np.testing.assert_allclose(tool.force_offset, FORCE_0, atol=1e-10)
    np.testing.assert_allclose(tool.moment_offset, MOMENT_0, atol=1e-10)


def test_poses_too_much_alike_are_refused():
    rng = np.random.default_rng(1)
    near = matrix_from_rotation_vector(np.deg2rad(15.0) * rng.uniform(-1, 1, (12, 3)))
    with pytest.raises(ObservabilityError, match=r"condition .*, at most 5"):
        identify_held_tool(near, readings(near))
    with pytest.raises(ObservabilityError, match="3 poses"):
        identify_held_tool(SIX[:3], readings(SIX[:3]))


def test_readings_that_fit_no_tool():
    with pytest.raises(ImplausibleDataError, match="the sensor has no load"):
        identify_held_tool(SIX, 0.01 * np.random.default_rng(0).normal(size=(6, 6)))
    with pytest.raises(ImplausibleDataError, match="off any weight"):
        identify_held_tool(SIX, readings(SIX[[1, 0, 2, 4, 3, 5]]))
    swapped = readings(SIX)
    swapped[:, 3:] = swapped[:, [5, 3, 4]]
    with pytest.raises(ImplausibleDataError, match="off any centre of mass"):
        identify_held_tool(SIX, swapped)


def test_counts_and_a_sensor_of_the_other_sign():
    counts = readings(SIX) * 1e4
    with pytest.raises(ImplausibleDataError, match=r"weigh .* kg, expected at most 2000 kg"):
        identify_held_tool(SIX, counts)
    assert held_tool_remarks(identify_held_tool(SIX, readings(SIX))) == ()
    (said,) = held_tool_remarks(identify_held_tool(SIX, -readings(SIX)))
    assert "the weight points up in base" in said


def test_cut_is_what_is_left_at_the_tool_point():
    tool = identify_held_tool(SIX, readings(SIX, noise=0.0))
    rng = np.random.default_rng(2)
    R = matrix_from_rotation_vector(rng.normal(size=(20, 3)))
    cut_at_tip = rng.normal(size=(20, 3)) * 50.0
    T_sensor_tool = np.eye(4)
    T_sensor_tool[:3, :3] = matrix_from_rotation_vector(np.array([0.1, 0.5, -0.2]))
    T_sensor_tool[:3, 3] = [0.1, 0.0, 0.2]
    force = cut_at_tip @ T_sensor_tool[:3, :3].T
    measured = readings(R, noise=0.0) + np.hstack([force, np.cross(T_sensor_tool[:3, 3], force)])
    found = process_wrench(tool, R, measured, T_sensor_tool=T_sensor_tool)
    np.testing.assert_allclose(found[:, :3], cut_at_tip, atol=1e-9)
    np.testing.assert_allclose(found[:, 3:], 0.0, atol=1e-9)


def test_inertia_has_to_come_off_too():
    """60 Hz at 20 um with 18.5 kg: 53 N that gravity compensation takes for cutting."""
    tool = identify_held_tool(SIX, readings(SIX, noise=0.0))
    rate, n = 5000.0, 1000
    t = np.arange(n) / rate
    path = np.column_stack([20e-6 * np.sin(2 * np.pi * 60.0 * t), 0 * t, 0 * t])
    a = np.column_stack([-((2 * np.pi * 60.0) ** 2) * path[:, 0], 0 * t, 0 * t])
    R = np.tile(np.eye(3), (n, 1, 1))
    measured = readings(R, noise=0.0, acceleration=a)
    left = process_wrench(tool, R, measured)[:, 0]
    assert np.abs(left).max() == pytest.approx(52.6, abs=0.3)
    of_joints = process_wrench(tool, R, measured, acceleration=centre_acceleration(path, rate))
    assert np.abs(of_joints[20:-20]).max() < 1.0
    exact = process_wrench(tool, R, measured, acceleration=a)
    np.testing.assert_allclose(exact, 0.0, atol=1e-9)


def test_too_few_samples_for_an_acceleration():
    with pytest.raises(ShapeError, match="5 samples, expected 11"):
        centre_acceleration(np.zeros((5, 3)), 100.0)
