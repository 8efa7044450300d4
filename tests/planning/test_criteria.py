"""The choice against brute force: gains, greedy, exchange, next pose."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from planning_cases import covariance, information

from robotrue.errors import ConfigurationError
from robotrue.planning.criteria import (
    covariance_after,
    exchange_poses,
    follow,
    greedy,
    next_pose,
)
from robotrue.planning.plan_defaults import Criterion


def figure(rows: np.ndarray, weight: np.ndarray, chosen: list[int], criterion: str) -> float:
    """What the criterion makes small, the plain way."""
    left = covariance(rows[chosen])
    return float(np.trace(left @ weight) if criterion == "I" else np.linalg.slogdet(left)[1])


@pytest.mark.parametrize("criterion", ["I", "D"])
def test_every_greedy_step_is_the_best_by_brute_force(criterion: Criterion) -> None:
    rows, weight = information()
    found = greedy(rows, weight, 8, criterion=criterion)
    chosen: list[int] = []
    for k in found.chosen:
        others = [c for c in range(len(rows)) if c not in chosen]
        values = [figure(rows, weight, [*chosen, c], criterion) for c in others]
        assert others[int(np.argmin(values))] == k
        chosen.append(int(k))
    for k in range(9):
        left = covariance(rows[found.chosen[:k]])
        assert found.variance[k] == pytest.approx(np.trace(left @ weight), rel=1e-9)
        assert found.log_det[k] == pytest.approx(-np.linalg.slogdet(left)[1], rel=1e-9, abs=1e-9)


def test_information_adds_up_and_order_does_not_matter() -> None:
    rows, weight = information()
    some = np.array([3, 11, 7, 20])
    forward = follow(rows, weight, some)
    backward = follow(rows, weight, some[::-1])
    assert forward.variance[-1] == pytest.approx(backward.variance[-1], rel=1e-10)
    assert forward.log_det[-1] == pytest.approx(backward.log_det[-1], rel=1e-10)
    np.testing.assert_allclose(covariance_after(rows[some]), covariance(rows[some]), atol=1e-10)
    first = covariance_after(rows[some[:2]])
    np.testing.assert_allclose(
        covariance_after(rows[some[2:]], first), covariance(rows[some]), atol=1e-10
    )


def test_more_poses_are_never_worse_and_never_help_more_than_before() -> None:
    rows, weight = information()
    for criterion in ("I", "D"):
        found = greedy(rows, weight, 20, criterion=criterion)  # type: ignore[arg-type]
        assert (np.diff(found.variance) < 0.0).all()
        assert (np.diff(found.log_det) > 0.0).all()
    assert (np.diff(np.diff(found.log_det)) < 1e-9).all()  # D gains fall: log det is submodular


@pytest.mark.parametrize("criterion", ["I", "D"])
@pytest.mark.parametrize("seed", range(4))
def test_an_exchange_is_never_worse_than_its_start(criterion: Criterion, seed: int) -> None:
    rows, weight = information(seed=seed)
    start = np.random.default_rng(seed).choice(len(rows), 6, replace=False)
    before = figure(rows, weight, start.tolist(), criterion)
    found = exchange_poses(rows, weight, start, criterion=criterion, sweeps=3)
    after = figure(rows, weight, found.chosen.tolist(), criterion)
    assert after < before
    assert len(set(found.chosen.tolist())) == 6
    assert found.variance[-1] == pytest.approx(
        np.trace(covariance(rows[found.chosen]) @ weight), rel=1e-8
    )


@pytest.mark.parametrize("criterion", ["I", "D"])
@pytest.mark.parametrize("poses", [4, 6, 9])
def test_an_exchange_of_too_few_poses_under_a_wide_prior_gains(
    criterion: Criterion, poses: int
) -> None:
    """Each pose is all that is known of some directions, 1e4 times better than the prior."""
    rows, weight = information(count=60, size=30, seed=poses)
    rows = 1e4 * rows
    start = greedy(rows, weight, poses, criterion=criterion)
    found = exchange_poses(rows, weight, start.chosen, criterion=criterion)
    if criterion == "I":
        assert found.variance[-1] < start.variance[-1] * (1.0 + 1e-9)
    else:
        assert found.log_det[-1] > start.log_det[-1] - 1e-9
    # None of the exchanges that are left would gain: what it says of a pose taken out is exact.
    for place in range(poses):
        others = np.delete(found.chosen, place)
        state = rows[others].reshape(-1, rows.shape[2])
        root = np.linalg.qr(np.vstack([np.eye(rows.shape[2]), state]), mode="r")
        candidates = np.setdiff1d(np.arange(len(rows)), others)
        values = []
        for k in candidates:
            more = np.linalg.qr(np.vstack([root, rows[k]]), mode="r")
            left = np.linalg.inv(more)
            half = np.sum(np.log(np.abs(np.diagonal(left))))
            values.append(np.trace(left.T @ weight @ left) if criterion == "I" else half)
        mine = values[int(np.flatnonzero(candidates == found.chosen[place])[0])]
        if criterion == "I":
            assert mine <= min(values) * (1.0 + 1e-5)
        else:
            assert mine <= min(values) + 1e-5 * abs(min(values))


def test_exchange_reaches_the_best_of_all_pairs() -> None:
    rows, weight = information(count=14, size=5)
    for criterion in ("I", "D"):
        best = min(
            figure(rows, weight, list(pair), criterion)
            for pair in combinations(range(len(rows)), 2)
        )
        starts = [
            exchange_poses(
                rows, weight, np.array([k, (k + 5) % 14]), criterion=criterion, sweeps=5
            ).chosen
            for k in range(14)
        ]  # type: ignore[arg-type]
        found = min(figure(rows, weight, s.tolist(), criterion) for s in starts)
        assert found == pytest.approx(best, rel=1e-9)


def test_the_next_pose_is_the_next_of_the_greedy_plan() -> None:
    rows, weight = information()
    plan = greedy(rows, weight, 6)
    measured = rows[plan.chosen[:5]]
    free = np.ones(len(rows), dtype=bool)
    free[plan.chosen[:5]] = False
    index, gain = next_pose(measured, rows, weight, allowed=free)
    assert index == plan.chosen[5]
    assert gain == pytest.approx(plan.variance[4 + 1] - plan.variance[6], rel=1e-7)
    index, _ = next_pose(rows[:0], rows, weight)
    assert index == plan.chosen[0]


def test_greedy_stops_at_the_tolerance() -> None:
    rows, weight = information()
    whole = greedy(rows, weight, 20)
    gains = -np.diff(whole.variance)
    cut = greedy(rows, weight, 20, enough=float(gains[6]) * 1.0001)
    assert len(cut.chosen) <= 6
    assert (-np.diff(cut.variance) >= gains[6]).all()


def test_more_poses_than_candidates_are_refused() -> None:
    rows, weight = information(count=5)
    with pytest.raises(ConfigurationError) as caught:
        greedy(rows, weight, 6)
    assert str(caught.value) == (
        "6 poses are requested, 5 candidates are left. "
        "Try: draw more candidates, or ask for fewer poses."
    )
