"""A rail as an error term: planted errors are found, in base and from a tracker; places matter."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms.rail_guide import RailGuide
from robotrue.calibration.update import update_model
from robotrue.core.archive import archive_bytes
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions, Rail, no_conditions
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.statics import deflect_arm
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage

NOMINAL: Final = arm()
ARM: Final = planted(NOMINAL, np.random.default_rng(5))
RAIL: Final = Rail(number=1, direction=np.array([0.0, 1.0, 0.0]), at=1.0)
TRAVEL: Final = 4.0
NOISE: Final = 2e-5
TURN: Final = matrix_from_rotation_vector(np.array([0.1, -0.2, 1.0]))
TRACKER: Final = pose(TURN, np.array([3.0, 2.0, 1.0]))
SETTINGS: Final = FitSettings(payload=PAYLOAD)


def base_motion(place: Array) -> tuple[Array, Array]:
    """Shift (n, 3) m and turn (n, 3) rad of the base beside the stated rail."""
    x = place / TRAVEL
    across = 1e-3 * (place - 1.0) + 1e-4 * np.cos(2.0 * np.pi * x)
    shift = np.stack([across, 8e-5 * (place - 1.0), 8e-5 * np.cos(3.0 * np.pi * x)], axis=1)
    turn = np.stack([0 * x, 4e-5 * np.cos(2.0 * np.pi * x), 8e-5 * (x - 0.5)], axis=1)
    return shift, turn


def rows(n: int, seed: int, *, tracker: bool = False) -> MeasurementSet:
    """Simulated poses along the rail."""
    rng = np.random.default_rng(seed)
    joints, place = postures(NOMINAL, n, rng), rng.uniform(0.0, TRAVEL, n)
    shift, turn = base_motion(place)
    point = deflect_arm(ARM, joints, PAYLOAD)[0].position
    point = (matrix_from_rotation_vector(turn) @ point[:, :, None])[:, :, 0] + shift
    point = point + NOISE * rng.standard_normal((n, 3))
    external = np.full((n, 6), np.nan)
    external[:, 0] = place
    if tracker:
        point = (point + RAIL.carry(external)) @ TRACKER[:3, :3].T + TRACKER[:3, 3]
    return MeasurementSet(
        joints=joints,
        position=point,
        covariance=np.tile(NOISE**2 * np.eye(3), (n, 1, 1)),
        frame="tracker" if tracker else "base",
        external=external,
        rail=RAIL,
    )


def fitted(measured: MeasurementSet) -> CalibratedModel:
    model = fit(NOMINAL, measured, method="ripple", settings=SETTINGS)
    assert isinstance(model, CalibratedModel)
    return model


@pytest.fixture(scope="module")
def in_base() -> CalibratedModel:
    return fitted(rows(90, 1))


def judged(model: CalibratedModel, check: MeasurementSet) -> tuple[float, float]:
    """Mean error in m and the share of rows in their 95 % region."""
    seen = evaluate(model, check, payload=PAYLOAD)
    share = coverage(seen.after, seen.covariance).share
    return float(np.linalg.norm(seen.after, axis=1).mean()), share


def test_rows_along_a_rail_are_predicted_as_well_as_of_an_arm_that_stands(
    in_base: CalibratedModel,
) -> None:
    error, share = judged(in_base, rows(300, 7))
    assert np.linalg.norm(base_motion(rows(300, 7).external[:, 0])[0], axis=1).mean() > 5e-4
    assert error < 7e-5
    assert share > 0.9


def test_a_tracker_in_an_unknown_frame_sees_the_same() -> None:
    model = fitted(rows(90, 1, tracker=True))
    error, share = judged(model, rows(300, 7, tracker=True))
    assert error < 7e-5
    assert share > 0.9


def test_new_rows_of_the_tracker_narrow_it(in_base: CalibratedModel) -> None:
    model = update_model(in_base, rows(40, 21, tracker=True), settings=SETTINGS)
    error, share = judged(model, rows(300, 7))
    assert error < 6e-5
    assert share > 0.9


def test_scale_and_direction_are_told(in_base: CalibratedModel) -> None:
    (said,) = [s for s in in_base.training_summary().terms if s.startswith("rail")]
    term = next(t for t in in_base.terms if isinstance(t, RailGuide))
    belief = in_base.belief()
    place = belief.place("rail")
    slope = belief.mean[place].reshape(6, -1)[:3, 0] / term.travel
    sd = np.sqrt(belief.inflation * belief.variance[place]).reshape(6, -1)[:3, 0] / term.travel
    assert abs(slope[0] - 8e-5) < 3.0 * sd[0]
    assert "scale +" in said
    assert "mm/m across" in said


def test_an_unstated_place_is_uncertain_and_a_program_must_state_it(
    in_base: CalibratedModel,
) -> None:
    joints = rows(10, 3).joints
    blind = in_base.predict(Query(joints=joints, load=PAYLOAD))
    known = in_base.predict(Query(joints=joints, load=PAYLOAD, conditions=at_place(1.0)))
    gain = np.trace(blind.covariance - known.covariance, axis1=1, axis2=2)
    assert (np.sqrt(gain) > 2e-4).all()
    assert in_base.mean_tables() is None
    with pytest.raises(ConfigurationError, match="rail E1, and 2 of 2 targets do not state"):
        in_base.require_stated(no_conditions(2))
    in_base.require_stated(at_place(1.0))


def at_place(place: float) -> ArmConditions:
    external = np.full((1, 6), np.nan)
    external[0, 0] = place
    return replace(no_conditions(1), external=external)


def test_beyond_the_travel_of_the_rows_it_is_less_certain(in_base: CalibratedModel) -> None:
    joints = rows(10, 3).joints
    inside, near, far = (
        in_base.predict(Query(joints=joints, load=PAYLOAD, conditions=at_place(place)))
        for place in (3.9, 4.3, 6.0)
    )
    sizes = [np.trace(p.covariance, axis1=1, axis2=2) for p in (inside, near, far)]
    assert (sizes[0] < sizes[1]).all()
    assert (sizes[1] < sizes[2]).all()
    assert (np.sqrt(sizes[2]) > 1e-4).all()


def test_a_model_at_a_stated_place_has_tables(in_base: CalibratedModel) -> None:
    joints = rows(10, 3).joints
    there = in_base.under(at_place(3.0))
    told = in_base.predict(Query(joints=joints, load=PAYLOAD, conditions=at_place(3.0)))
    again = there.predict(Query(joints=joints, load=PAYLOAD))
    np.testing.assert_allclose(again.error, told.error, atol=1e-12)
    tables = there.mean_tables()
    assert tables is not None
    found = deflect_arm(tables.robot, joints, PAYLOAD)[0].position
    nominal = deflect_arm(NOMINAL, joints)[0].position
    assert np.linalg.norm(found - nominal - told.error, axis=1).max() < 2e-5  # without ripple
    there.require_stated(no_conditions(2))


def test_the_archive_keeps_it(in_base: CalibratedModel) -> None:
    archive = in_base.to_archive()
    again = open_model(archive)
    assert archive_bytes(again.to_archive()) == archive_bytes(archive)
    query = Query(joints=rows(10, 9).joints, conditions=at_place(2.0))
    np.testing.assert_array_equal(again.predict(query).error, in_base.predict(query).error)


def test_rows_at_one_place_are_not_asked_for_it() -> None:
    measured = rows(40, 1)
    assert RailGuide.begin(NOMINAL, measured, False) is not None
    assert RailGuide.begin(NOMINAL, replace(measured, rail=None), False) is None
    external = np.full((40, 6), np.nan)
    external[:, 0] = 1.0
    assert RailGuide.begin(NOMINAL, replace(measured, external=external), False) is None
