"""Uncertainty of machined points: derivatives, what cancels, and simulated arms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.belief import Belief, with_amplitude, with_centres, with_nuisances
from robotrue.calibration.machined import (
    compensated_covariance,
    machined_covariance,
    smooth_rest,
    tip_columns,
    uncarried_variance,
    unchanged_covariance,
)
from robotrue.calibration.model import Query
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import ProbingSettings, estimate_probing, model_of_estimate
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings, prior_belief
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.calibration.terms.smooth import SmoothBasis, features
from robotrue.calibration.touches import few_factor
from robotrue.cell.registration.fit import fit_points, frame_gain
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.robust import LEVEL, chi_point
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ModelMismatchError, ShapeError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import deflect_arm
from robotrue_reproductions.feng2018.machining_cell import (
    T_BASE_DRAWN,
    attitude,
    compensated_joints,
    feng_cell,
    machine,
    nominal_joints,
    touch,
    touch_points,
)

NOMINAL = feng_cell(0).nominal
ANGLE = 0.02 * DEG
SETTINGS = FitSettings(
    repeatability=0.03 * MM * RP_PER_SIGMA,
    scales=PriorScales(
        theta=ANGLE,
        d=0.3 * MM,
        a=0.3 * MM,
        alpha=ANGLE,
        beta=1e-3 * ANGLE,
        gear=1e-9,
        tool=0.3 * MM,
    ),
)
RIPPLE = np.append(1e-12, np.full(7, 0.008 * DEG / np.sqrt(14.0)))


def postures(side: str, count: int, seed: int) -> tuple[Array, Array]:
    """Points of a face and the joints that put the nominal tip there."""
    points = touch_points(side, count, np.random.default_rng(seed))
    turn = np.broadcast_to(attitude(side), (count, 3, 3))
    return points, nominal_joints(NOMINAL, pose(turn, apply(T_BASE_DRAWN, points)), side)


def believed(ripple: Array = RIPPLE) -> Belief:
    """The arm of the simulated cells as someone believes who knows what they are drawn from."""
    belief = prior_belief(NOMINAL, SETTINGS, ripple=ripple)
    sd = np.sqrt(belief.variance)
    sd[parameter_slice(6, "compliance")] = 0.0
    sd[parameter_slice(6, "compliance").start + 1] = ANGLE / 1961.33
    sd[parameter_slice(6, "compliance").start + 2] = ANGLE / 1961.33
    return replace(belief, root=np.diag(sd)[sd > 0.0])


def test_columns_are_derivatives_of_the_tip_in_the_part() -> None:
    belief = with_nuisances(believed(np.zeros(0)), np.full(6, 0.1))
    _, joints = postures("R", 3, 1)
    frames = {4: T_BASE_DRAWN}
    columns = tip_columns(belief, Query(joints=joints), T_base_part=frames, part=4)
    T = inverse(T_BASE_DRAWN)

    def tip(step: Array) -> Array:
        robot = NOMINAL.with_errors(step[: len(NOMINAL.errors)])
        moved = T.copy()
        moved[:3, 3] += step[-6:-3]
        moved[:3, :3] = matrix_from_rotation_vector(step[-3:]) @ T[:3, :3]
        return apply(moved, deflect_arm(robot, joints)[0].position)

    for k in (*range(0, len(NOMINAL.errors), 3), -6, -5, -3, -1):
        size = 1e-9 if k in range(36, 42) else 1e-5  # compliance is small
        step = np.zeros(len(belief.mean))
        step[k] = size
        numeric = (tip(step) - tip(-step)) / (2.0 * size)
        np.testing.assert_allclose(columns[:, :, k], numeric, rtol=1e-5, atol=2e-6)


def test_another_tool_leaves_the_errors_of_the_touching_one_behind() -> None:
    belief = believed()
    _, joints = postures("R", 2, 1)
    longer = pose(np.eye(3), np.array([0.0, 0.0, 0.4]))
    columns = tip_columns(belief, Query(joints=joints, T_flange_tool=longer))
    assert not columns[:, :, parameter_slice(6, "tool")].any()
    own = tip_columns(belief, Query(joints=joints))
    wrist = parameter_slice(6, "theta").start + 4
    farther = np.linalg.norm(columns[:, :, wrist], axis=1)
    assert (farther > np.linalg.norm(own[:, :, wrist], axis=1)).all()


def test_what_is_machined_where_it_was_touched_loses_the_arm_s_error() -> None:
    """Exact touches of the same points in the same postures leave repeatability alone."""
    points, joints = postures("R", 12, 2)
    touches = ProbingSet(names=tuple(map(str, range(12))), point=points, joints=joints)
    exact = ProbingSettings(touch_sigma=1e-7, learn=False, robust=False, priors=SETTINGS)
    found = estimate_probing(NominalModel(robot=NOMINAL), touches, exact)
    there = machined_covariance(found, Query(joints=joints))
    visit = SETTINGS.repeatability_sd**2
    assert (np.trace(there, axis1=1, axis2=2) < 2.1 * 3.0 * visit).all()
    _, across = postures("L", 12, 2)
    back = machined_covariance(found, Query(joints=across))
    assert np.trace(back, axis1=1, axis2=2).min() > (0.5 * MM) ** 2


def test_what_no_centre_carries_is_in_both_routes() -> None:
    points, joints = postures("R", 8, 5)
    _, work = postures("R", 4, 6)
    scale = np.full(12, 2.0)
    basis = SmoothBasis(centres=features(joints[:2]) * scale, scale=scale)
    plain = believed()
    smooth = with_amplitude(with_centres(plain, basis), 0.2 * MM)
    query = Query(joints=work)
    left = uncarried_variance(smooth, query)
    assert (left > 0.0).all()
    assert (left <= (0.2 * MM) ** 2).all()
    np.testing.assert_allclose(np.diagonal(smooth_rest(smooth, query)), left)
    more = compensated_covariance(smooth, query) - compensated_covariance(plain, query)
    np.testing.assert_allclose(more, left[:, None, None] * np.eye(3), atol=1e-16)
    args = dict(
        points=touch_points("R", 4, np.random.default_rng(6)),
        T_base_part=T_BASE_DRAWN,
        gain=frame_gain(T_BASE_DRAWN, points),
    )
    probed = Query(joints=joints)
    with_rest = unchanged_covariance(smooth, probed, query, **args)
    without = unchanged_covariance(plain, probed, query, **args)
    grown = np.trace(with_rest - without, axis1=1, axis2=2)
    assert (grown > 0.0).all()
    assert (grown < 6.0 * (0.2 * MM) ** 2).all()


@pytest.mark.parametrize("side", ["R", "L"])
def test_an_unchanged_model_against_drawn_arms(side: str) -> None:
    """M S M' + ... is the covariance of simulated arms, on the probed and on the unprobed side."""
    belief = believed(np.zeros(0))
    rng = np.random.default_rng(7)
    points, joints = postures("R", 8, 8)
    work, _ = postures(side, 2, 9)
    turn = np.broadcast_to(attitude(side), (2, 3, 3))
    errors = []
    for _ in range(120):
        drawn = belief.root.T @ rng.normal(size=len(belief.root))
        arm = NOMINAL.with_errors(drawn[: len(NOMINAL.errors)])
        noise = np.hypot(0.1 * MM, belief.repeatability) * rng.normal(size=(8, 3))
        # The nominal arm reads c where the true tip, c + e, touches; part and touches are as drawn.
        true = deflect_arm(arm, joints)[0].position
        read = apply(T_BASE_DRAWN, points) - (true - forward(NOMINAL, joints)[:, :3, 3]) + noise
        place = fit_points(points, read).T_base_part
        run = nominal_joints(NOMINAL, pose(turn, apply(place, work)), side)
        reached = deflect_arm(arm, run)[0].position + belief.repeatability * rng.normal(size=(2, 3))
        errors.append(apply(inverse(T_BASE_DRAWN), reached) - work)
    stated = unchanged_covariance(
        belief,
        Query(joints=joints),
        Query(joints=run),
        points=work,
        T_base_part=T_BASE_DRAWN,
        gain=frame_gain(T_BASE_DRAWN, points),
        touch_sigma=0.1 * MM,
    )
    table = np.array(errors)
    for k in range(2):
        seen = table[:, k].T @ table[:, k] / len(table)
        half = np.linalg.cholesky(stated[k])
        ratio = np.linalg.eigvalsh(np.linalg.solve(half, np.linalg.solve(half, seen).T))
        assert ratio.min() > 0.6  # sd of an eigenvalue of 120 draws: 13 %
        assert ratio.max() < 1.5


def test_regions_hold_the_truth_of_simulated_cells() -> None:
    """A joint estimate from the front: both sides, drives with ripple nobody identified."""
    inside = {"R": [], "L": []}
    for seed in range(8):
        cell = feng_cell(seed)
        rng = np.random.default_rng([seed, 71])
        points = touch_points("R", 12, rng)
        touches = ProbingSet(
            names=tuple(map(str, range(12))), point=points, joints=touch(cell, points, "R", rng)
        )
        told = ProbingSettings(touch_sigma=cell.sizes.touch, learn=False, priors=SETTINGS)
        found = estimate_probing(NominalModel(robot=cell.nominal), touches, told)
        arm = model_of_estimate(found)
        for side, shares in inside.items():
            work = touch_points(side, 10, rng)
            turn = np.broadcast_to(attitude(side), (10, 3, 3))
            wanted = pose(turn, apply(found.T_base_part[0], work))
            joints = compensated_joints(arm, wanted, side)
            off = apply(inverse(cell.T_base_part), machine(cell, joints, rng)) - work
            stated = machined_covariance(found, Query(joints=joints))
            square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(stated), off)
            shares.append((square <= chi_point(LEVEL, 3) ** 2).mean())
    assert np.mean(inside["R"]) > 0.85
    assert np.mean(inside["L"]) > 0.75  # points of one cell stand or fall together


def test_refusals() -> None:
    belief = with_nuisances(believed(), np.full(6, 0.1))
    _, joints = postures("R", 3, 1)
    with pytest.raises(ModelMismatchError, match="part 2 was not registered"):
        tip_columns(belief, Query(joints=joints), T_base_part={0: T_BASE_DRAWN}, part=2)
    with pytest.raises(ShapeError, match="part has shape"):
        tip_columns(belief, Query(joints=joints), T_base_part={0: T_BASE_DRAWN}, part=[0, 0])
    frames = {0: T_BASE_DRAWN, 1: T_BASE_DRAWN}
    with pytest.raises(ModelMismatchError, match="6 nuisance columns, its frames 12"):
        tip_columns(belief, Query(joints=joints), T_base_part=frames)
    with pytest.raises(ShapeError, match="joints has shape"):
        tip_columns(belief, Query(joints=joints[:, :5]))
    with pytest.raises(ShapeError, match="approach has shape"):
        tip_columns(belief, Query(joints=joints, approach=np.zeros((2, 6))))
    with pytest.raises(ShapeError, match="gain has shape"):
        unchanged_covariance(
            belief,
            Query(joints=joints),
            Query(joints=joints),
            points=np.zeros((3, 3)),
            T_base_part=T_BASE_DRAWN,
            gain=np.zeros((6, 3)),
        )


def test_region_factor_is_that_of_three_dimensions() -> None:
    """chi^2 with 3 degrees of freedom, 95 %: 7.8147 (any table)."""
    assert chi_point(LEVEL, 3) ** 2 == pytest.approx(7.8147, abs=1e-4)


def test_scales_told_by_few_stay_between_learned_and_default() -> None:
    """F(3, 4) at 95 % is 6.591 (any table): 3 F / chi^2(3) = 2.530 for 3.5 weights and half."""
    assert few_factor(3.5, 0.5) == pytest.approx(3.0 * 6.591 / 7.8147, abs=1e-3)
    points, joints = postures("R", 12, 2)  # of an arm that turns out to be exact
    touches = ProbingSet(names=tuple(map(str, range(12))), point=points, joints=joints)
    told = ProbingSettings(touch_sigma=0.1 * MM, tool_sigma=0.3 * MM, robust=False)
    query = Query(joints=postures("L", 8, 3)[1])
    found = estimate_probing(NominalModel(robot=NOMINAL), touches, told)
    default = estimate_probing(NominalModel(robot=NOMINAL), touches, replace(told, learn=False))
    moved = np.trace(machined_covariance(found, query), axis1=1, axis2=2).mean()
    held = np.trace(machined_covariance(default, query), axis1=1, axis2=2).mean()
    assert moved / found.belief.inflation <= held * (1.0 + 1e-6)
    assert moved > 0.1 * held
