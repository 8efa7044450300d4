"""Plans of touches: what they promise, what they refuse, and whom they warn."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from robotrue.calibration.belief import condition, with_nuisances
from robotrue.calibration.machined import (
    compensated_covariance,
    tip_columns,
    unchanged_covariance,
)
from robotrue.calibration.model import Query
from robotrue.calibration.settings import FitSettings, prior_belief
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.cell.registration.fit import frame_gain
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.units import DEG, MM
from robotrue.errors import (
    ConfigurationError,
    FormatError,
    ObservabilityError,
    ReachError,
    ShapeError,
)
from robotrue.measurement.formats.part_points import Features, read_points
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.plan_sheets import touch_sheet
from robotrue.planning.probing import ROUGH, ROUGH_TURN, Machining, ProbingTask, plan_touches
from robotrue.planning.probing_candidates import TouchLimits, touch_candidates
from robotrue.planning.probing_frame import plan_frame_touches
from robotrue.planning.probing_plan import spread_touches
from robotrue.robot.configuration import axis_relation
from robotrue.robot.forward import forward
from robotrue_reproductions.feng2018.machining_cell import (
    EDGE,
    FACES,
    SIZE,
    T_BASE_DRAWN,
    attitude,
    feng_cell,
    nominal_joints,
)

ROBOT = feng_cell(0).nominal
SIGMA = 0.1 * MM
OUTWARD = {"R": [0.0, -1.0, 0.0], "L": [0.0, 1.0, 0.0], "T": [0.0, 0.0, 1.0]}


def grid(face: str, count: int) -> Array:
    axis, level = FACES[face]
    free = [k for k in range(3) if k != axis]
    lines = [np.linspace(EDGE, SIZE[k] - EDGE, count) for k in free]
    out = np.full((count**2, 3), level)
    out[:, free] = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 2)
    return out


def features(faces: str, *, normal: bool = False) -> Features:
    points = np.concatenate([grid(face, 3) for face in faces])
    direction = np.repeat([OUTWARD[face] for face in faces], 9, axis=0)
    nothing = np.full_like(points, np.nan)
    return Features(
        names=tuple(f"{face}{k + 1}" for face in faces for k in range(9)),
        point=points,
        normal=direction if normal else nothing,
        access=nothing if normal else direction,
        part=np.zeros(len(points), dtype=np.int64),
    )


@cache
def machining(faces: str = "RL") -> Machining:
    work = {face: grid(face, 3) for face in faces}
    joints = [
        nominal_joints(
            ROBOT,
            pose(np.broadcast_to(attitude(face), (9, 3, 3)), apply(T_BASE_DRAWN, points)),
            face,
        )
        for face, points in work.items()
    ]
    return Machining(
        group=tuple({"R": "front", "L": "back"}[face] for face in work for _ in range(9)),
        point=np.concatenate(list(work.values())),
        joints=np.concatenate(joints),
        part=np.zeros(9 * len(work), dtype=np.int64),
    )


@cache
def task(faces: str = "RLT", machined: str = "RL", lean: float = 15.0) -> ProbingTask:
    scales = PriorScales(tool=0.3 * MM)
    limits = TouchLimits(lean=lean * DEG)
    found = touch_candidates(
        ROBOT, features(faces), machining(machined), {0: T_BASE_DRAWN}, limits=limits
    )
    return ProbingTask(
        belief=prior_belief(ROBOT, FitSettings(scales=scales), ripple=np.full(4, 4e-5)),
        T_base_part={0: T_BASE_DRAWN},
        candidates=found.touches,
        machining=machining(machined),
        touch_sigma=SIGMA,
    )


def test_the_promise_is_the_covariance_after_these_touches() -> None:
    """The plan's numbers are those of a belief conditioned on its touches."""
    now = task()
    plan = plan_touches(now, 8)
    belief = with_nuisances(now.belief, np.repeat([ROUGH, ROUGH_TURN], 3))
    frames = {0: T_BASE_DRAWN}
    rows = tip_columns(belief, Query(joints=plan.touches.joints), T_base_part=frames)
    noise = np.sqrt(SIGMA**2 + belief.repeatability**2)
    flat = rows.reshape(-1, rows.shape[2]) / noise
    after = condition(belief, flat, np.zeros(len(flat)))
    stated = compensated_covariance(after, now.machining.query, T_base_part=frames)
    np.testing.assert_allclose(plan.covariance, stated, rtol=1e-4, atol=1e-13)
    rms = np.sqrt(np.trace(stated, axis1=1, axis2=2).mean())
    assert plan.mean[-1] == pytest.approx(rms, rel=1e-4)


def test_planned_touches_promise_more_than_spread_ones() -> None:
    for count in (6, 10):
        plan = plan_touches(task(), count)
        assert (np.diff(plan.mean) < 0.0).all()
        assert plan.mean[-1] < 0.95 * plan.spread_mean[-1]
        assert len(set(plan.row.tolist())) == count
        assert not plan.stopped


def test_the_worst_point_can_be_the_goal() -> None:
    worst = plan_touches(task("RT", lean=0.0), 7, goal="worst")
    mean = plan_touches(task("RT", lean=0.0), 7, goal="mean")
    assert worst.worst[-1] <= mean.worst[-1] * (1.0 + 1e-9)


def test_a_side_that_no_touch_covers_is_named_with_its_cure() -> None:
    plan = plan_touches(task("R"), 12)
    (warning,) = plan.warnings
    assert warning.startswith("no touch covers 'back': expected uncertainty of its points ")
    assert warning.endswith("add features that can be probed in its postures.")
    front, back = plan.groups
    assert front.covered
    assert back.uncertainty > 3.0 * front.uncertainty
    assert back.best > 2.0 * back.at_touches
    assert plan_touches(task("RL"), 12).warnings == ()


def test_it_stops_below_the_tolerance_with_as_few_touches() -> None:
    long = plan_touches(task(lean=0.0), 9)
    tolerance = float(long.mean[7])
    plan = plan_touches(task(lean=0.0), 9, tolerance=tolerance)
    assert plan.stopped
    assert len(plan.row) <= 7
    assert plan.mean[-1] <= tolerance


def test_touches_of_surfaces_tell_one_direction() -> None:
    """Front, back and top fix all but the shift along them; one feature point fixes that."""
    surfaces = features("RLT", normal=True)
    here = {0: T_BASE_DRAWN}
    found = touch_candidates(ROBOT, surfaces, machining(), here, limits=TouchLimits(lean=0.0))
    with pytest.raises(ObservabilityError, match="most of all the shift along x of the part"):
        plan_touches(replace(task(), candidates=found.touches), 12)
    normal = surfaces.normal.copy()
    normal[0] = np.nan
    mixed = replace(surfaces, normal=normal)
    found = touch_candidates(ROBOT, mixed, machining(), here, limits=TouchLimits(lean=0.0))
    plan = plan_touches(replace(task(), candidates=found.touches), 12)
    assert "R1" in plan.touches.names
    assert plan.mean[-1] > plan_touches(task(lean=0.0), 12).mean[-1]
    assert plan.mean[-1] < 1.0 * MM


def test_too_few_touches_fix_no_frame() -> None:
    with pytest.raises(ObservabilityError, match="2 touches do not fix the frame of part 0"):
        plan_touches(task(), 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(n=0), "0 touches are requested"),
        (dict(n=100_000), "100000 touches are requested"),
        (dict(n=5, goal="least"), "goal 'least'"),
    ],
)
def test_what_cannot_be_planned(change: dict, message: str) -> None:
    n = change.pop("n")
    with pytest.raises(ConfigurationError, match=message):
        plan_touches(task(), n, **change)


def test_a_task_that_does_not_belong_together() -> None:
    now = task()
    with pytest.raises(ConfigurationError, match="already has frames"):
        replace(now, belief=with_nuisances(now.belief, np.ones(6)))
    with pytest.raises(ConfigurationError, match="touch sigma -1 mm"):
        replace(now, touch_sigma=-1e-3)
    with pytest.raises(ShapeError, match="5 joints"):
        replace(now, machining=replace(now.machining, joints=now.machining.joints[:, :5]))
    with pytest.raises(ShapeError, match="no machined posture"):
        Machining(group=(), point=np.empty((0, 3)), joints=np.empty((0, 6)), part=np.empty(0))
    bare = ProbingSet(names=("a",), point=np.zeros((1, 3)), position=np.zeros((1, 3)))
    with pytest.raises(ConfigurationError, match="need joints"):
        replace(now, candidates=bare)


def test_a_frame_for_a_model_as_it_is() -> None:
    """The promise is that of the least-squares frame from these touches."""
    now = task("R", "R", lean=0.0)
    plan = plan_frame_touches(now, 8)
    stated = unchanged_covariance(
        now.belief,
        Query(joints=plan.touches.joints),
        now.machining.query,
        points=now.machining.point,
        T_base_part=T_BASE_DRAWN,
        gain=frame_gain(T_BASE_DRAWN, plan.touches.point),
        touch_sigma=SIGMA,
    )
    np.testing.assert_allclose(plan.covariance, stated, rtol=1e-6, atol=1e-15)
    assert np.isnan(plan.mean[:3]).all()
    assert plan.mean[-1] < plan.mean[3]
    assert plan.warnings == ()


def test_a_frame_for_each_side_beats_one_for_both() -> None:
    both = task("RL", lean=0.0)
    one = plan_frame_touches(both, 12)
    touched = np.array([name[0] == "L" for name in both.candidates.names])
    cut = np.array([name == "back" for name in both.machining.group])
    split = replace(
        both,
        T_base_part={0: T_BASE_DRAWN, 1: T_BASE_DRAWN},
        candidates=replace(both.candidates, part=touched.astype(np.int64)),
        machining=replace(both.machining, part=cut.astype(np.int64)),
    )
    each = plan_frame_touches(split, 12)
    assert each.mean[-1] < 0.5 * one.mean[-1]
    assert {name[0] for name in each.touches.names} == {"R", "L"}
    assert one.groups[0].best < 0.5 * one.groups[0].uncertainty


def test_frames_that_cannot_be() -> None:
    with pytest.raises(ObservabilityError, match="1 frames need at least 3"):
        plan_frame_touches(task(), 2)
    line = task().candidates
    edge = np.flatnonzero((line.point[:, 1] == 0.0) & (line.point[:, 2] < 2.0 * EDGE))
    with pytest.raises(ObservabilityError, match=r"lie on one line, 0\.0 mm off it"):
        plan_frame_touches(replace(task(), candidates=line.subset(edge)), 6)
    surfaces = touch_candidates(ROBOT, features("RL", normal=True), machining(), {0: T_BASE_DRAWN})
    with pytest.raises(ConfigurationError, match="planned from feature points"):
        plan_frame_touches(replace(task(), candidates=surfaces.touches), 6)


def test_candidates_touch_where_they_say_and_from_where_they_can() -> None:
    limits = TouchLimits(lean=10.0 * DEG)
    found = touch_candidates(ROBOT, features("RLT"), machining(), {0: T_BASE_DRAWN}, limits=limits)
    touches = found.touches
    T = forward(ROBOT, touches.joints)
    np.testing.assert_allclose(T[:, :3, 3], apply(T_BASE_DRAWN, touches.point), atol=1e-9)
    outward = np.array([OUTWARD[name[0]] for name in touches.names])
    against = -np.einsum("ni,ni->n", T[:, :3, 2], outward)
    assert (against > np.cos(60.0 * DEG)).all()
    assert found.tried == len(touches) + sum(count for _, count in found.rejected)
    assert dict(found.rejected)["the tool comes from the wrong side"] > 0
    assert {name[0] for name in touches.names} == {"R", "L", "T"}  # T: faced by no machining
    assert found.untouchable == ()


def test_more_candidates_than_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robotrue.planning.probing_candidates.MOST", 50)
    found = touch_candidates(ROBOT, features("RLT"), machining(), {0: T_BASE_DRAWN})
    assert len(found.touches) == 50
    assert found.tried == 50 + sum(count for _, count in found.rejected)
    assert dict(found.rejected)["more than are checked"] > 0
    assert {name[0] for name in found.touches.names} == {"R", "L", "T"}


def test_features_that_cannot_be_touched() -> None:
    away = replace(features("R"), point=np.add(grid("R", 3), [9.0, 0.0, 0.0]))
    with pytest.raises(ReachError, match=r"not one of 360 touches of 9 features can be made"):
        touch_candidates(ROBOT, away, machining(), {0: T_BASE_DRAWN})
    some = replace(features("R"), point=np.vstack([grid("R", 3)[:8], [[0.0, 0.0, 9.0]]]))
    found = touch_candidates(ROBOT, some, machining(), {0: T_BASE_DRAWN})
    assert found.untouchable == ("R9",)
    with pytest.raises(ShapeError, match="tip_axis is zero"):
        TouchLimits(tip_axis=np.zeros(3))


def test_spread_touches_take_every_feature_before_one_twice() -> None:
    candidates = task("R").candidates
    order = spread_touches(candidates, 12)
    names = [candidates.names[k] for k in order]
    assert len(set(names[:9])) == 9
    assert len(set(order.tolist())) == 12
    far = np.linalg.norm(candidates.point[order[0]] - candidates.point[order[1]])
    assert far > 0.5


def without_first_line(path: Path) -> None:
    path.write_text(path.read_text().split("\n", 1)[1])


def test_the_sheet_is_what_registering_reads(tmp_path: Path) -> None:
    plan = plan_touches(task(), 6)
    robot = task().belief.robot
    read = partial(read_points, relation=axis_relation(robot))
    path = tmp_path / "touches.csv"
    path.write_bytes(touch_sheet(plan.touches, ("part",), robot))
    with pytest.raises(FormatError, match=r"touches.csv:1: its joints are planned ones, nothing"):
        read(path)
    without_first_line(path)
    with pytest.raises(FormatError, match=r"columns a1_deg\.\. are axes of a controller"):
        read_points(path)
    back = read(path).touches
    assert back.names == plan.touches.names
    np.testing.assert_allclose(back.joints, plan.touches.joints, atol=1e-8)
    np.testing.assert_allclose(back.point, plan.touches.point, atol=1e-9)
    two = replace(plan.touches, part=np.array([0, 1, 0, 1, 0, 1]))
    path.write_bytes(touch_sheet(two, ("left", "right"), robot))
    without_first_line(path)
    assert read(path).parts == ("left", "right")
