"""Few rows: scales held to a law, an equal posterior at less cost, honest width."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures, ripple_shift

from robotrue.calibration.evidence import PriorGroup, posterior, sums_of
from robotrue.calibration.held_out_blocks import HeldOutRows, average_held_out, widen
from robotrue.calibration.learned import LearnedMethod, LearnedParts, climb_ladder, share_waves
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.calibration.scale_learning import held_scales, learn
from robotrue.calibration.terms.ripple import LAW, Ripple, harmonics
from robotrue.core.robust import student_factor
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.statics import deflect_arm

NOISE = 2e-5
REPEATABILITY = 2e-5  # m, per axis
SETTINGS = FitSettings(payload=PAYLOAD, repeatability=3.6158 * REPEATABILITY, campaign_shift=0.0)


def group(k: int, *, rest: float = 1.0, size: int = 10) -> PriorGroup:
    columns = np.arange(size * k, size * (k + 1))
    return PriorGroup(name=f"g{k}", columns=columns, sd=rest, rest=rest, hold=0.5)


def test_held_scales_stay_at_rest_where_nothing_is_seen():
    groups = [group(0, rest=2.0), group(1, rest=0.1)]
    found = held_scales(groups, np.zeros(2), np.zeros(2))
    assert found[0] == pytest.approx(2.0)
    assert found[1] == pytest.approx(0.1)


def test_held_scales_follow_the_data_where_much_is_seen():
    groups = [group(0), group(1)]
    squares, seen = np.array([400.0 * 3.0**2, 400.0 * 0.2**2]), np.array([400.0, 400.0])
    found = held_scales(groups, squares, seen)
    assert found[0] == pytest.approx(3.0, rel=2e-3)  # MacKay: squares / seen
    assert found[1] == pytest.approx(0.2, rel=2e-3)


def test_held_scales_grow_with_the_weights_and_take_the_others_along():
    groups = [group(0), group(1)]
    seen = np.array([3.0, 0.0])
    found = [held_scales(groups, np.array([a, 0.0]), seen) for a in (0.3, 3.0, 30.0, 300.0)]
    own, other = (np.array([f[k] for f in found]) for k in (0, 1))
    assert (np.diff(own) > 0.0).all()
    assert (np.diff(other) > 0.0).all()
    assert 1.0 < other[-1] < own[-1]
    assert found[1][0] == pytest.approx(1.0)  # three squares for three seen: as at rest


def test_a_held_scale_is_where_log_evidence_plus_log_prior_is_flat():
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((60, 10))
    values = columns @ (2.0 * rng.standard_normal(10)) + rng.standard_normal(60)
    sums = [sums_of([(columns, values, 60)], 10)]
    at = learn(sums, [group(0)], np.ones(1), steps=200)
    sd, noise = at.groups[0].sd, at.noise

    def objective(factor: float, common: float) -> float:
        x = 2.0 * np.log(factor * sd)
        trial = posterior(sums, [replace(at.groups[0], sd=factor * sd)], noise)
        return trial.evidence - 0.25 * 0.5 * (x - common) ** 2 - 0.25 * 0.5 * common**2

    best = [max(objective(f, c) for c in np.linspace(-4, 4, 81)) for f in (0.9, 1.0, 1.1)]
    assert best[1] > best[0]
    assert best[1] > best[2]


@pytest.mark.parametrize("channels", [1, 2])
def test_few_rows_have_the_posterior_of_their_sums(channels):
    rng = np.random.default_rng(4)
    groups = [group(0, rest=0.7, size=20), group(1, rest=0.2, size=20)]
    noise = np.array([0.3, 2.0])[:channels]
    sums = []
    for _ in range(channels):
        columns = rng.standard_normal((15, 40))
        values = columns @ rng.standard_normal(40) + rng.standard_normal(15)
        sums.append(sums_of([(columns[:9], values[:9], 8.5), (columns[9:], values[9:], 6)], 40))
    assert all(s.few for s in sums)
    plain = [
        replace(s, gram=s.whole_gram(), columns=np.empty((0, 0)), values=np.empty(0)) for s in sums
    ]
    lazy, many = posterior(sums, groups, noise), posterior(plain, groups, noise)
    few, queries = lazy.with_root(), rng.standard_normal((5, 3, 40))
    np.testing.assert_allclose(lazy.spread(queries), many.spread(queries), atol=1e-10)
    np.testing.assert_allclose(few.mean, many.mean, atol=1e-10)
    np.testing.assert_allclose(few.root.T @ few.root, many.root.T @ many.root, atol=1e-10)
    np.testing.assert_allclose(few.determined, many.determined, atol=1e-9)
    assert few.evidence == pytest.approx(many.evidence, abs=1e-8)
    kept = rng.random(40) < 0.6
    np.testing.assert_array_equal(sums[0].part(kept).columns, sums[0].columns[:, kept])


def test_many_rows_are_not_kept():
    rng = np.random.default_rng(5)
    blocks = [(rng.standard_normal((10, 20)), rng.standard_normal(10), 10.0)] * 3
    assert not sums_of(blocks, 20).few


def test_the_law_of_few_rows_falls_and_covers_every_coefficient_once():
    groups = Ripple(dof=2, cycles=harmonics(64)).groups(few=True)
    np.testing.assert_array_equal(
        np.sort(np.concatenate([g.columns for g in groups])), np.arange(2 * 64 * 2)
    )
    sd = np.concatenate([g.sd * g.unit for g in groups if g.name.startswith("ripple/1/")])
    np.testing.assert_allclose(sd, LAW / np.repeat(harmonics(64), 2))


def test_students_factor_falls_to_one():
    factors = np.array([student_factor(f) for f in (6.0, 12.0, 30.0, 100.0, 1e6)])
    assert (np.diff(factors) < 0.0).all()
    assert factors[-1] == pytest.approx(1.0, abs=1e-4)
    assert student_factor(30.0) == pytest.approx(3.0 * 2.922277 / 7.814728, rel=1e-5)  # F table


def held_out(rows: int, *, spread: float = 1.0, instrument: float = 0.0) -> HeldOutRows:
    """Rows whose misfit is ``spread`` times the sd stated, beside that of the instrument."""
    rng = np.random.default_rng(rows)
    error = spread * rng.standard_normal((rows, 3)) + instrument * rng.standard_normal((rows, 3))
    none, one = np.zeros((rows, 3, 3)), np.tile(np.eye(3), (rows, 1, 1))
    return HeldOutRows(
        error=error,
        learned=none,
        white=one,
        instrument=instrument**2 * one,
        counted=np.ones(rows, dtype=bool),
    )


def factor_of(found: HeldOutRows, freedom: float) -> float:
    return widen(replace(found, freedom=freedom)).inflation


def test_the_factor_is_that_of_the_misfit_with_many_rows():
    assert factor_of(held_out(4000, spread=2.0), 4000.0) == pytest.approx(4.0, rel=0.05)
    assert factor_of(held_out(4000, spread=0.7), 4000.0) == pytest.approx(0.49, rel=0.05)
    assert factor_of(held_out(4000, spread=2.0, instrument=3.0), 4e3) == pytest.approx(4.0, rel=0.2)


def test_few_rows_widen_by_students_law():
    calm = factor_of(held_out(20, spread=0.3), 12.0)
    assert calm == pytest.approx(25.4 / 80.0 * student_factor(12.0) ** (300 / 320), rel=0.1)
    assert factor_of(held_out(20), 1.0) == factor_of(held_out(20), 8.0)  # the fewest degrees
    assert factor_of(held_out(20), 9.0) > factor_of(held_out(20), 30.0)


def test_one_row_far_off_does_not_make_the_width_of_the_others():
    found = held_out(60)
    error = found.error.copy()
    error[7] = [0.0, 0.0, 100.0]
    far = replace(found, error=error)
    assert factor_of(far, 50.0) < 1.4 * factor_of(found, 50.0)
    counted = np.arange(60) != 7
    assert factor_of(replace(far, counted=counted), 50.0) < factor_of(far, 50.0)


def test_models_that_err_apart_are_narrower_together_than_each():
    first, second = held_out(60, spread=1.5), replace(held_out(60), error=held_out(61).error[:60])
    alike = average_held_out([first, first], np.array([0.3, 0.7]))
    np.testing.assert_allclose(alike.error, first.error)
    np.testing.assert_allclose(alike.learned, 0.0, atol=1e-12)
    other = replace(first, error=1.5 * second.error)
    both = average_held_out([first, other], np.array([0.5, 0.5]))
    apart = 0.5 * (first.error - other.error)
    np.testing.assert_allclose(both.error, 0.5 * (first.error + other.error))
    np.testing.assert_allclose(both.learned, apart[:, :, None] * apart[:, None, :])
    assert factor_of(both, 50.0) < min(factor_of(first, 50.0), factor_of(other, 50.0))
    wide = replace(first, freedom=50.0)
    assert widen(wide, numbers_per_row=3.0).inflation < widen(wide).inflation  # nearer to one


def law_arm(rng):
    """An arm whose ripple is drawn from the law itself, as a function of joints."""
    sd = LAW / harmonics(64)
    sine, cosine = (sd * rng.standard_normal((6, 64)) for _ in range(2))
    actual = planted(arm(), rng)

    def points(joints):
        shift = ripple_shift(joints, harmonics(64), sine, cosine)
        return deflect_arm(actual, joints, PAYLOAD, shift)[0].position

    return points


def visited(points, joints, rng):
    scatter = REPEATABILITY * rng.standard_normal((len(joints), 3))
    return MeasurementSet(
        joints=joints,
        position=points(joints) + scatter + NOISE * rng.standard_normal((len(joints), 3)),
        covariance=np.tile(NOISE**2 * np.eye(3), (len(joints), 1, 1)),
    )


def test_coverage_is_honest_on_arms_drawn_from_the_law():
    inside, better, poses = [], [], 20
    for seed in range(8):
        rng = np.random.default_rng([seed, 51])
        points, robot = law_arm(rng), arm()
        joints = postures(robot, poses + 50, rng)
        joints[:, :] = joints.mean(axis=0) + 0.3 * (joints - joints.mean(axis=0))
        rows = visited(points, joints, rng)
        train, test = rows.subset(np.arange(poses)), rows.subset(np.arange(poses, poses + 50))
        model = fit(robot, train, method="gp", settings=SETTINGS)
        plain = fit(robot, train, method="elastic", settings=SETTINGS)
        query = Query(joints=test.joints, load=PAYLOAD)
        stated = model.predict(query)
        off = test.position - forward(robot, test.joints)[:, :3, 3]
        error = off - stated.error
        spread = stated.covariance + test.covariance
        solved = np.linalg.solve(spread, error[:, :, None])[:, :, 0]
        inside.append((error * solved).sum(axis=1) <= 7.8147)
        better.append(
            np.linalg.norm(off - plain.predict(query).error, axis=1).mean()
            - np.linalg.norm(error, axis=1).mean()
        )
    assert 0.92 <= np.concatenate(inside).mean() <= 0.99
    assert np.median(better) > 0.0


def test_another_day_widens_the_prediction_and_leaves_the_mean():
    rng = np.random.default_rng(52)
    robot, points = arm(), law_arm(rng)
    rows = visited(points, postures(robot, 25, rng), rng)
    query = Query(joints=postures(robot, 10, rng), load=PAYLOAD)
    narrow, wide = (
        LearnedMethod(name="ripple", parts=LearnedParts(smooth=False, highest=16))(
            robot, rows, replace(SETTINGS, campaign_shift=shift)
        )
        for shift in (0.0, 1e-4)
    )
    one, other = narrow.predict(query), wide.predict(query)
    np.testing.assert_array_equal(one.error, other.error)
    # Both days stand off by 0.1 mm: 2 (0.1 mm)^2 per axis, whatever the factor of the blocks.
    rest = other.covariance - 2.0e-8 * np.eye(3)
    ratio = wide.inflation / narrow.inflation
    np.testing.assert_allclose(rest, ratio * one.covariance, rtol=0.02, atol=2e-11)


def test_ten_poses_are_enough_for_a_model_that_leans_on_its_prior():
    rng = np.random.default_rng(53)
    robot, points = arm(), law_arm(rng)
    rows = visited(points, postures(robot, 10, rng), rng)
    model = fit(robot, rows, method="gp", settings=replace(SETTINGS, lean_on_prior=True))
    query = Query(joints=postures(robot, 50, rng), load=PAYLOAD)
    off = points(query.joints) - forward(robot, query.joints)[:, :3, 3]
    after = np.linalg.norm(off - model.predict(query).error, axis=1).mean()
    assert after < 0.5 * np.linalg.norm(off, axis=1).mean()
    assert model.training_summary()["smooth"] == "not tried"


def test_an_impossible_shift_between_days_is_refused():
    with pytest.raises(ConfigurationError, match="campaign_shift 20 mm, allowed 0 to 10 mm"):
        FitSettings(campaign_shift=0.02)


def test_fits_of_the_same_rows_share_their_waves(monkeypatch):
    rng = np.random.default_rng(54)
    robot, points = arm(), law_arm(rng)
    rows = visited(points, postures(robot, 20, rng), rng)
    begun = []

    def count_climbs(design, parts):
        begun.append(len(design.weights))
        return climb_ladder(design, parts)

    monkeypatch.setattr("robotrue.calibration.learned.climb_ladder", count_climbs)
    with share_waves():
        models = [fit(robot, rows, method=m, settings=SETTINGS) for m in ("ripple", "gp")]
    assert begun == [20]
    np.testing.assert_array_equal(models[0].values, models[1].values)
    fit(robot, rows.subset(np.arange(16)), method="ripple", settings=SETTINGS)
    assert begun == [20, 16]  # not beyond the fits that share
