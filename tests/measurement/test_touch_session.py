"""A session at the part: nothing is taken out, one reading of each feature counts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.part_points import read_points
from robotrue.measurement.touch_session import (
    ProbingSession,
    State,
    TouchFeature,
    TouchReading,
    session_csv,
    session_document,
    session_of,
)
from robotrue.robot.presets import preset

EMPTY = ProbingSession(
    features=(
        TouchFeature(name="A, left", part=0, point_mm=(0.1, 0.2, 0.3)),
        TouchFeature(name="B", part=1, point_mm=(1.0, 2.0, 3.0), normal=(0.0, 0.0, 1.0)),
        TouchFeature(name="C", part=0, point_mm=(7.0, 8.0, 9.0)),
    ),
    parts=("one", "two"),
    rough=(((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0, 0, 0, 1)),) * 2,
    reads="position",
    settings={"touch_sigma_mm": 0.1},
)


def reading(feature: int, state: State = "kept", x: float = 1.0) -> TouchReading:
    return TouchReading(feature=feature, state=state, values=(x, 1.0 / 3.0, -0.1))


def test_a_session_is_the_same_after_json() -> None:
    session = EMPTY.with_reading(reading(0)).with_reading(reading(1, "held"))
    assert session_of(json.loads(json.dumps(session_document(session)))) == session
    with pytest.raises(ConfigurationError, match="no session of touches"):
        session_of({"features": []})


def test_a_reading_that_waits_is_decided_first() -> None:
    waiting = EMPTY.with_reading(reading(0, "held"))
    assert waiting.held is not None
    assert waiting.open == (1, 2)
    with pytest.raises(ConfigurationError, match="'A, left' waits for a decision"):
        waiting.with_reading(reading(1))
    assert waiting.decide("kept").kept == (reading(0),)
    assert waiting.decide("dropped").open == (0, 1, 2)
    assert waiting.decide("skipped").open == (1, 2)
    assert not waiting.decide("skipped").kept
    with pytest.raises(ConfigurationError, match="no reading waits"):
        EMPTY.decide("kept")


def test_a_feature_touched_again_replaces_and_undo_brings_the_first_back() -> None:
    twice = EMPTY.with_reading(reading(0)).with_reading(reading(2)).with_reading(reading(0, x=5.0))
    assert [(each.feature, each.values[0]) for each in twice.kept] == [(2, 1.0), (0, 5.0)]
    once = twice.undo()
    assert [(each.feature, each.values[0]) for each in once.kept] == [(0, 1.0), (2, 1.0)]
    assert [each.state for each in once.readings] == ["kept", "kept", "undone"]
    nothing = once.undo().undo()
    assert not nothing.kept
    assert len(nothing.readings) == 3
    with pytest.raises(ConfigurationError, match="nothing to undo"):
        nothing.undo()


def test_the_file_of_a_session_is_read_to_the_last_bit(tmp_path: Path) -> None:
    session = EMPTY.with_reading(reading(1, x=1200.02)).with_reading(reading(0, x=0.1 + 0.2))
    path = tmp_path / "readings.csv"
    path.write_bytes(session_csv(session, session.kept, np.array))
    found = read_points(path)
    assert found.touches.names == ("B", "A, left")
    assert [found.parts[k] for k in found.touches.part] == ["two", "one"]
    assert found.touches.full.tolist() == [False, True]
    values = np.array([each.values for each in session.kept])
    assert (found.touches.position == values * 1e-3).all()


def test_the_file_of_a_session_states_the_axes_of_the_controller(tmp_path: Path) -> None:
    controller = preset("KR160").controller
    typed = (-27.2, -90.1, 95.3, 0.0, 30.123456, -12.5)
    joints = np.round(controller.to_model(np.radians(typed)) * 180.0 / np.pi, 9)
    touched = TouchReading(feature=1, state="kept", values=tuple(joints.tolist()))
    session = replace(EMPTY, reads="joints").with_reading(touched)
    path = tmp_path / "readings.csv"
    path.write_bytes(session_csv(session, session.kept, controller.to_controller))
    head, row = path.read_text().splitlines()
    assert head.startswith("name,px_mm,py_mm,pz_mm,a1_deg,a2_deg")
    assert tuple(map(float, row.split(",")[4:10])) == typed
    found = read_points(path, controller.to_model)
    np.testing.assert_allclose(found.touches.joints[0], np.radians(joints), rtol=0, atol=1e-12)
