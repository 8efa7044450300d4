"""The guard on candidates of known quality: who is used, how it is said, what is never done."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from validation_fakes import FakeModel, arm, measured

from robotrue.errors import ObservabilityError, ShapeError
from robotrue.robot.forward import forward
from robotrue.validation.contest import decide, drop_excluded, weigh
from robotrue.validation.guard import select_guarded, verdict_from_summary
from robotrue.validation.learning_curve import learning_curve
from robotrue.validation.selection import hold_out, select


def bend(joints):
    return 0.3e-3 * np.stack([np.sin(joints[:, 0]), np.cos(joints[:, 1]), joints[:, 2] * 0], 1)


def believes(mean, sigma=5e-5):
    """A candidate that has learned ``mean`` elsewhere and does not look at the target."""
    return lambda rows: FakeModel(mean=mean, sigma=sigma)


def averages(rows):
    """The target rows alone: their mean error; asks for one row."""
    if rows is None:
        raise ObservabilityError("no rows.")
    error = rows.position - forward(arm(), rows.joints)[:, :3, 3]
    middle = error.mean(axis=0)
    return FakeModel(mean=lambda joints: np.tile(middle, (len(joints), 1)), sigma=2e-4)


def unfit(rows):
    raise ObservabilityError("too few poses for this method.")


ALONE = {"target-only": averages}


def test_a_richer_method_with_the_same_predictions_falls_back():
    again = {"first": believes(bend), "richer": believes(bend)}
    selection = select(again, measured(60, error=bend))
    assert selection.winner == "first"
    assert "richer falls back to first: the same predictions" in selection.reason
    assert np.isnan(selection.table[1].gain)
    assert "gain 0.0000" not in selection.reason


def test_a_good_source_is_used_and_the_gain_over_the_target_alone_is_stated():
    target = measured(12, error=bend)
    model = select_guarded({"transfer": believes(bend)}, ALONE, target)
    verdict, contest = verdict_from_summary(model.training_summary())
    assert (verdict.winner, verdict.against, verdict.checked) == ("transfer", "target-only", True)
    assert verdict.gain > verdict.noise > 0.0
    assert verdict.doubts == ()
    assert "target-only" in contest.reason
    assert "does not beat transfer" in contest.reason
    json.dumps(dict(model.training_summary()), allow_nan=False)


@pytest.mark.parametrize("n", [3, 5, 12, 40])
def test_a_source_that_lies_is_not_used_and_the_message_says_so(n):
    target = measured(n, error=bend)
    wrong = believes(lambda joints: 2e-3 + bend(joints))
    model = select_guarded({"transfer": wrong, "source-only": wrong}, ALONE, target)
    verdict, _ = verdict_from_summary(model.training_summary())
    assert verdict.winner == "target-only"
    assert verdict.doubts[0].startswith("the sources increase the error: transfer has 3.")
    assert verdict.doubts[0].endswith("for target-only; the sources are not used.")
    assert model.training_summary()["doubts"][0] == verdict.doubts[0]


@pytest.mark.parametrize("size", [0.0, 0.05e-3, 0.1e-3, 0.2e-3, 0.4e-3])
@pytest.mark.parametrize("seed", range(6))
def test_never_worse_than_the_target_alone_by_more_than_the_error_bar(size, seed):
    target = measured(15, error=bend, seed=seed)
    off = believes(lambda joints: size + bend(joints))
    model = select_guarded(
        {"transfer": off, "pooled": believes(lambda j: 0 * j[:, :3])}, ALONE, target
    )
    verdict, contest = verdict_from_summary(model.training_summary())
    scores = {score.name: score.mean for score in contest.table}
    if verdict.winner != "target-only":
        assert verdict.gain > -verdict.noise
        # The gain is a mean over folds, of one or two rows each; the table one over rows.
        gain = scores["target-only"] - scores[verdict.winner]
        assert verdict.gain == pytest.approx(gain, abs=0.5 * verdict.noise)


def test_only_what_the_winner_beats_by_more_than_the_noise_is_excluded():
    target = measured(12, error=bend)
    candidates = {
        "near": believes(lambda joints: 1e-6 + bend(joints)),
        "first": believes(bend),
        "wrong": believes(lambda joints: 2e-3 + bend(joints)),
    }
    trials = hold_out(candidates, target)
    contest = replace(decide(trials), winner="first")
    assert drop_excluded(trials, contest, list(candidates)) == ["near", "first"]
    weighed = weigh(trials, contest, ["near", "first"])
    assert sum(weighed.weights.values()) == pytest.approx(1.0)
    assert "the average of the candidates that are not excluded" in weighed.reason


@pytest.mark.parametrize(("rows", "said"), [(0, "no target pose was measured"), (2, "only 2")])
def test_without_target_poses_nothing_is_checked_and_that_is_said(rows, said):
    target = measured(rows, error=bend) if rows else None
    model = select_guarded({"broken": unfit, "transfer": believes(bend)}, ALONE, target)
    verdict, contest = verdict_from_summary(model.training_summary())
    assert (verdict.winner, verdict.checked, contest) == ("transfer", False, None)
    assert verdict.doubts[0].startswith(said)
    assert "not checked against the target" in verdict.doubts[0]
    with pytest.raises(ObservabilityError, match="no candidate could be fitted; broken: too few"):
        select_guarded({"broken": unfit}, {}, None)


def test_a_transfer_that_cannot_be_fitted_is_named():
    target = measured(12, error=bend)
    model = select_guarded({"transfer": unfit, "source-only": believes(bend)}, ALONE, target)
    verdict, _ = verdict_from_summary(model.training_summary())
    assert verdict.winner == "source-only"
    assert verdict.doubts == (
        "transfer could not be fitted, source-only is used: too few poses for this method.",
    )
    model = select_guarded({"transfer": believes(bend)}, {"target-only": unfit}, target)
    verdict, _ = verdict_from_summary(model.training_summary())
    assert verdict.doubts[0].startswith("the target poses alone could not be fitted")


def test_a_stated_uncertainty_that_is_too_small_is_said():
    model = select_guarded(
        {"transfer": believes(bend, sigma=5e-6)}, ALONE, measured(20, error=bend)
    )
    (doubt,) = verdict_from_summary(model.training_summary())[0].doubts
    assert doubt.startswith("the stated 95 % regions hold 0 % of the held-out target poses")
    assert "too small" in doubt


def test_target_points_all_at_one_place_are_said():
    rows = measured(20, error=bend)
    joints = rows.joints[:1] + 1e-2 * rows.joints
    position = forward(arm(), joints)[:, :3, 3] + bend(joints)
    near = replace(rows, joints=joints, position=position)
    model = select_guarded({"transfer": believes(bend)}, ALONE, near, reach=1.6)
    (doubt,) = verdict_from_summary(model.training_summary())[0].doubts
    assert "of one place: the contest does not hold for other parts of the region" in doubt


def test_curve_is_nested_paired_and_says_who_failed():
    target = measured(60, error=bend)
    given = []

    def watching(rows):
        given.append(set() if rows is None else set(rows.source_row.tolist()))
        return averages(rows)

    candidates = {"transfer": believes(bend), "target-only": watching, "broken": unfit}
    curve = learning_curve(candidates, target, counts=(0, 5, 20, 50, 55), repeats=2, floor=8e-5)
    assert curve.counts.tolist() == [0, 5, 20, 50]
    assert curve.held == 10
    assert given[0] == set()
    assert given[1] < given[2] < given[3]
    assert np.isnan(curve.mean[2]).all()
    assert np.isnan(curve.mean[1, 0]).all()
    assert (curve.quartiles()[1, 0] < 1.1e-4).all()
    assert (curve.quartiles()[1, 1, 1:] > 1.5e-4).all()
    assert curve.failures == (
        "target-only, 0 target poses: no rows.",
        "broken, 0 target poses: too few poses for this method.",
    )
    document = json.loads(json.dumps(curve.to_json(), allow_nan=False))
    assert document["candidates"]["target-only"]["median_mm"][0] is None
    assert document["floor_mm"] == pytest.approx(0.08)
    with pytest.raises(ShapeError, match="no curve from 5 target rows"):
        learning_curve(candidates, target.subset(np.arange(5)))
