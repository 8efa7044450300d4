"""A rotary table beside an arm: planted errors are found, angles left out are predicted."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import pytest

from robotrue.calibration.archive import open_model
from robotrue.calibration.arm import LinearArm, prepare_arm
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.model import Query
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.table_fit import calibrate_table
from robotrue.calibration.terms.rotary_table import SIZE, RotaryTable, same_axis
from robotrue.calibration.update import update_model
from robotrue.core.archive import archive_bytes
from robotrue.core.arrays import Array
from robotrue.core.conditions import no_conditions
from robotrue.core.poses import apply, inverse
from robotrue.core.units import DEG, MM
from robotrue.errors import (
    ConfigurationError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)
from robotrue.measurement.table_set import TableSet
from robotrue.program.external_axes import ExternalAxis, move_frames
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.robot.statics import NO_LOAD
from robotrue.simulation.rail_practice import T_TRACKER_BASE, draw_rail, measure_rail
from robotrue.simulation.table_practice import AXIS, TableAsBuilt, draw_table, measure_table
from robotrue.simulation.warm_shift import LOAD, joints_of

NOMINAL: Final = preset("KR160")
TILTING: Final = ExternalAxis(
    number=1, direction=np.array([0.0, 1.0, 0.1]), point=np.array([1.1, -0.3, 0.5]), at=10.0 * DEG
)


def rigid(**changed: object) -> CalibratedModel:
    """An arm without errors, whose tracker frame is known."""
    size = len(NOMINAL.errors)
    model = CalibratedModel(
        robot=NOMINAL,
        errors=np.zeros(size),
        covariance=np.zeros((size, size)),
        repeatability=1e-5,
        white=0.0,
        T_tracker_base={0: T_TRACKER_BASE},
    )
    return replace(model, **changed)  # type: ignore[arg-type]


def table(axes: tuple[ExternalAxis, ...] = (AXIS,)) -> RotaryTable:
    return RotaryTable(axes=axes, low=np.full(len(axes), -3.0), high=np.full(len(axes), 3.0))


def at_angles(*columns: Array) -> Array:
    """External axes (n, 6): the first column is E1."""
    external = np.full((len(columns[0]), 6), np.nan)
    external[:, : len(columns)] = np.stack(columns, axis=1)
    return external


def error_on(model: CalibratedModel, joints: Array, external: Array) -> tuple[Array, Array]:
    conditions = replace(no_conditions(len(joints)), external=external)
    told = model.predict(Query(joints=joints, conditions=conditions))
    return told.error, told.covariance


@pytest.fixture(scope="module")
def built() -> TableAsBuilt:
    return draw_table(np.random.default_rng(4))


@pytest.fixture(scope="module")
def fitted(built: TableAsBuilt) -> CalibratedModel:
    return calibrate_table(rigid(), measure_table(built, np.random.default_rng(5)), [AXIS])


def test_columns_are_the_derivative_of_the_error() -> None:
    term = table((TILTING, AXIS))
    rng = np.random.default_rng(2)
    joints = rng.uniform(-0.4, 0.4, (5, 6))
    external = at_angles(rng.uniform(-1.0, 1.0, 5), rng.uniform(-3.0, 3.0, 5))
    external[0, 0] = np.nan
    conditions = replace(no_conditions(5), external=external)

    def linear(values: Array) -> LinearArm:
        prepared = prepare_arm(NOMINAL, terms=(term,), values=values)
        return prepared.linearise_at(prepared.postures(joints, NO_LOAD, conditions=conditions))

    values = 1e-9 * rng.standard_normal(term.size)
    columns = linear(values).columns[:, :, len(NOMINAL.errors) :]
    assert columns.shape == (5, 3, 2 * SIZE)
    assert not columns[0, :, :SIZE].any()
    for k, step in enumerate(1e-6 * np.eye(term.size)):
        slope = (linear(values + step).error - linear(values - step).error) / 2e-6
        np.testing.assert_allclose(columns[:, :, k], slope, atol=2e-7)


def test_tilt_offset_and_scale_move_points_as_the_axis_does() -> None:
    values = np.zeros(SIZE)
    values[:5] = 2e-5, -1e-5, 3e-5, 1e-5, 1e-5
    direction, point = table().actual_axis(0, values)
    actual = ExternalAxis(number=2, direction=direction, point=point)
    angle = np.linspace(-3.0, 3.0, 7)
    nominal, true = (np.tile(np.eye(4), (7, 1, 1)) for _ in range(2))
    move_frames(nominal, AXIS, angle)
    move_frames(true, actual, angle * (1.0 + values[4]))
    place = np.array([1.5, 0.3, 0.4])
    twist = table().twists(at_angles(angle, angle)) @ values
    stated = apply(nominal, np.tile(place, (7, 1)))
    moved = stated + twist[:, :3] + np.cross(twist[:, 3:], stated)
    np.testing.assert_allclose(moved, apply(true, np.tile(place, (7, 1))), atol=5e-9)


def test_planted_errors_are_found(fitted: CalibratedModel, built: TableAsBuilt) -> None:
    term = fitted.terms[-1]
    assert isinstance(term, RotaryTable)
    direction, point = term.actual_axis(0, fitted.values[-SIZE:])
    assert np.linalg.norm(direction - built.axis.direction) < 6e-5
    stated = built.axis.point
    assert stated is not None
    assert np.linalg.norm(np.cross(point - stated, direction)) < 6e-5
    said, check = fitted.training_summary().terms
    assert check.startswith("table, points at angles that the fit left out: 0.")
    assert said.startswith("table E2: axis off by")
    assert "Not observable: the zero of its reading; frames are those at 0 deg" in said


def test_other_points_at_other_angles_are_predicted(
    fitted: CalibratedModel, built: TableAsBuilt
) -> None:
    rng = np.random.default_rng(8)
    joints = joints_of(NOMINAL, 20_000, rng)
    arm_at = forward(NOMINAL, joints)[:, :3, 3]
    near = np.linalg.norm(arm_at - np.array([1.1, 0.0, 0.3]), axis=1) < 0.6
    joints, arm_at = joints[near], arm_at[near]
    n = len(joints)
    assert n > 200
    angle = rng.uniform(-np.pi, np.pi, n)
    told, covariance = error_on(fitted, joints, at_angles(np.full(n, np.nan), angle))
    free, alone = error_on(fitted, joints, np.full((n, 6), np.nan))
    np.testing.assert_allclose(free, 0.0, atol=1e-12)
    # The tool is where the program sent it; the part is not: it is off the other way.
    stated = np.tile(np.eye(4), (n, 1, 1))
    move_frames(stated, AXIS, angle)
    on_table = apply(inverse(stated), arm_at)
    true = arm_at - apply(built.motion(angle), on_table)
    left = np.linalg.norm(true - told, axis=1)
    assert np.linalg.norm(true, axis=1).mean() > 0.4 * MM
    assert left.mean() < 0.025 * MM
    square = np.einsum(
        "ni,ni->n", true - told, np.linalg.solve(covariance, (true - told)[..., None])[..., 0]
    )
    assert (square < 7.815).mean() > 0.9
    assert (np.trace(covariance - alone, axis1=1, axis2=2) > 0.0).all()


def test_an_angle_at_which_the_frame_is_given_has_no_error(fitted: CalibratedModel) -> None:
    joints = np.zeros((1, 6))
    told, _ = error_on(fitted, joints, at_angles(np.array([np.nan]), np.array([AXIS.at])))
    np.testing.assert_allclose(told, 0.0, atol=1e-12)


def test_angles_left_out_say_how_good_it_is(fitted: CalibratedModel) -> None:
    said = fitted.training_summary()["table"]
    assert isinstance(said, dict)
    assert said["held_out_before_m"] > 0.1 * MM
    assert said["held_out_after_m"] < 0.03 * MM
    assert 1.0 <= said["covariance_factor"] < 3.0
    assert (said["rows"], said["points"], said["settings"]) == (48, 4, 12)


def test_two_axes_on_each_other() -> None:
    rng = np.random.default_rng(3)
    tilting, turning = draw_table(rng, TILTING), draw_table(rng)
    angles = rng.uniform(-1.2, 1.2, 30), rng.uniform(-np.pi, np.pi, 30)
    place = np.array([[1.5, 0.0, 0.3], [1.1, 0.4, 0.4], [0.8, -0.3, 0.5], [1.2, -0.3, 0.3]])
    point, row = np.tile(np.arange(4), 30), np.repeat(np.arange(30), 4)
    moved = tilting.motion(angles[0]) @ turning.motion(angles[1])
    seen = apply(moved[row], place[point])
    rows = TableSet(
        point=point,
        names=("A", "B", "C", "D"),
        external=at_angles(*angles)[row],
        position=seen + 1e-5 * rng.standard_normal(seen.shape),
        covariance=np.tile(1e-10 * np.eye(3), (len(seen), 1, 1)),
    )
    model = calibrate_table(rigid(), rows, [TILTING, AXIS])
    said = model.training_summary()["table"]
    assert isinstance(said, dict)
    assert said["held_out_before_m"] > 0.2 * MM
    assert said["held_out_after_m"] < 0.05 * MM
    assert len(model.training_summary().terms) == 3


def test_a_wild_reading_carries_no_weight(built: TableAsBuilt) -> None:
    rows = measure_table(built, np.random.default_rng(5))
    position = np.array(rows.position)
    position[7] += 0.5 * MM
    model = calibrate_table(rigid(), replace(rows, position=position), [AXIS])
    assert any("1 of 48 readings of the table" in w for w in model.training_summary().warnings)
    told, _ = error_on(model, np.zeros((1, 6)), at_angles(np.array([0.0]), np.array([2.0])))
    plain = calibrate_table(rigid(), rows, [AXIS])
    same, _ = error_on(plain, np.zeros((1, 6)), at_angles(np.array([0.0]), np.array([2.0])))
    assert np.linalg.norm(told - same) < 0.02 * MM


def test_the_archive_keeps_it(fitted: CalibratedModel) -> None:
    archive = fitted.to_archive()
    again = open_model(archive)
    assert archive_bytes(again.to_archive()) == archive_bytes(archive)
    assert isinstance(again, CalibratedModel)
    term = again.terms[-1]
    assert isinstance(term, RotaryTable)
    assert same_axis(term.axes[0], AXIS)
    external = at_angles(np.array([np.nan, np.nan]), np.array([1.0, -2.0]))
    np.testing.assert_array_equal(
        error_on(again, np.zeros((2, 6)), external)[0],
        error_on(fitted, np.zeros((2, 6)), external)[0],
    )


def test_a_second_calibration_takes_the_place_of_the_first(
    fitted: CalibratedModel, built: TableAsBuilt
) -> None:
    again = calibrate_table(fitted, measure_table(built, np.random.default_rng(5)), [AXIS])
    assert len(again.terms) == len(fitted.terms)
    np.testing.assert_allclose(again.values, fitted.values, atol=1e-12)


def test_new_rows_of_the_arm_leave_it(fitted: CalibratedModel) -> None:
    rng = np.random.default_rng(6)
    rows, _ = measure_rail(NOMINAL, draw_rail(NOMINAL, rng), 12, rng, still=True)
    model = update_model(fitted, rows, settings=FitSettings(payload=LOAD))
    assert isinstance(model.terms[-1], RotaryTable)
    np.testing.assert_array_equal(model.values[-SIZE:], fitted.values[-SIZE:])


def test_the_tables_of_the_arm_hold_beside_the_table_alone(fitted: CalibratedModel) -> None:
    assert fitted.mean_tables() is not None
    assert fitted.tables_hold(no_conditions(2))
    external = at_angles(np.array([np.nan]), np.array([0.3]))
    assert not fitted.tables_hold(replace(no_conditions(1), external=external))


def test_too_little_is_refused(built: TableAsBuilt) -> None:
    rng = np.random.default_rng(5)
    few = measure_table(built, rng, angles=np.array([-1.0, 0.0, 1.0, 2.0]))
    with pytest.raises(
        ObservabilityError,
        match=r"4 angles of E2 over 171\.9 deg; at least 5 over 60 deg are needed",
    ) as refused:
        calibrate_table(rigid(), few, [AXIS])
    assert "8 to 12 angles" in (refused.value.hint or "")
    narrow = measure_table(built, rng, angles=np.linspace(0.0, 0.9, 9))
    with pytest.raises(ObservabilityError, match=r"9 angles of E2 over 51\.6 deg"):
        calibrate_table(rigid(), narrow, [AXIS])
    line = np.array([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.4, 0.001, 0.0]])
    with pytest.raises(ObservabilityError, match="3 points were measured at several angles, 0 mm"):
        calibrate_table(rigid(), measure_table(built, rng, points=line), [AXIS])
    with pytest.raises(ObservabilityError, match="2 points were measured at several angles"):
        calibrate_table(rigid(), measure_table(built, rng, points=line[:2]), [AXIS])


def test_what_does_not_belong_to_the_cell_is_refused(built: TableAsBuilt) -> None:
    rows = measure_table(built, np.random.default_rng(5))
    with pytest.raises(ConfigurationError, match="E2 in deg, and the cell does not describe it"):
        calibrate_table(rigid(), rows, [])
    linear = replace(AXIS, point=None)
    with pytest.raises(ConfigurationError, match="describes it as a linear one"):
        calibrate_table(rigid(), rows, [linear])
    rail = ExternalAxis(number=1, direction=np.eye(3)[1], carries_robot=True)
    with pytest.raises(ConfigurationError, match="a rotary table beside a rail is not supported"):
        calibrate_table(rigid(), rows, [rail, AXIS])
    with pytest.raises(ModelMismatchError, match="tracker station 0 is not in the model"):
        calibrate_table(rigid(T_tracker_base={}), rows, [AXIS])
    backwards = replace(AXIS, direction=-AXIS.direction)
    with pytest.raises(ImplausibleDataError, match="off circles about the stated axis"):
        calibrate_table(rigid(), rows, [backwards])
    away = replace(AXIS, point=np.array([1.108, 0.0, 0.3]))
    with pytest.raises(ConfigurationError, match=r"the axis of E2 is .* mm off") as refused:
        calibrate_table(rigid(), rows, [away])
    assert "state its values in the cell, near about = [" in (refused.value.hint or "")


def test_rows_in_base_need_no_tracker_frame(built: TableAsBuilt, fitted: CalibratedModel) -> None:
    rows = measure_table(built, np.random.default_rng(5))
    T = inverse(T_TRACKER_BASE[None])
    in_base = replace(rows, position=apply(T, rows.position), frame="base")
    model = calibrate_table(rigid(T_tracker_base={}), in_base, [AXIS])
    np.testing.assert_allclose(model.values, fitted.values, atol=1e-9)
