"""Lengths as observations: derivatives against differences, and what lengths can tell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, measure, planted, postures

from robotrue.calibration.length_estimate import (
    UNSEEN_BASE,
    LengthEstimate,
    estimate_lengths,
    length_observations,
    model_of_lengths,
)
from robotrue.calibration.model import Query
from robotrue.calibration.parameters import ParameterLayout, State, retract
from robotrue.calibration.settings import FitSettings, SolverSettings
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, pose
from robotrue.errors import FormatError
from robotrue.measurement.length_set import NO_ANCHOR, LengthSet, read_lengths
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import deflect_arm

ANCHORS = np.array([[2.6, 1.6, 0.2], [2.4, -1.7, 0.3], [-0.6, 0.3, 2.9], [3.2, 0.1, 2.4]])
SIGMA = 2e-5
SETTINGS = FitSettings(payload=PAYLOAD, solver=SolverSettings(loss="gaussian"))


def points(actual: RobotModel, joints: Array) -> Array:
    return deflect_arm(actual, joints, PAYLOAD)[0].position


def wires(actual: RobotModel, n: int, seed: int, *, bars: int = 0) -> LengthSet:
    """Lengths to four anchors, then lengths between two poses; anchors stated 10 mm off."""
    rng = np.random.default_rng(seed)
    joints, second = postures(arm(), n + bars, rng), postures(arm(), n + bars, rng)
    anchor = np.arange(n + bars) % len(ANCHORS)
    anchor[n:] = NO_ANCHOR
    second[:n] = np.nan
    end = ANCHORS[anchor]
    end[n:] = points(actual, second[n:])
    length = np.linalg.norm(points(actual, joints) - end, axis=1)
    return LengthSet(
        joints=joints,
        length=length + SIGMA * rng.standard_normal(n + bars),
        sigma=np.full(n + bars, SIGMA),
        anchor=anchor,
        second=second,
        anchors=ANCHORS + 0.01 * rng.uniform(-1, 1, ANCHORS.shape),
        anchor_names=tuple("ABCD"),
    )


@pytest.fixture(scope="module")
def actual() -> RobotModel:
    """The planted arm; its base is where it should be, no length could say otherwise."""
    return planted(arm(), np.random.default_rng(8), base=0.0)


@pytest.fixture(scope="module")
def fitted(actual: RobotModel) -> LengthEstimate:
    return estimate_lengths(arm(), wires(actual, 160, 1, bars=40), SETTINGS)


def test_jacobian_is_the_derivative(actual: RobotModel) -> None:
    lengths = wires(actual, 8, 2, bars=4)
    numbers = tuple(range(3, 7))
    layout = ParameterLayout(dof=6, stations=numbers, places=numbers)
    state = State(
        robot=arm().with_errors(0.5 * actual.errors),
        T_tracker_base={k: pose(np.eye(3), -lengths.anchors[k - 3]) for k in numbers},
    )
    observed = length_observations(arm(), lengths, PAYLOAD, repeatability=1e-5, first=3)
    assert [len(o.rows) for o in observed] == [8, 4]
    for o in observed:
        analytic = o.linearise(layout, state).jacobian
        for i, name in enumerate(layout.names):
            step = np.zeros(layout.size)
            step[i] = 1e-8 if name.startswith("compliance") else 1e-6
            up = o.linearise(layout, retract(layout, state, step)).residual
            down = o.linearise(layout, retract(layout, state, -step)).residual
            numeric = (down - up) / (2.0 * step[i])
            scale = 1.0 + np.abs(numeric).max()
            np.testing.assert_allclose(analytic[:, :, i], numeric, atol=1e-7 * scale, err_msg=name)


def shape_error(predicted: Array, true: Array) -> float:
    """Mean distance after the best rigid motion: what is left once the base is known, m."""
    gap = apply(fit_rigid(predicted, true), predicted) - true
    return float(np.linalg.norm(gap, axis=1).mean())


def test_lengths_calibrate_the_arm_up_to_its_base(
    actual: RobotModel, fitted: LengthEstimate
) -> None:
    joints = postures(arm(), 100, np.random.default_rng(5))
    true, nominal = points(actual, joints), forward(arm(), joints)[:, :3, 3]
    model = model_of_lengths(fitted, SETTINGS, "elastic")
    predicted = nominal + model.predict(Query(joints=joints, load=PAYLOAD)).error
    assert shape_error(predicted, true) < 0.1 * shape_error(nominal, true)
    assert shape_error(predicted, true) < 6e-5
    assert fitted.rms < 3e-5


def test_what_lengths_cannot_tell_is_said(actual: RobotModel, fitted: LengthEstimate) -> None:
    assert fitted.verdict.status == "conditional"
    assert fitted.verdict.doubts[0] == UNSEEN_BASE
    names = fitted.posterior.layout.names
    sd = np.sqrt(np.diagonal(fitted.posterior.covariance))
    base = [i for i, name in enumerate(names) if name.startswith("base")]
    assert not sd[base].any()
    assert np.linalg.norm(fitted.anchors - ANCHORS, axis=1).max() < 0.01


def test_lengths_beside_points_know_the_base(actual: RobotModel) -> None:
    rng = np.random.default_rng(6)
    rows = measure(actual, postures(arm(), 20, rng), rng)
    both = estimate_lengths(arm(), wires(actual, 80, 3), SETTINGS, "geometric", rows)
    assert UNSEEN_BASE not in both.verdict.doubts
    assert np.linalg.norm(both.anchors - ANCHORS, axis=1).max() < 1e-3


FILE = """j1_deg,j2_deg,length_mm,sigma_mm,anchor,ax_mm,ay_mm,az_mm,k1_deg,k2_deg
10,20,1500.5,0.03,A,1000,2000,300,,
15,25,1400.5,0.03,A,1000,2000,300,,
5,6,500,0.01,,,,,7,8
"""


def test_lengths_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "lengths.csv"
    path.write_text(FILE)
    lengths = read_lengths(path)
    assert lengths.anchor.tolist() == [0, 0, NO_ANCHOR]
    assert lengths.anchor_names == ("A",)
    np.testing.assert_allclose(lengths.length, [1.5005, 1.4005, 0.5])
    np.testing.assert_allclose(np.rad2deg(lengths.second[2]), [7, 8])
    path.write_text(FILE.replace("1400.5,0.03,A,1000", "1400.5,0.03,A,1001"))
    with pytest.raises(FormatError, match=r"lengths.csv:3: an anchor at another place than"):
        read_lengths(path)
    path.write_text(FILE.replace(",7,8", ",,"))
    with pytest.raises(FormatError, match=r"lengths.csv:4: k1_deg is blank, expected a finite"):
        read_lengths(path)


def test_a_length_of_zero_is_refused(actual: RobotModel) -> None:
    from robotrue.errors import ShapeError

    lengths = wires(actual, 4, 1)
    with pytest.raises(ShapeError, match="a length or its sigma is zero or less"):
        replace(lengths, length=np.zeros(4))
