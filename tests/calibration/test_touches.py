"""Observations of touches: their Jacobians against differences, and what they see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.belief import Belief
from robotrue.calibration.new_rows import NewRows
from robotrue.calibration.parameters import ParameterLayout, State, difference, retract
from robotrue.calibration.settings import prior_belief
from robotrue.calibration.touches import frame_displacement, touch_rows
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse, pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.surfaces import Cylinder, Plane, TriangleMesh
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.probing_set import KnownDistance, ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.robot.statics import NO_LOAD

ROBOT = preset("KUKA KR160 R1570")
T_BASE_PART = pose_from_xyz_abc(np.array([1.0, 0.2, 0.6]), np.array([0.4, 0.1, -0.8]))
TETRAHEDRON = TriangleMesh(
    vertices=np.array([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]),
    faces=np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)
SURFACES = (
    Plane(point=np.array([0.0, 0.1, 0.0]), normal=np.array([0.3, -1.0, 0.2])),
    Cylinder(point=np.zeros(3), axis=np.array([0.1, 0.2, 1.0]), radius=0.05),
    TETRAHEDRON,
)


def touches() -> ProbingSet:
    """Points, a normal, three surfaces, two sockets with a known distance."""
    rng = np.random.default_rng(4)
    joints = rng.uniform(-0.6, 0.6, (10, 6))
    near = apply(inverse(T_BASE_PART), forward(ROBOT, joints)[:, :3, 3])
    part = np.array([0, 0, 0, 0, 0, 0, 0, 2, 2, 5])
    touched = np.array([-1, -1, -1, 0, 1, 2, -1, -1, -1, -1])
    normal = np.full((10, 3), np.nan)
    normal[6] = [0.0, 0.6, 0.8]
    point = np.where((part == 0)[:, None], near, 0.0)
    return ProbingSet(
        names=tuple(str(i) for i in range(10)),
        point=point,
        joints=joints,
        normal=normal,
        part=part,
        surfaces=SURFACES,
        touched=touched,
        radius=2e-3,
        sockets=(2, 5),
        distances=(KnownDistance(first=2, second=5, length=0.5, sigma=2e-5),),
    )


def rows_and_belief() -> tuple[NewRows, Belief]:
    rng = np.random.default_rng(5)
    belief = prior_belief(ROBOT.with_errors(1e-4 * rng.standard_normal(len(ROBOT.errors))))
    frames = {0: T_BASE_PART}
    for k, place in ((2, [0.9, 0.1, 0.3]), (5, [0.7, -0.4, 0.5])):
        frames[k] = np.eye(4)
        frames[k][:3, 3] = place
    return touch_rows(belief, touches(), frames, touch_sigma=1e-4, payload=NO_LOAD), belief


def test_every_jacobian_is_that_of_differences() -> None:
    rows, belief = rows_and_belief()
    layout = rows.layout
    assert layout.size == layout.robot_size + 6 + 3 + 3
    state = State(robot=belief.robot.with_errors(belief.errors), T_tracker_base=rows.T_tracker_base)
    seen = 0
    for observation in rows.observations:
        found = observation.linearise(layout, state)
        for column in range(layout.size):
            step = np.zeros(layout.size)
            size = 1e-8 if layout.names[column].startswith("compliance") else 1e-6
            step[column] = size
            ahead = observation.linearise(layout, retract(layout, state, step)).residual
            behind = observation.linearise(layout, retract(layout, state, -step)).residual
            np.testing.assert_allclose(
                found.jacobian[:, :, column],
                (behind - ahead) / (2.0 * size),
                atol=2e-5 * max(1.0, float(np.abs(found.jacobian[:, :, column]).max())),
                err_msg=layout.names[column],
            )
        seen += len(observation.rows)
    assert seen == 11


def test_rows_are_kept_apart_and_in_order() -> None:
    rows, belief = rows_and_belief()
    found = np.concatenate([piece.rows for piece in rows.pieces(belief)])
    np.testing.assert_array_equal(np.sort(found), np.arange(11))
    chosen = np.zeros(11, dtype=bool)
    chosen[[3, 10]] = True
    np.testing.assert_array_equal(
        np.concatenate([piece.rows for piece in rows.pieces(belief, chosen)]), [3, 10]
    )


def test_a_surface_sees_only_its_normal() -> None:
    rows, belief = rows_and_belief()
    floor = replace(rows, observations=rows.observations[1:2])
    piece = floor.pieces(belief)[0]
    shift = piece.columns[0, 0, belief.end : belief.end + 3]
    np.testing.assert_allclose(shift, SURFACES[0].normal, atol=1e-12)


def test_parts_in_one_place_have_no_distance() -> None:
    rows, belief = rows_and_belief()
    together = {**rows.T_tracker_base, 5: rows.T_tracker_base[2]}
    with pytest.raises(ImplausibleDataError, match="parts 2 and 5 are 0 mm apart"):
        replace(rows, T_tracker_base=together).pieces(belief)


@pytest.mark.parametrize("size", [3, 6])
def test_a_step_of_the_columns_is_the_displacement_of_the_frame(size: int) -> None:
    layout = ParameterLayout(dof=6, stations=(0,), places=(0,) if size == 3 else ())
    place = T_BASE_PART if size == 6 else pose_from_xyz_abc(T_BASE_PART[:3, 3], np.zeros(3))
    state = State(robot=ROBOT, T_tracker_base={0: inverse(place)})
    step = np.zeros(layout.size)
    step[-size:] = 1e-6 * np.array([3.0, -2.0, 1.0, 0.5, 2.0, -1.5])[:size]
    moved = retract(layout, state, step)
    np.testing.assert_allclose(difference(layout, moved, state), step, atol=1e-15)
    new = inverse(moved.T_tracker_base[0])
    turn = rotation_vector_from_matrix(new[:3, :3] @ place[:3, :3].T)
    true: Array = np.concatenate([new[:3, 3] - place[:3, 3], turn])[:size]
    np.testing.assert_allclose(frame_displacement(place, size) @ step[-size:], true, atol=1e-11)
    assert np.linalg.norm(true) > 1e-6
