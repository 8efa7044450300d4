"""The next touch, and a posture in front of a part of which nothing is known."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import ProbingSettings, before_touching
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.errors import ReachError
from robotrue.measurement.formats.part_points import Features
from robotrue.planning.expectation import next_touch
from robotrue.planning.probing import Machining, ProbingTask, plan_touches
from robotrue.planning.probing_candidates import find_facing_posture, touch_candidates
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset

TIP = np.array([0.0, 0.0, 1.0])
T_BASE_PART = pose(np.eye(3), np.array([0.8, -0.1, 0.4]))
ROBOT = preset("KUKA KR160 R1570").with_tool(pose(np.eye(3), np.array([0.0, 0.0, 0.3])))


def corners(access: Array | None) -> Features:
    point = np.array([[x, y, 0.4] for x in (0.02, 0.2, 0.38) for y in (0.02, 0.18)])
    nan = np.full((6, 3), np.nan)
    return Features(
        names=tuple("ABCDEF"), point=point, normal=nan,
        access=nan if access is None else np.tile(access, (6, 1)), part=np.zeros(6, dtype=np.int64),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("access", "towards"),
    [(None, [0.0, 0.0, -1.0]), ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]), ([0.0, -1.0, 0.0], [0, 1, 0])],
)
def test_the_tool_faces_the_part(access: list[float] | None, towards: list[float]) -> None:
    features = corners(None if access is None else np.array(access))
    found = find_facing_posture(ROBOT, features, {0: T_BASE_PART}, TIP)
    reached = forward(ROBOT, found.joints)[0]
    np.testing.assert_allclose(reached[:3, :3] @ TIP, towards, atol=1e-9)
    np.testing.assert_allclose(reached[:3, 3], apply(T_BASE_PART, found.point)[0], atol=1e-9)
    low, high = ROBOT.limits.T
    assert ((found.joints > low) & (found.joints < high)).all()


def test_a_part_out_of_reach_is_named() -> None:
    with pytest.raises(ReachError, match=r"cannot touch '[A-F]' at \d+, -?\d+, \d+ mm"):
        find_facing_posture(
            ROBOT, corners(None), {0: pose(np.eye(3), np.array([5.0, 0.0, 0.0]))}, TIP
        )


def task() -> ProbingTask:
    features = corners(np.array([0.0, 0.0, 1.0]))
    place = {0: T_BASE_PART}
    work = find_facing_posture(ROBOT, features, place, TIP)
    candidates = touch_candidates(ROBOT, features, work, place).touches
    return ProbingTask(
        belief=before_touching(NominalModel(robot=ROBOT), ProbingSettings(tool_sigma=3e-4)),
        T_base_part=place,
        candidates=candidates,
        machining=Machining(
            group=("top",) * len(candidates), point=candidates.point, joints=candidates.joints,
            part=candidates.part,
        ),
        touch_sigma=1e-4,
    )  # fmt: skip


def test_the_next_touch_is_the_best_of_those_allowed_and_says_what_it_brings() -> None:
    asked = task()
    start = plan_touches(asked, 4).row
    touched = asked.candidates.subset(start)
    free = np.ones(len(asked.candidates), dtype=bool)
    free[start] = False
    found = next_touch(asked, touched, allowed=free)
    assert free[found.index]
    assert found.then < found.now
    for other in np.flatnonzero(free)[::7]:
        only = np.zeros_like(free)
        only[other] = True
        assert next_touch(asked, touched, allowed=only).then >= found.then - 1e-12
    first = next_touch(asked, None)
    assert first.now > 0.01 > found.now
