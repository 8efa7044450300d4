"""Selection: the simple one on data without structure, the rich one where it helps."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest
from scipy.stats import multivariate_t
from validation_fakes import SIGMA, FakeModel, arm, measured

from robotrue.calibration.methods import METHODS
from robotrue.calibration.settings import FitSettings
from robotrue.errors import ArchiveError, ConvergenceError, ObservabilityError, ShapeError
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.validation.contest import paired_gain, selection_from_summary, stack_weights
from robotrue.validation.metrics import student_scores
from robotrue.validation.selection import default_splits, fit_auto, select
from robotrue.validation.splits import contiguous_blocks


def features(joints):
    return np.concatenate([np.ones((len(joints), 1)), np.sin(joints), np.cos(2 * joints)], axis=1)


def fit_nothing(measurements):
    return FakeModel()


def fit_features(measurements):
    error = measurements.position - forward(arm(), measurements.joints)[:, :3, 3]
    weights = np.linalg.lstsq(features(measurements.joints), error, rcond=None)[0]
    return FakeModel(mean=lambda joints: features(joints) @ weights)


def fit_fails(measurements):
    raise ObservabilityError("too few poses for this method.")


def bend(joints):
    return 0.3e-3 * np.stack([np.sin(joints[:, 0]), np.cos(2 * joints[:, 1]), joints[:, 2] * 0], 1)


FAKES = {"simple": fit_nothing, "rich": fit_features}


@pytest.mark.parametrize("seed", range(8))
def test_noise_alone_keeps_the_simple_one(seed):
    result = select(FAKES, measured(150, seed=seed))
    assert result.winner == "simple"
    assert "rich" in result.reason
    assert "does not beat simple" in result.reason


@pytest.mark.parametrize("n", [30, 60, 150])
def test_structure_lets_the_rich_one_win(n):
    result = select(FAKES, measured(n, error=bend))
    assert result.winner == "rich"
    assert result.table[1].gain > result.table[1].noise > 0.0
    assert result.table[1].log_density > result.table[0].log_density


def test_a_method_that_cannot_be_fitted_is_named_not_chosen():
    result = select({"broken": fit_fails, **FAKES}, measured(60, error=bend))
    assert result.winner == "rich"
    assert result.table[0].failure == "too few poses for this method."
    with pytest.raises(ObservabilityError, match=r"no method could be fitted; broken: too few"):
        select({"broken": fit_fails}, measured(60))
    with pytest.raises(ShapeError, match="nothing to select"):
        select({}, measured(60))


def test_bugs_in_a_method_are_not_hidden():
    def broken(measurements):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        select({"broken": broken, **FAKES}, measured(60))


def test_default_splits_grow_with_the_number_of_rows():
    kinds = {n: [s.kind for s in default_splits(measured(n))] for n in (12, 60, 150)}
    assert kinds[12] == ["random"] * 12
    assert kinds[60] == ["blocks"] * 5
    assert kinds[150] == ["blocks"] * 5 + ["regions"] * 3


def test_fits_are_limited_and_the_winner_sees_all_rows():
    seen = []

    def counting(robot, measurements, settings):
        seen.append(len(measurements))
        return FakeModel()

    model = fit_auto(arm(), measured(4000), methods={"only": counting})
    assert seen == [1000] * 5 + [4000]
    evidence = model.training_summary()["selection"]
    assert evidence["table"][0]["n"] == 5 * 500
    assert "3 blocks and 2 regions; up to 1000 rows fit and 500 score" in evidence["rule"]


def test_a_clear_loser_leaves_a_long_contest():
    fits = {name: 0 for name in FAKES}

    def count(name, measurements):
        fits[name] += 1
        return FAKES[name](measurements)

    candidates = {name: partial(count, name) for name in FAKES}
    result = select(candidates, measured(1200, error=bend))
    assert fits == {"simple": 2, "rich": 8}
    assert result.winner == "rich"
    assert result.table[0].stopped
    assert "simple is not compared further: on 2 of 8 parts it is 0." in result.reason


def test_who_lost_to_one_that_fails_later_is_compared_anew():
    turns = iter(range(100))

    def fails_late(measurements):
        if next(turns) >= 4:
            raise ConvergenceError("still moving.")
        return fit_features(measurements)

    result = select({"simple": fit_nothing, "rich": fails_late}, measured(1200, error=bend))
    assert result.winner == "simple"
    assert not result.table[0].stopped
    assert result.table[0].n == sum(len(s.test) for s in default_splits(measured(1200)))
    assert result.table[1].unsettled


def test_auto_attaches_the_evidence_and_passes_the_settings_on():
    given = FitSettings(repeatability=1e-4)

    def rich(robot, measurements, settings):
        assert settings is given
        return fit_features(measurements)

    methods = {"simple": lambda robot, rows, settings: FakeModel(), "rich": rich}
    model = fit_auto(arm(), measured(60, error=bend), given, methods=methods)
    evidence = model.training_summary()["selection"]
    assert evidence["winner"] == "rich"
    assert [row["name"] for row in evidence["table"]] == ["simple", "rich"]
    assert evidence["table"][0]["gain"] is None
    stored = json.loads(json.dumps(evidence, allow_nan=False))
    assert selection_from_summary(stored).summary() == evidence
    with pytest.raises(ArchiveError, match="cannot be read"):
        selection_from_summary({"winner": "rich"})


def test_auto_on_a_real_method_table():
    errors = arm().errors.copy()
    errors[parameter_slice(6, "a")] = [0.5e-3, -0.4e-3, 0.3e-3, 0.0, 0.0, 0.0]
    poses = measured(60, robot=arm().with_errors(errors), instrument=0.02e-3)
    two = {name: METHODS[name] for name in ("nominal", "geometric")}
    model = fit_auto(arm(), poses, methods=two)
    assert model.training_summary()["selection"]["winner"] == "geometric"
    assert model.training_summary()["method"] == "geometric"


def test_progress_counts_every_fit():
    calls = []
    select(
        FAKES,
        measured(60),
        splits=contiguous_blocks(60, blocks=3),
        progress=lambda text, done, total: calls.append((done, total)),
    )
    assert calls == [(k, 6) for k in range(7)]


def test_paired_gain_by_hand():
    # Fold means 1, 2, 3: mean 2, sd 1, t(0.95, 2) = 2.91999, half width 2.91999 / sqrt 3.
    gain, noise = paired_gain(np.array([1.0, 1.0, 2.0, 3.0]), np.array([0, 0, 1, 2]))
    assert gain == pytest.approx(2.0)
    assert noise == pytest.approx(2.91999 / 3**0.5, rel=1e-5)


def test_mean_per_kind_adds_up():
    score = select(FAKES, measured(150)).table[0]
    assert set(score.mean_by_kind) == {"blocks", "regions"}
    assert np.mean(list(score.mean_by_kind.values())) == pytest.approx(score.mean)
    assert score.mean == pytest.approx(SIGMA * np.sqrt(8 / np.pi), rel=0.1)


def fit_moves(robot, measurements, settings):
    raise ConvergenceError("still moving after 60 iterations.")


def fit_short(robot, measurements, settings):
    raise ObservabilityError("6 poses give 18 numbers.")


def test_a_fit_that_does_not_converge_is_no_vote_for_nominal():
    poses = measured(60, error=bend)
    with pytest.raises(
        ConvergenceError, match="geometric did not converge, still moving"
    ) as caught:
        fit_auto(arm(), poses, methods={"nominal": METHODS["nominal"], "geometric": fit_moves})
    assert "--method nominal" in str(caught.value)


def test_a_richer_winner_names_the_method_that_did_not_converge():
    table = {"nominal": METHODS["nominal"], "geometric": METHODS["geometric"], "gp": fit_moves}
    errors = arm().errors.copy()
    errors[parameter_slice(6, "a")] = [0.5e-3, -0.4e-3, 0.3e-3, 0.0, 0.0, 0.0]
    poses = measured(60, robot=arm().with_errors(errors), instrument=0.02e-3)
    summary = fit_auto(arm(), poses, methods=table).training_summary()
    assert summary["selection"]["winner"] == "geometric"
    assert summary["verdict"] == "conditional"
    assert summary["doubts"][0].startswith("gp did not converge and was not compared: still moving")
    stored = selection_from_summary(json.loads(json.dumps(summary["selection"], allow_nan=False)))
    assert stored.table[2].unsettled


def test_nominal_that_nothing_could_be_compared_with_is_conditional():
    table = {"nominal": METHODS["nominal"], "geometric": fit_short}
    summary = fit_auto(arm(), measured(30), methods=table).training_summary()
    assert summary["method"] == "nominal"
    assert summary["verdict"] == "conditional"
    assert "geometric could not be fitted and was not compared" in summary["doubts"][0]


def test_nominal_gives_way_to_a_gain_within_the_noise():
    shift = FakeModel(mean=lambda joints: np.full((len(joints), 3), 2e-6))
    poses = measured(60, error=lambda joints: np.full((len(joints), 3), 2e-6))
    rivals = {"nominal": fit_nothing, "geometric": lambda rows: shift}
    found = select(rivals, poses)
    assert 0.0 < found.table[1].gain < found.table[1].noise
    assert found.winner == "geometric"
    assert select({"simple": fit_nothing, "rich": lambda rows: shift}, poses).winner == "simple"


def test_few_poses_leave_an_average_of_what_they_do_not_exclude():
    errors = arm().errors.copy()
    errors[parameter_slice(6, "a")] = [0.5e-3, -0.4e-3, 0.3e-3, 0.0, 0.0, 0.0]
    poses = measured(45, robot=arm().with_errors(errors), instrument=0.02e-3)
    three = {name: METHODS[name] for name in ("nominal", "geometric", "elastic")}
    model = fit_auto(arm(), poses, methods=three)
    evidence = selection_from_summary(model.training_summary()["selection"])
    assert set(evidence.weights) == {"geometric", "elastic"}
    assert sum(evidence.weights.values()) == pytest.approx(1.0)
    assert "their average by held-out density" in evidence.reason
    assert model.training_summary()["method"] == evidence.winner == "geometric"


def test_weights_go_to_the_candidate_that_says_more_and_leave_the_others_a_row():
    sure = student_scores(np.zeros((50, 3)), np.tile(np.eye(3), (50, 1, 1)))
    weights = stack_weights([sure, sure - 20.0])
    np.testing.assert_allclose(weights, [50.5 / 51.0, 0.5 / 51.0], rtol=1e-6)
    halves = np.where(np.arange(50) < 25, 0.0, -9.0)
    np.testing.assert_allclose(stack_weights([halves, halves[::-1]]), [0.5, 0.5], atol=1e-6)


def test_scores_are_the_density_of_students_law():
    residuals, scale = np.array([[0.1, -0.2, 0.4]]), np.diag([1.0, 2.0, 0.5])
    known = multivariate_t(shape=scale, df=8.0).logpdf(residuals[0])
    assert student_scores(residuals, scale[None])[0] == pytest.approx(known)
