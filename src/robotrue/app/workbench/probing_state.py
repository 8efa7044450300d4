"""A session at the part, opened with all it rests on: cell, arm, settings, touches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from robotrue.app.touch_settings import registration_settings
from robotrue.app.workbench.file_imports import cell_of
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.nominal import NominalModel
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.core.units import DEG, MM
from robotrue.errors import (
    ConfigurationError,
    ModelMismatchError,
    ObservabilityError,
    RobotrueError,
)
from robotrue.measurement.formats.part_points import PointsFile, read_points
from robotrue.measurement.probing_set import ProbingSet
from robotrue.measurement.touch_session import ProbingSession, TouchReading, session_csv
from robotrue.robot.configuration import axis_relation
from robotrue.robot.model import nominal_identity
from robotrue.store import items, models
from robotrue.store.nouns import CELL, DOCUMENT, MODEL, CellRecord, DocumentRecord, ModelRecord
from robotrue.store.registrations import session_in
from robotrue.store.workspace import Workspace
from robotrue.validation.part_registration import register
from robotrue.validation.registered_part import RegisteredPart
from robotrue.validation.registration_frame import RegistrationSettings
from robotrue.validation.touch_expectation import TouchBelief, update_belief
from robotrue.validation.validation_defaults import REGISTRATION_FIT


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchWords:
    """Settings of a session at its start; None if the arm or the tolerance is not stated.

    Attributes:
        touch_sigma_mm: Of a touch.
        robot_sigma_mm: Of the arm.
        tool_sigma_mm: Of the tip in the flange.
        tolerance_mm: Of the part.
        probe_radius_mm: Of the ball.
        rough_mm: Standard deviation of the part's stated rough position.
        lean_deg: Largest lean of the probe.
        tip_axis: The way from the flange to the tip, in the tool frame.
        axes: Axes convention of readings.
        fit: Fitted quantities.
    """

    touch_sigma_mm: float
    robot_sigma_mm: float | None = None
    tool_sigma_mm: float | None = None
    tolerance_mm: float | None = None
    probe_radius_mm: float
    rough_mm: float
    lean_deg: float
    tip_axis: tuple[float, float, float]
    axes: Literal["controller", "model"]
    fit: Literal["auto", "frame", "joint"] = REGISTRATION_FIT


@dataclass(frozen=True, slots=True, kw_only=True)
class Opened:
    """A session and what it rests on.

    Attributes:
        record: The version that was opened.
        session: In it.
        cell: The frame of the part.
        cell_record: Its record.
        model: Of the arm; None: the nominal one.
        model_record: Its record.
    """

    record: DocumentRecord
    session: ProbingSession
    cell: Cell
    cell_record: CellRecord
    model: ErrorModel | None
    model_record: ModelRecord | None

    @property
    def arm(self) -> ErrorModel:
        """Model of the touching arm, as ``robotrue register`` takes it."""
        return NominalModel(robot=self.cell.robot) if self.model is None else self.model

    @property
    def words(self) -> TouchWords:
        """Settings stated when the session began."""
        return decode(TouchWords, self.session.settings, key="settings")

    @property
    def joints(self) -> bool:
        """True if readings are joints."""
        return self.session.reads == "joints"

    @property
    def tip_axis(self) -> Array:
        """(3,) the way from the flange to the tip, in the tool frame."""
        return np.array(self.words.tip_axis)

    @property
    def settings(self) -> RegistrationSettings:
        """Those of ``robotrue register`` for the same words."""
        return settings_from(self.words, self.cell)

    @property
    def rough(self) -> dict[int, Array]:
        """(4, 4) roughly ``T_base_part`` of every part."""
        return {k: np.array(T) for k, T in enumerate(self.session.rough)}


def open_session(workspace: Workspace, id: str, version: int | None = None) -> Opened:
    """Returns a session with its cell and its model."""
    record = items.get(workspace, DOCUMENT, id, version=version)
    session = session_in(record)
    (place,) = record.refs("cell")
    cell_record = items.get(workspace, CELL, place.id, version=place.version)
    linked = record.refs("model")
    model_record = None
    if linked:
        model_record = items.get(workspace, MODEL, linked[0].id, version=linked[0].version)
    return Opened(
        record=record,
        session=session,
        cell=cell_of(workspace, cell_record),
        cell_record=cell_record,
        model=None if model_record is None else models.model_of(workspace, model_record).model,
        model_record=model_record,
    )


def settings_from(words: TouchWords, cell: Cell) -> RegistrationSettings:
    """Returns the settings of a registration from words in mm."""
    return registration_settings(
        cell,
        words.touch_sigma_mm,
        robot_sigma_mm=words.robot_sigma_mm,
        tool_sigma_mm=words.tool_sigma_mm,
        tolerance_mm=words.tolerance_mm,
        fit=words.fit,
    )


def require_same_arm(cell: Cell, model: ErrorModel | None) -> None:
    """Checks that a model is of the arm in the cell.

    Raises:
        ModelMismatchError: It is of another.
    """
    if model is None:
        return
    mine, other = nominal_identity(cell.robot.nominal()), nominal_identity(model.robot.nominal())
    if not mine.same(other):
        raise ModelMismatchError(
            f"the model is of {model.robot.name}, the arm of the cell is {cell.robot.name}.",
            hint="choose the model that was calibrated in this cell.",
        )


def readings_name(session: ProbingSession) -> str:
    """Returns the name of the file of readings, which marks simulated ones."""
    return "readings simulated.csv" if session.simulated else "readings.csv"


def readings_csv(at: Opened, readings: Sequence[TouchReading]) -> bytes:
    """Returns readings as the file of a session, joints as the controller displays them."""
    return session_csv(at.session, readings, at.cell.robot.controller.to_controller)


def file_of(at: Opened, readings: Sequence[TouchReading]) -> PointsFile:
    """Returns readings as ``robotrue register`` reads them from a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / readings_name(at.session)
        path.write_bytes(readings_csv(at, readings))
        found = read_points(path, axis_relation(at.cell.robot))
    radius = at.words.probe_radius_mm * MM
    return replace(found, touches=replace(found.touches, radius=radius))


def touches_of(at: Opened, readings: Sequence[TouchReading]) -> ProbingSet | None:
    """Returns readings as touches whose part counts the parts of the session; None: no reading."""
    if not readings:
        return None
    found = file_of(at, readings).touches
    part = np.array([at.session.features[each.feature].part for each in readings], dtype=np.int64)
    return replace(found, part=part)


def places(at: Opened, rows: Sequence[tuple[int, int]]) -> ProbingSet:
    """Returns features, each in one of its postures, as touches that are not made yet.

    Args:
        at: The session.
        rows: Number of the feature, and of its posture.
    """
    features = [at.session.features[k] for k, _ in rows]
    nan = (np.nan, np.nan, np.nan)
    joints = [
        at.session.features[k].postures_deg[which]
        for k, which in rows
        if at.session.features[k].postures_deg
    ]
    if len(joints) < len(rows):
        joints = []
    return ProbingSet(
        names=tuple(each.name for each in features),
        point=np.array([each.point_mm for each in features]).reshape(-1, 3) * MM,
        joints=np.array(joints) * DEG if joints else np.empty((0, 0)),
        position=np.zeros((len(rows), 3)),
        normal=np.array([each.normal or nan for each in features]).reshape(-1, 3),
        part=np.array([each.part for each in features], dtype=np.int64),
        radius=at.words.probe_radius_mm * MM,
    )


def register_readings(at: Opened, readings: Sequence[TouchReading]) -> RegisteredPart:
    """Returns the result of ``robotrue register`` for the readings.

    Raises:
        RobotrueError: Reason of their refusal.
    """
    found = file_of(at, readings)
    return register(at.arm, found.touches, parts=found.parts, settings=at.settings)


def fit_readings(
    at: Opened, readings: Sequence[TouchReading]
) -> tuple[RegisteredPart | None, RobotrueError | None]:
    """Returns the registration, or why there is none yet."""
    if not readings:
        return None, None
    try:
        return register_readings(at, readings), None
    except RobotrueError as error:
        return None, error
    except np.linalg.LinAlgError:
        return None, ObservabilityError(
            "the touches do not determine the frame.", hint="probe points that are far apart."
        )


def select_trusted(
    at: Opened, readings: Sequence[TouchReading], found: RegisteredPart | None
) -> tuple[TouchReading, ...]:
    """Returns the readings accepted by the registration; all where there is none yet."""
    if found is None:
        return tuple(readings)
    wrong = {(frame.name, name) for frame in found.frames for name in frame.registration.outliers}
    parts, seen, out = at.session.parts, dict[tuple[str, str], int](), []
    for each in readings:
        feature = at.session.features[each.feature]
        key = (parts[feature.part], feature.name)
        seen[key] = seen.get(key, 0) + 1
        label = feature.name if seen[key] == 1 else f"{feature.name} ({seen[key]})"
        if (key[0], label) not in wrong:
            out.append(each)
    return tuple(out)


def belief_after(at: Opened, readings: Sequence[TouchReading]) -> TouchBelief:
    """Returns the estimate of arm and frames after readings."""
    return update_belief(
        at.arm,
        touches_of(at, readings),
        at.rough,
        settings=at.settings,
        rough_sigma=at.words.rough_mm * MM,
        joints=at.joints,
    )


def require_kind(value: str, allowed: Sequence[str], what: str) -> str:
    """Returns a word that is one of those allowed.

    Raises:
        ConfigurationError: Another one.
    """
    if value not in allowed:
        raise ConfigurationError(f"{what} {value!r}, expected {', '.join(allowed)}.")
    return value
