"""Rows along the rail that a cell describes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.app.measured_rows import join_rows, ride_rail
from robotrue.app.reporting import Notes
from robotrue.cell.cell import Cell
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.program import FrameTable
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset

RAIL = ExternalAxis(number=1, direction=np.array([0.0, 1.0, 0.0]), at=0.5, carries_robot=True)


def cell(*axes: ExternalAxis) -> Cell:
    return Cell(robot=preset("KR160"), controller=FrameTable(external=axes))


def rows(place: float | np.ndarray) -> MeasurementSet:
    joints = np.random.default_rng(3).uniform(-0.5, 0.5, (12, 6))
    external = np.full((12, 6), np.nan)
    external[:, 0] = place
    return MeasurementSet(
        joints=joints,
        position=forward(preset("KR160"), joints)[:, :3, 3],
        covariance=np.tile(1e-10 * np.eye(3), (12, 1, 1)),
        external=external,
    )


def test_points_in_base_are_taken_to_the_base_that_the_rail_carries() -> None:
    place = np.linspace(0.5, 3.5, 12)
    ridden = ride_rail(rows(place), cell(RAIL))
    assert ridden.rail is not None
    np.testing.assert_allclose(
        rows(place).position - ridden.position, ridden.rail.carry(ridden.external)
    )
    np.testing.assert_allclose(ridden.floor_position, rows(place).position)
    seen = ride_rail(replace(rows(place), frame="tracker"), cell(RAIL))
    np.testing.assert_array_equal(seen.position, rows(place).position)
    assert seen.carried[-1].tolist() == [0.0, 3.0, 0.0]


def test_an_axis_that_moves_must_be_described() -> None:
    with pytest.raises(ConfigurationError, match="external axis E1 moves from 0 to 3 "):
        ride_rail(rows(np.linspace(0.0, 3.0, 12)), cell())
    table = ExternalAxis(number=1, direction=np.eye(3)[2], point=np.zeros(3), frames=("base",))
    assert ride_rail(rows(np.linspace(0.0, 3.0, 12)), cell(table)).rail is None
    assert ride_rail(rows(2.0), cell()).rail is None
    assert ride_rail(rows(np.nan), cell(RAIL)).rail is None


def test_files_with_and_without_the_rail_do_not_join() -> None:
    place = cell(RAIL)
    sets = [ride_rail(rows(0.5), place), ride_rail(rows(np.nan), place)]
    with pytest.raises(ModelMismatchError, match="no position of the arm on its rail"):
        join_rows(place, sets, ["a.csv", "b.csv"], reporter=Notes())
