"""Transfers that go wrong: caught, said in words, never worse than the target poses alone.

Simulated arm of the paper, source measured on another day in a neighbouring sector, few target
poses, judged on check poses of a third day.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robotrue.calibration.drift_prior import DEFAULTS
from robotrue.calibration.methods import fit
from robotrue.calibration.sources import TransferSource
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ModelMismatchError
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.validation.evaluation import evaluate
from robotrue.validation.guard import verdict_from_summary
from robotrue.validation.guarded_transfer import contestants, select_transfer
from robotrue_reproductions.deng2022 import scenarios

TARGET_ROWS = 6


@cache
def shop():
    """Robot, settings, source, target, check."""
    case = scenarios.scenario("S1A", 1)
    rows = scenarios.source(case).subset(np.arange(0, 126, 2))
    return (
        case.cell.known.measured_robot,
        case.settings,
        rows,
        scenarios.target(case, TARGET_ROWS),
        scenarios.check(case),
    )


@cache
def alone():
    """Mean error on the check poses of the target rows alone, m."""
    robot, settings, _, target, _ = shop()
    return error(fit(robot, target, settings=replace(settings, lean_on_prior=True)))


def error(model) -> float:
    _, settings, _, _, check = shop()
    seen = evaluate(model, check, payload=settings.payload)
    return float(np.linalg.norm(seen.after, axis=1).mean())


def fit_guarded(robot, target, sources, settings, **options):
    """The winner of the contest between all candidates."""
    found = contestants(robot, target, sources, settings, **options)
    return select_transfer(found, robot, target, settings)


def guarded(source, target=None, *, settings=None, relation="campaign", drift=None):
    """The verdict and all doubts, after checking the promise on poses nobody saw."""
    robot, usual, _, rows, _ = shop()
    sources = [TransferSource(measurements=source, relation=relation, name="old")]
    model = fit_guarded(
        robot,
        rows if target is None else target,
        sources,
        usual if settings is None else settings,
        drift=drift,
        method="elastic",
    )
    verdict, _ = verdict_from_summary(model.training_summary())
    bar = verdict.noise if np.isfinite(verdict.noise) else 0.0
    assert error(model) <= alone() + bar
    return verdict, " | ".join(model.training_summary()["doubts"])


def test_a_sound_source_is_used_and_beats_the_target_alone():
    _, _, source, _, _ = shop()
    verdict, said = guarded(source)
    assert verdict.winner == "transfer"
    assert (verdict.checked, verdict.target_rows) == (True, TARGET_ROWS)
    assert "left out" not in said
    assert "increase the error" not in said
    assert "too tight; its scales" not in said


def test_millimetres_read_as_metres():
    _, _, source, _, _ = shop()
    verdict, said = guarded(replace(source, position=1e3 * source.position))
    assert verdict.winner == "target-only"
    assert "source old is left out: " in said
    assert "times those of the commanded poses: millimetres were read as metres" in said


def test_another_frame_that_is_far_off():
    _, _, source, _, _ = shop()
    verdict, said = guarded(replace(source, position=source.position + np.array([0.0, 0.0, 1.0])))
    assert verdict.winner == "target-only"
    assert "source old is left out: " in said
    assert "the positions are not in the robot base" in said


def test_a_frame_that_is_a_little_off():
    _, _, source, _, _ = shop()
    verdict, said = guarded(replace(source, position=source.position + np.array([0.0, 0.005, 0.0])))
    assert verdict.winner in ("transfer", "target-only")
    assert "source old and the target are in different frames: they agree to 0.1" in said
    assert "after a shift of 4.97 mm" in said
    assert "larger than expected of a campaign" in said


def test_a_source_in_the_tracker_frame():
    _, _, source, _, _ = shop()
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    away = replace(
        source, frame="tracker", position=source.position @ turned.T + np.array([2.0, 1.0, 0.5])
    )
    verdict, _ = guarded(away)
    assert verdict.winner == "transfer"
    robot, settings, _, target, _ = shop()
    found = contestants(
        robot, target, [TransferSource(measurements=away, name="old")], settings, method="elastic"
    )
    with pytest.raises(Exception, match="differ in number of joints or in frame"):
        found.transfers["pooled"](target)


def test_a_source_of_another_robot_type():
    _, _, source, _, _ = shop()
    ur = preset("ur10")
    verdict, said = guarded(replace(source, position=forward(ur, source.joints)[:, :3, 3]))
    assert verdict.winner == "target-only"
    assert "source old is left out: " in said
    assert "this is not the measured robot" in said
    robot, settings, _, target, _ = shop()
    known = fit(robot, source, method="nominal", settings=settings)
    wrong = TransferSource(model=replace(known, robot=ur), name="ur")
    found = contestants(robot, target, [wrong], settings, method="elastic")
    assert not found.transfers
    assert found.doubts[0].startswith("source ur is left out: source 'ur' is a ")


def test_rows_of_the_source_shuffled():
    _, _, source, _, _ = shop()
    order = np.random.default_rng(0).permutation(len(source))
    verdict, said = guarded(replace(source, position=source.position[order]))
    assert verdict.winner == "target-only"
    assert "joints and positions do not belong together" in said


def test_labels_shuffled_so_that_every_point_is_plausible():
    robot, _, source, target, _ = shop()
    commanded = forward(robot, source.joints)[:, :3, 3]
    order = np.random.default_rng(0).permutation(len(source))
    wrong = replace(source, position=commanded + (source.position - commanded)[order])
    verdict, said = guarded(wrong)
    assert verdict.winner == "target-only"
    assert "the sources increase the error: transfer has" in said
    assert "for target-only; the sources are not used." in said
    learned = TransferSource(measurements=wrong, name="old")
    found = contestants(robot, target, [learned], shop()[1])
    assert "a fit has no effect" in " ".join(found.doubts)
    assert "(rows shuffled?)" in " ".join(found.doubts)


def test_a_tenth_of_the_source_is_grossly_wrong():
    _, _, source, _, _ = shop()
    rng = np.random.default_rng(0)
    rows = rng.choice(len(source), len(source) // 10, replace=False)
    position = source.position.copy()
    position[rows] += rng.normal(0.0, 5.0 * MM, (len(rows), 3))
    verdict, said = guarded(replace(source, position=position))
    assert verdict.checked
    assert f"source old: {len(rows)} of {len(source)} rows carry no weight" in said
    assert "gross errors; check these rows." in said


def test_target_points_all_at_one_place():
    robot, usual, source, target, _ = shop()
    joints = target.joints[:1] + 0.02 * (target.joints - target.joints.mean(axis=0))
    offset = target.position[:1] - forward(robot, target.joints[:1])[:, :3, 3]
    noise = 1e-5 * np.random.default_rng(0).standard_normal((len(joints), 3))
    place = forward(robot, joints)[:, :3, 3] + offset + noise
    near = replace(target, joints=joints, position=place)
    model = fit_guarded(
        robot, near, [TransferSource(measurements=source, name="old")], usual, method="elastic"
    )
    verdict, _ = verdict_from_summary(model.training_summary())
    assert "of one place: the contest does not hold for other parts of the region" in " ".join(
        verdict.doubts
    )
    rest = replace(near, joints=np.tile(joints[:1], (len(near), 1)), position=place)
    with pytest.raises(ImplausibleDataError, match=r"positions lie within .* of one point"):
        fit_guarded(robot, rest, [TransferSource(measurements=source, name="old")], usual)


@pytest.mark.parametrize(
    ("factor", "said_so"), [(0.1, "the prior is too tight"), (10.0, "the prior is too loose")]
)
def test_a_prior_ten_times_too_tight_or_too_loose(factor, said_so):
    _, usual, source, _, _ = shop()
    scales = PriorScales(**{n: factor * getattr(usual.scales, n) for n in PriorScales.__slots__})
    verdict, said = guarded(source, settings=replace(usual, scales=scales))
    assert verdict.winner == "transfer"
    assert said_so in said


def test_a_drift_prior_ten_times_too_tight_is_learned_or_refused():
    _, _, source, _, _ = shop()
    usual = DEFAULTS["campaign"]
    tight = replace(usual, **{n: 0.1 * getattr(usual, n) for n in usual.__slots__})
    verdict, _ = guarded(source, drift=tight)
    assert verdict.checked


def test_target_rows_of_another_robot_are_refused():
    robot, settings, source, target, _ = shop()
    short = replace(
        target,
        joints=target.joints[:, :5],
        approach=target.approach[:, :5],
        joint_temperature=target.joint_temperature[:, :5],
    )
    sources = [TransferSource(measurements=source, name="old")]
    with pytest.raises(ModelMismatchError, match="5 joints in the measurements, 6 in"):
        fit_guarded(robot, short, sources, settings)
    few = target.subset(np.arange(3))
    with pytest.raises(ImplausibleDataError, match="another unit, frame or robot"):
        fit_guarded(robot, replace(few, position=1e3 * few.position), sources, settings)
