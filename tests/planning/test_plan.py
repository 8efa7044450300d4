"""Whole plans: what they promise, in which order, and what is written of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planning_cases import PAYLOAD, postures, shop

from robotrue.calibration.methods import fit
from robotrue.core.arrays import Array
from robotrue.core.regions import CubeRegion, CylinderRegion, contains
from robotrue.errors import ConfigurationError, FormatError, ReachError
from robotrue.measurement.formats.measured_files import read_measurements, read_queries
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.planning import candidates
from robotrue.planning.arm_scene import scene_of
from robotrue.planning.criteria import greedy
from robotrue.planning.expectation import next_visit, predict_accuracy
from robotrue.planning.information import Postures, before_measuring, settings_of
from robotrue.planning.order import short_order, travel
from robotrue.planning.plan_sheets import plan_sheet
from robotrue.planning.pose_plan import PlanSettings, PosePlan, plan_poses
from robotrue.program.formats import read_job
from robotrue.program.formats.krl_measure import Trigger, measuring_program
from robotrue.program.program import Motion
from robotrue.robot.configuration import controller_axes
from robotrue.robot.statics import Load, deflect_arm

WORK = CylinderRegion(angle=(-0.4, 0.4), radius=(0.8, 1.4), height=(0.6, 1.3))
FEW = PlanSettings(candidates=250, work=WORK)


@pytest.fixture(scope="module")
def plan() -> PosePlan:
    return plan_poses(shop(), 14, settings=FEW)


def test_the_plan_is_what_was_asked(plan: PosePlan) -> None:
    assert len(plan) == 14
    assert plan.candidates == 250
    assert len({tuple(q) for q in plan.joints.tolist()}) == 14
    assert sorted(plan.rank.tolist()) == list(range(14))
    low, high = shop().robot.limits.T
    margin = FEW.margin - 1e-5
    assert ((plan.joints >= low + margin) & (plan.joints <= high - margin)).all()
    np.testing.assert_allclose(plan.pre, plan.joints - FEW.step_back)
    assert (plan.approach == 1.0).all()
    assert not plan.stopped
    again = plan_poses(shop(), 14, settings=FEW)
    np.testing.assert_array_equal(plan.joints, again.joints)
    np.testing.assert_array_equal(plan.expected.mean, again.expected.mean)


def test_expected_accuracy_falls_to_no_less_than_the_floor(plan: PosePlan) -> None:
    expected = plan.expected
    assert len(expected.mean) == 15
    assert (np.diff(expected.mean) < 0.0).all()
    assert (np.diff(expected.rms) < 0.0).all()
    assert (expected.mean <= expected.rms).all()
    assert expected.floor_mean < expected.mean[-1] < expected.random_low[-1]
    assert (expected.random_low <= expected.random_high).all()


def test_the_order_is_not_longer_than_the_order_of_choice(plan: PosePlan) -> None:
    assert plan.travel <= plan.travel_as_chosen
    assert plan.travel == pytest.approx(travel(plan.joints))
    chosen = plan.joints[np.argsort(plan.rank)]
    assert plan.travel_as_chosen == pytest.approx(travel(chosen))


@pytest.mark.parametrize("seed", range(5))
def test_an_order_is_never_longer_than_the_one_given(seed: int) -> None:
    joints = np.random.default_rng(seed).uniform(-2.0, 2.0, (12, 6))
    order = short_order(joints)
    assert sorted(order.tolist()) == list(range(12))
    assert travel(joints[order]) <= travel(joints)
    line = np.linspace(0.0, 1.0, 9)[:, None] * np.ones(6)
    assert travel(line[short_order(line)]) == pytest.approx(1.0)


def test_the_plan_promises_more_than_random_poses(plan: PosePlan) -> None:
    assert plan.expected.mean[-1] < 0.9 * plan.expected.random_mean[-1]


def test_a_tolerance_stops_the_plan() -> None:
    whole = plan_poses(shop(), 20, settings=FEW)
    gains = -np.diff(whole.expected.rms)
    cut = plan_poses(shop(), 20, settings=replace(FEW, enough=float(gains[10])))
    assert cut.stopped
    assert 4 <= len(cut) < 20
    left = -np.diff(cut.expected.rms)
    assert left[-1] >= gains[10] * (1.0 - 1e-9)


def test_candidates_of_ones_own(plan: PosePlan) -> None:
    mine = postures(60, 2)
    mine[7, 4] = 3.0  # beyond its limit
    found = plan_poses(shop(), 8, settings=replace(FEW, approach="as it comes"), candidates=mine)
    np.testing.assert_array_equal(found.joints, mine[found.row])
    assert 7 not in found.row
    assert dict(found.rejected)["joint limits"] == 1
    assert len(found.pre) == 0
    np.testing.assert_array_equal(found.approach[1:], np.sign(np.diff(found.joints, axis=0)))
    assert (found.approach[0] == 0.0).all()


def test_within_keeps_the_reflector_inside() -> None:
    inside = CubeRegion(x=(0.5, 1.6), y=(-0.8, 0.8), z=(0.3, 1.6))
    found = plan_poses(shop(), 6, settings=replace(FEW, candidates=60, within=inside))
    assert contains(inside, found.position).all()
    assert dict(found.rejected)["outside the region"] > 0


def test_loads_are_measured_one_after_the_other() -> None:
    loads = (PAYLOAD, Load(mass=np.array([120.0]), com=np.array([[0.1, 0.0, 0.2]])))
    cell = shop(compliance_prior=np.full(6, np.nan))
    found = plan_poses(cell, 16, settings=replace(FEW, loads=loads))
    assert set(found.load.tolist()) == {0, 1}
    assert (np.diff(found.load) >= 0).all()
    one = plan_poses(cell, 16, settings=replace(FEW, loads=loads[:1]))
    assert found.expected.mean[-1] < one.expected.mean[-1]


def test_a_calibrated_arm_needs_other_poses() -> None:
    cell = shop()
    joints = postures(25, 1)
    position = deflect_arm(before_measuring(cell).robot, joints, PAYLOAD)[0].position
    rows = MeasurementSet(
        joints=joints, position=position, covariance=np.tile(2e-10 * np.eye(3), (25, 1, 1))
    )
    settings = replace(settings_of(cell), lean_on_prior=True)
    model = fit(cell.measured_robot, rows, method="elastic", settings=settings)
    work = Postures(joints=postures(30, 4), load=PAYLOAD)
    more = plan_poses(cell, 2, settings=FEW, model=model, work=work)
    fresh = plan_poses(cell, 4, settings=FEW, work=work)
    assert len(more) == 2
    assert more.expected.mean[0] < 0.1 * fresh.expected.mean[0]
    assert more.expected.mean[2] < more.expected.mean[0]


def test_the_sheet_is_read_back_once_it_is_filled_in(plan: PosePlan, tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_bytes(plan_sheet(plan))
    with pytest.raises(FormatError, match=r"poses\.csv:3"):
        read_measurements(path)
    lines = path.read_text().splitlines()
    points = deflect_arm(shop().measured_robot, plan.joints, PAYLOAD)[0].position
    filled = [
        line.replace(",,,,", "," + ",".join(repr(float(v * 1e3)) for v in p) + ",")
        for line, p in zip(lines[2:], points, strict=True)
    ]
    path.write_text("\n".join([*lines[:2], *filled]) + "\n")
    back = read_measurements(path)
    np.testing.assert_allclose(back.joints, plan.joints, atol=1e-9)
    np.testing.assert_allclose(back.position, points, atol=1e-12)
    np.testing.assert_array_equal(back.approach, plan.approach)
    asked = read_queries(path)
    np.testing.assert_allclose(asked.joints, plan.joints, atol=1e-9)


def test_the_sheet_names_the_load_of_every_row(tmp_path: Path) -> None:
    loads = (PAYLOAD, Load(mass=np.array([120.0]), com=np.array([[0.1, 0.0, 0.2]])))
    found = plan_poses(shop(), 8, settings=replace(FEW, loads=loads))
    path = tmp_path / "poses.csv"
    path.write_text(plan_sheet(found).decode().replace(",,,,", ",1,2,3,"))
    back = read_measurements(path)
    np.testing.assert_allclose(back.payload_mass, [(50.0, 120.0)[k] for k in found.load])
    np.testing.assert_allclose(back.payload_com, [loads[k].com[0] for k in found.load])


def test_the_program_is_read_back_with_its_axes(plan: PosePlan, tmp_path: Path) -> None:
    robot = shop().robot
    axes, pre = controller_axes(robot, plan.joints), controller_axes(robot, plan.pre)
    path = tmp_path / "poses.src"
    path.write_bytes(measuring_program("poses", axes, pre, Trigger(output=5)))
    (program,) = read_job(path)
    wanted = np.stack([pre, axes], axis=1).reshape(-1, 6)
    assert len(program) == 28
    np.testing.assert_allclose(program.axes, wanted, atol=np.deg2rad(0.51e-4))
    assert (program.motion == Motion.PTP).all()
    text = path.read_bytes().decode()
    assert text.count("PULSE($OUT[5],TRUE,0.2)") == 14
    poses = measuring_program("poses", axes, pre[:0], Trigger())
    path.write_bytes(poses)
    assert len(read_job(path)[0]) == 14


def test_names_and_triggers_krl_does_not_allow() -> None:
    axes: Array = np.zeros((2, 6))
    with pytest.raises(ConfigurationError, match="program name 'my-poses'"):
        measuring_program("my-poses", axes, axes[:0], Trigger())
    with pytest.raises(ConfigurationError, match="for 7 axes, expected 6"):
        measuring_program("poses", np.zeros((2, 7)), axes[:0], Trigger())
    with pytest.raises(ConfigurationError, match="digital output 0, expected 1 to 4096"):
        Trigger(output=0)
    with pytest.raises(ConfigurationError, match="speed 0 %"):
        Trigger(speed=0)
    with pytest.raises(ConfigurationError, match="pulse 9 s"):
        Trigger(pulse=9.0)


def test_bad_requests_say_what_to_try(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidates, "MOST", 8192)
    with pytest.raises(ConfigurationError) as few:
        plan_poses(shop(), 2)
    assert str(few.value) == (
        "2 poses, expected at least 4: even base and tool need as many. "
        "Try: 10 poses give a first model, 30 a good one."
    )
    with pytest.raises(ReachError, match="20 poses are requested, 10 postures can be measured"):
        plan_poses(shop(), 20, settings=FEW, candidates=postures(10, 1) * 0.2)
    away = CubeRegion(x=(8.0, 9.0), y=(0.0, 1.0), z=(0.0, 1.0))
    with pytest.raises(ReachError, match=r"not one of \d+ postures can be measured \(outside the"):
        plan_poses(shop(), 10, settings=replace(FEW, within=away))
    with pytest.raises(ReachError, match="region of work in 0 of the postures"):
        plan_poses(shop(), 10, settings=replace(FEW, work=away))
    with pytest.raises(ConfigurationError, match=r"candidates have shape \(3, 5\)"):
        plan_poses(shop(), 10, settings=FEW, candidates=np.zeros((3, 5)))
    with pytest.raises(ConfigurationError, match="criterion 'A'"):
        PlanSettings(criterion="A")  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="margin -1"):
        PlanSettings(margin=-1.0)


def test_a_plan_names_what_it_could_not_check() -> None:
    cell = shop(frame="tracker", tracker_position=None, link_radius=None)
    found = plan_poses(cell, 6, settings=replace(FEW, candidates=60))
    text = " ".join(found.notes)
    for words in ("line of sight was not checked", "acceptance angle", "tubes", "No obstacles"):
        assert words in text
    assert scene_of(cell, clearance=0.02).cell is cell


def test_the_next_pose_while_measuring() -> None:
    """One pose after the other is the greedy plan, with its expected accuracy, and it ends."""
    cell = shop()
    model = before_measuring(cell)
    pool = Postures(joints=postures(80, 3), load=PAYLOAD)
    work = model.work_errors(Postures(joints=postures(30, 4), load=PAYLOAD))
    whole = greedy(model.rows(pool), work.weight, 8)
    promised = predict_accuracy(work, model.rows(pool), whole.chosen, seed=1).mean
    taken: list[int] = []
    for k in range(8):
        free = ~np.isin(np.arange(80), taken)
        found = next_visit(model, pool.take(np.array(taken, dtype=int)), pool, work, allowed=free)
        assert found is not None
        assert found.index == whole.chosen[k]
        assert found.mean_now == pytest.approx(promised[k], rel=1e-6)
        assert found.mean_then == pytest.approx(promised[k + 1], rel=1e-6)
        taken.append(found.index)
    after = pool.take(np.array(taken))
    assert next_visit(model, after, pool, work, enough=1e-3) is None
    last = next_visit(model, after, pool, work)
    assert last is not None
    assert next_visit(model, after, pool, work, enough=last.gain * 1.01) is None
