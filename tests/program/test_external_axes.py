"""Work frames that external axes move, against the chain written out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.poses import inverse, pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.program.external_axes import ExternalAxis, carry_frames

FLOOR = pose_from_xyz_abc(np.array([900.0, -200.0, 300.0]) * MM, np.array([15.0, -4.0, 8.0]) * DEG)
ON_TABLE = pose_from_xyz_abc(np.array([1600.0, 50.0, 450.0]) * MM, np.array([5.0, 0.0, 0.0]) * DEG)
RAIL = ExternalAxis(number=1, direction=np.array([0.0, 1.0, 0.0]), at=0.1, carries_robot=True)
TABLE = ExternalAxis(
    number=2,
    direction=np.array([0.0, 0.0, -3.0]),
    point=np.array([1.5, 0.0, 0.4]),
    at=30.0 * DEG,
    frames=("2",),
)


def test_rail_and_turntable_in_one_chain() -> None:
    frame = np.array([0, 1, 1, 1, 0])
    values = np.full((5, 6), np.nan)
    values[:, 0] = [100.0, 850.0, 850.0, -20.0, 100.0]
    values[:, 1] = [30.0, 75.0, 75.0, 75.0, 12.0]
    riders = np.array([[False, False], [False, True]])
    got = carry_frames(
        (RAIL, TABLE), np.array([FLOOR, ON_TABLE]), frame, values, riders, np.zeros(2, np.bool_)
    )
    assert not got.unknown.any()
    assert len(got.T_base_frame) == 4  # two given, two poses of the one on the table
    assert got.frame.tolist() == [0, 2, 2, 3, 0]
    turned = pose(matrix_from_abc(np.array([-45.0, 0.0, 0.0]) * DEG), np.zeros(3))
    centre = pose(np.eye(3), np.array([1.5, 0.0, 0.4]))
    for k, e1 in ((2, 0.85), (3, -0.02)):
        robot = pose(np.eye(3), np.array([0.0, e1 - 0.1, 0.0]))
        expected = inverse(robot) @ centre @ turned @ inverse(centre) @ ON_TABLE
        np.testing.assert_allclose(got.T_base_frame[k], expected, atol=1e-14)


def test_a_value_that_is_needed_and_not_there() -> None:
    values = np.full((2, 6), np.nan)
    values[0, 0] = 500.0
    riders, still = np.zeros((1, 1), np.bool_), np.zeros(1, np.bool_)
    got = carry_frames((RAIL,), FLOOR[None], np.zeros(2, np.int64), values, riders, still)
    assert got.unknown.tolist() == [False, True]
    on_robot = carry_frames((RAIL,), FLOOR[None], np.zeros(2, np.int64), values, riders, ~still)
    assert not on_robot.unknown.any()
    assert on_robot.frame.tolist() == [0, 0]


@pytest.mark.parametrize(
    "wrong",
    [
        {"number": 7},
        {"direction": np.zeros(3)},
        {"carries_robot": True, "point": np.zeros(3)},
        {"carries_robot": True, "frames": ("1",)},
    ],
)
def test_what_no_axis_is(wrong: dict[str, object]) -> None:
    with pytest.raises(ShapeError):
        ExternalAxis(**{"number": 1, "direction": np.array([1.0, 0.0, 0.0]), **wrong})  # type: ignore[arg-type]


def test_an_axis_without_any_value_rests_only_where_the_cell_says_so() -> None:
    values = np.full((2, 6), np.nan)
    riders, still = np.zeros((1, 1), np.bool_), np.zeros(1, np.bool_)
    frame = np.zeros(2, np.int64)
    assert carry_frames((RAIL,), FLOOR[None], frame, values, riders, still).unknown.all()
    rests = carry_frames((RAIL,), FLOOR[None], frame, values, riders, still, rest=True)
    assert not rests.unknown.any()
    assert rests.frame.tolist() == [0, 0]
    values[1, 0] = 300.0
    some = carry_frames((RAIL,), FLOOR[None], frame, values, riders, still, rest=True)
    assert some.unknown.tolist() == [True, False]
