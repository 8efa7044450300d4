"""A session at the part: readings checked, saved, decided, undone, imported; its registration."""

from __future__ import annotations

from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

import numpy as np

from robotrue.app.workbench.probing_state import (
    Opened,
    belief_after,
    file_of,
    fit_readings,
    open_session,
    places,
    readings_csv,
    readings_name,
    select_trusted,
    touches_of,
)
from robotrue.cell.config import parse_cell
from robotrue.cell.part import PartTable, part_tables
from robotrue.cell.toml_edit import with_part
from robotrue.core.files import write_atomic
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.measurement.formats.part_points import read_points
from robotrue.measurement.formats.reading_line import joints_line, position_line
from robotrue.measurement.probing_set import ProbingSet
from robotrue.measurement.touch_session import ProbingSession, TouchReading
from robotrue.report.content import Fact
from robotrue.report.page import report_html
from robotrue.report.registration_report import registration_content
from robotrue.report.words import Lang
from robotrue.robot.configuration import axis_relation
from robotrue.store import cells, models, registrations
from robotrue.store.model_file import write_model
from robotrue.store.nouns import DocumentRecord, RegistrationRecord
from robotrue.store.records import Ref
from robotrue.store.registrations import save_session
from robotrue.store.workspace import Workspace, transaction
from robotrue.validation.part_registration import register
from robotrue.validation.touch_expectation import (
    Suspicion,
    TouchBelief,
    check_reading,
    find_suspicions,
    machined_radius,
)

LONGEST_TEXT: Final = 500
DECISIONS: Final = ("keep", "retake", "skip", "undo")


def enter_reading(
    workspace: Workspace, id: str, version: int, feature: int, text: str
) -> DocumentRecord:
    """Returns the session with one more reading: accepted, or pending because it is unexpected."""
    at = open_session(workspace, id, version)
    if not 0 <= feature < len(at.session.features):
        raise ConfigurationError(f"feature {feature + 1} of {len(at.session.features)}.")
    values = reading_values(at, text)
    session = _with(at, feature, values, text, hold=True)
    return save_session(workspace, id, version, session)


def decide_reading(
    workspace: Workspace, id: str, version: int, decision: str, feature: int
) -> DocumentRecord:
    """Returns the session after keep, retake, skip (of what waits, or of a feature) or undo."""
    at = open_session(workspace, id, version)
    session = at.session
    if decision == "undo":
        session = session.undo()
    elif decision == "skip" and session.held is None:
        session = session.with_reading(TouchReading(feature=feature, state="skipped", at=_now()))
    elif decision in DECISIONS:
        words: dict[str, Literal["kept", "dropped", "skipped"]] = {
            "keep": "kept", "retake": "dropped", "skip": "skipped",
        }  # fmt: skip
        session = _with_radius(at, session.decide(words[decision]))
    else:
        raise ConfigurationError(f"decision {decision!r}, expected one of {', '.join(DECISIONS)}.")
    return save_session(workspace, id, version, session)


def import_readings(workspace: Workspace, id: str, version: int, path: Path) -> DocumentRecord:
    """Returns the session with the readings of a file; those not as expected are set aside."""
    at = open_session(workspace, id, version)
    at = replace(at, session=_with_file(at, path))
    file = read_points(path, axis_relation(at.cell.robot)).touches.provenance
    simulated = at.session.simulated or file.simulated
    session = replace(at.session, simulated=simulated)
    return save_session(workspace, id, version, session)


def reading_values(at: Opened, text: str) -> tuple[float, ...]:
    """Returns what was read: joints in deg in the model's sense, or x, y, z in mm.

    Raises:
        FormatError: Not a reading of this session's kind.
    """
    if not at.joints:
        return position_line(text).values
    found = joints_line(text, at.cell.robot.dof)
    counting = at.session.settings["axes"] if found.counting == "stated" else found.counting
    if counting == "model":
        return found.values
    joints = at.cell.robot.controller.to_model(np.array(found.values) * DEG)
    return tuple(np.round(joints / DEG, 9).tolist())


def _with(
    at: Opened, feature: int, values: tuple[float, ...], text: str, *, hold: bool
) -> ProbingSession:
    """Returns the session with a reading, checked against those before it."""
    before = [each for each in at.session.kept if each.feature != feature]
    found, _ = fit_readings(at, before)
    known = belief_after(at, select_trusted(at, before, found))
    reading = TouchReading(
        feature=feature, state="kept", values=values, text=text[:LONGEST_TEXT], at=_now()
    )
    touch = touches_of(at, [reading])
    if touch is None:
        raise FormatError("an empty reading.", hint="paste the line of the controller.")
    judged = check_reading(known, touch)
    why: tuple[Suspicion, ...] = ()
    if judged.outlier:
        why = find_suspicions(
            known, touch, judged, others=_others(at, feature), before=touches_of(at, before),
            tip_axis=at.tip_axis,
        )  # fmt: skip
    reading = replace(
        reading,
        state=("held" if hold else "dropped") if judged.outlier else "kept",
        sigmas=judged.sigmas,
        off_mm=judged.distance / MM,
        suspicions=tuple(_plain(each) for each in why),
    )
    return _with_radius(at, at.session.with_reading(reading))


def _with_file(at: Opened, path: Path) -> ProbingSession:
    """Returns the session with the readings of a file: checked together if they fix a frame."""
    rows, session = _rows_of_file(at, path), at.session
    for feature, values in rows:
        reading = TouchReading(
            feature=feature, state="kept", values=values, text=path.name, at=_now()
        )
        session = session.with_reading(reading)
    found, _ = fit_readings(at, session.kept)
    if found is None:  # too few to check one by the others
        for feature, values in rows:
            at = replace(at, session=_with(at, feature, values, path.name, hold=False))
        return at.session
    good = select_trusted(at, session.kept, found)
    readings = tuple(
        replace(each, state="dropped") if each.state == "kept" and each not in good else each
        for each in session.readings
    )
    return _with_radius(at, replace(session, readings=readings))


def _others(at: Opened, feature: int) -> ProbingSet:
    part = at.session.features[feature].part
    own = at.session.features[feature].point_mm
    rows = [
        (k, 0)
        for k, each in enumerate(at.session.features)
        if k != feature and each.part == part and each.point_mm != own
    ]
    return places(at, rows)


def _with_radius(at: Opened, session: ProbingSession) -> ProbingSession:
    """Returns the session whose last accepted reading states the uncertainty of the worst place."""
    kept = [k for k, each in enumerate(session.readings) if each.state == "kept"]
    if not kept or session.readings[kept[-1]].radius_mm is not None:
        return session
    now = replace(at, session=session)
    found, _ = fit_readings(now, session.kept)
    radius = worst_place(now, belief_after(now, select_trusted(now, session.kept, found)))[1]
    last = replace(session.readings[kept[-1]], radius_mm=radius)
    readings = (*session.readings[: kept[-1]], last, *session.readings[kept[-1] + 1 :])
    return replace(session, readings=readings)


def worst_place(at: Opened, known: TouchBelief) -> tuple[int, float, dict[int, float]]:
    """Returns the most uncertain feature, its 95 % radius in mm, and that of every feature."""
    features = at.session.features
    rows = [(k, 0) for k, each in enumerate(features) if each.postures_deg or not at.joints]
    radius = machined_radius(known, places(at, rows)) / MM
    each = {k: float(r) for (k, _), r in zip(rows, radius, strict=True)}
    worst = max(each, key=lambda k: each[k])
    return worst, each[worst], each


def _rows_of_file(at: Opened, path: Path) -> list[tuple[int, tuple[float, ...]]]:
    """Features and values of a file of touched points, or of lines ``name: reading``."""
    file = read_points(path, axis_relation(at.cell.robot))
    touches = file.touches
    if touches.has_joints != at.joints:
        raise FormatError(
            f"it holds {'joints' if touches.has_joints else 'positions'}, this session reads "
            f"{'joints' if at.joints else 'positions'}.",
            source=path.name,
            hint="begin a session that reads what the file holds.",
        )
    values = touches.joints / DEG if at.joints else touches.position / MM
    out, used = [], set[int]()
    for n, name in enumerate(touches.names):
        part = file.parts[int(touches.part[n])] if len(at.session.parts) > 1 else None
        able = [
            k
            for k, each in enumerate(at.session.features)
            if each.name == name and part in (None, at.session.parts[each.part])
        ]
        free = [k for k in able if k not in used]
        if not able:
            raise FormatError(
                f"no feature {name!r} in this session.",
                source=path.name,
                line=int(touches.lines[n]),
                hint="the same names as in the list of features.",
            )
        chosen = (free or able)[0]
        used.add(chosen)
        out.append((chosen, tuple(float(v) for v in np.round(values[n], 10))))
    return out


def _plain(each: Suspicion) -> dict[str, object]:
    out = asdict(each)
    out["length_mm"] = out.pop("length") / MM
    return {k: v for k, v in out.items() if not (isinstance(v, float) and np.isnan(v))}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


REGISTERED: Final = "registered.toml"
REFINED: Final = "refined.robotrue"
REPORTS: Final[tuple[tuple[Lang, str], ...]] = (("en", "report.html"), ("zh", "report_zh.html"))


def finish_probing(workspace: Workspace, id: str, version: int, name: str) -> RegistrationRecord:
    """Returns the record of the registration that a session's readings give.

    The same readings, written out and given to ``robotrue register``, give the same frames. Where
    touching refined the model of the arm, the refined one is kept, too: the frames belong to it.
    """
    with TemporaryDirectory() as scratch:
        at = open_session(workspace, id, version)
        if at.session.held is not None:
            raise ConfigurationError(
                "a reading waits for a decision.", hint="accept it, probe again, or skip the point."
            )
        if not at.session.kept:
            raise ConfigurationError("no point was probed yet.", hint="take a reading first.")
        place, readings = Path(scratch), readings_name(at.session)
        file = file_of(at, at.session.kept)
        found = register(at.arm, file.touches, parts=file.parts, settings=at.settings)
        (place / readings).write_bytes(readings_csv(at, at.session.kept))
        model_file = ""
        if found.refined is not None:
            model_file = REFINED
            write_model(place / REFINED, found.refined, at.cell)
        elif at.model_record is not None:
            model_file = at.model_record.files("model")[0].name
        table = found.table(model_file=model_file, points_file=readings, points_sha256=file.digest)
        _write_cell(workspace, at, table, place)
        pages = _write_reports(at, table, name, place)
        with transaction(workspace) as into:
            model = None if at.model_record is None else at.model_record.ref
            if found.refined is not None:
                model = models.add(
                    into,
                    place / REFINED,
                    name=f"{name}, refined",
                    parents=[] if model is None else [model],
                    cell=at.cell_record.ref,
                    settings={key: value for key, value in at.session.settings.items()},
                ).ref
            made = registrations.add(
                into,
                place / REGISTERED,
                place / readings,
                name=name,
                cell=at.cell_record.ref,
                model=model,
                session=Ref(id=id, version=version),
                reports=pages,
            )
            save_session(into, id, version, at.session, result=made.id)
        return made


def write_readings(workspace: Workspace, id: str) -> bytes:
    """Returns the readings that count, as the file that ``robotrue register`` reads."""
    at = open_session(workspace, id)
    return readings_csv(at, at.session.kept)


def _write_cell(workspace: Workspace, at: Opened, table: PartTable, place: Path) -> None:
    """Writes the registered cell, and reads it back before saving."""
    own = place / "cell"
    own.mkdir()
    text = cells.copy_cell(workspace, at.cell_record, own).read_text(encoding="utf-8")
    data = with_part(text, part_tables(table)).encode()
    parse_cell(data, own / REGISTERED)
    write_atomic(place / REGISTERED, data)
    for each in own.iterdir():  # files that the cell names are next to it
        if each.name != "cell.toml" and not (place / each.name).exists():
            (place / each.name).write_bytes(each.read_bytes())


def _write_reports(at: Opened, table: PartTable, name: str, place: Path) -> list[Path]:
    out = []
    for lang, file in REPORTS:
        content = registration_content(
            table,
            name=name,
            robot=at.cell.robot.name,
            simulated=at.session.simulated,
            provenance=(Fact(name=at.record.name, value=f"{at.record.id} v{at.record.version}"),),
            lang=lang,
        )
        write_atomic(place / file, report_html(content).encode())
        out.append(place / file)
    return out
