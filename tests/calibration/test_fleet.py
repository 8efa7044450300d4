"""Five and more arms of one type say what the next one is, and how far off. Simulated."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.belief import Belief, standard_terms
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.sources import FEWEST_ARMS, TransferSource, fleet_belief
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.calibration.transfer import fit_transfer
from robotrue.core.units import MM
from robotrue.robot.model import parameter_slice
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage

SETTINGS = FitSettings(payload=PAYLOAD, campaign_shift=0.0)
PAGE = Path(__file__).parents[2] / "docs" / "howto" / "transfer-a-calibration.md"
THETA, D, ALPHA = (parameter_slice(6, name) for name in ("theta", "d", "alpha"))
UNSEEN = 1e-3


def calibrated(errors, sd):
    """The belief in an arm with independent errors."""
    robot = arm()
    return Belief(
        robot=robot,
        terms=standard_terms(robot.dof),
        mean=np.concatenate([errors, np.zeros(robot.dof)]),
        root=np.diag(np.concatenate([sd, np.zeros(robot.dof)])),
        white=1e-5,
        repeatability=1e-5,
        inflation=1.0,
        T_tracker_base={},
    )


def type_of(arms, seed=0):
    """Arms with joint zeros about a type's mean, and d2 = -d3; nobody saw alpha."""
    rng = np.random.default_rng(seed)
    robot = arm()
    given = []
    for _ in range(arms):
        errors, sd = np.zeros(len(robot.errors)), np.full(len(robot.errors), 1e-5)
        errors[THETA] = 5e-4 + 2e-4 * rng.standard_normal(6)
        errors[D] = 3e-4 * rng.standard_normal(6)
        errors[D][2] = -errors[D][1]
        errors[parameter_slice(6, "base")] = 1e-3 * rng.standard_normal(6)
        sd[ALPHA] = UNSEEN
        given.append(calibrated(errors, sd))
    return fleet_belief(given, PriorScales())


def correlation(belief):
    covariance = belief.root.T @ belief.root
    sd = np.sqrt(np.diagonal(covariance)[D])
    return (covariance[D, D] / np.outer(sd, sd))[1, 2]


def test_mean_and_scatter_of_many_arms_are_those_of_the_type():
    belief = type_of(60)
    np.testing.assert_allclose(belief.mean[THETA], 5e-4, atol=8e-5)
    np.testing.assert_allclose(np.sqrt(belief.variance[THETA]), 2e-4, rtol=0.25)
    assert correlation(belief) < -0.85


def test_a_direction_that_no_arm_saw_stays_as_wide_as_before():
    sd = np.sqrt(type_of(9).variance[ALPHA])
    assert (sd > UNSEEN).all()
    assert (sd < 1.2 * UNSEEN).all()


def test_few_arms_do_not_say_what_goes_together_and_always_leave_a_covariance():
    few, many = type_of(FEWEST_ARMS), type_of(60)
    assert correlation(many) < correlation(few) < 0.0
    covariance = few.root.T @ few.root
    used = np.diagonal(covariance) > 0.0
    assert np.linalg.eigvalsh(covariance[np.ix_(used, used)]).min() > 0.0


def test_base_and_reflector_are_those_of_the_next_arm():
    belief = type_of(9)
    base = parameter_slice(6, "base")
    np.testing.assert_array_equal(belief.mean[base], 0.0)
    np.testing.assert_allclose(np.sqrt(belief.variance[base][:3]), PriorScales().base)


def test_the_next_arm_with_ten_poses_as_the_page_says():
    """Six arms that share half a millimetre and their stiffness; numbers of the how-to."""
    robot = arm()
    common = np.zeros(len(robot.errors))
    common[parameter_slice(6, "a")] = 5e-4 * np.array([1.0, -1.0, 1.0, 0.0, 1.0, -1.0])
    rows = []
    for seed in range(6):
        rng = np.random.default_rng([90, seed])
        actual = planted(robot, rng)
        actual = actual.with_errors(actual.errors + common)
        rows.append(measure(actual, postures(robot, 40, rng), rng))
    given = [
        TransferSource(model=fit(robot, each, settings=SETTINGS), relation="unit", name=f"arm {k}")
        for k, each in enumerate(rows)
    ]
    leaning = replace(SETTINGS, lean_on_prior=True)
    found = {"10 poses alone": [], "and five other arms": []}
    inside = []
    for k in range(len(rows)):
        known, test = rows[k].subset(np.arange(10)), rows[k].subset(np.arange(10, 40))
        others = [source for i, source in enumerate(given) if i != k]
        for name, model in (
            ("10 poses alone", fit(robot, known, settings=leaning)),
            ("and five other arms", fit_transfer(robot, known, others, SETTINGS)),
        ):
            seen = evaluate(model, test, payload=PAYLOAD)
            found[name].append(float(np.linalg.norm(seen.after, axis=1).mean()) / MM)
        inside.append(coverage(seen.after, seen.covariance).share)
    assert np.mean(inside) >= 0.93
    means = {name: float(np.mean(values)) for name, values in found.items()}
    assert means["and five other arms"] < 0.9 * means["10 poses alone"]
    said = re.findall(
        r"^\| (10 poses alone|and five other arms) \| ([\d.]+) mm", PAGE.read_text("utf-8"), re.M
    )
    assert {name: float(value) for name, value in said} == pytest.approx(means, abs=0.002)
