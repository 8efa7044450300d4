"""The end of a session at the part: the registration, kept with all it rests on."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from robotrue.app.workbench.probing_state import Opened, file_of, open_session, readings_name
from robotrue.cell.config import parse_cell
from robotrue.cell.part import PartTable, part_tables
from robotrue.cell.toml_edit import with_part
from robotrue.core.files import write_atomic
from robotrue.errors import ConfigurationError
from robotrue.measurement.touch_session import session_csv
from robotrue.report.content import Fact
from robotrue.report.page import report_html
from robotrue.report.registration_report import registration_content
from robotrue.report.words import Lang
from robotrue.store import cells, models, registrations
from robotrue.store.model_file import write_model
from robotrue.store.nouns import RegistrationRecord
from robotrue.store.records import Ref
from robotrue.store.registrations import save_session
from robotrue.store.workspace import Workspace, transaction
from robotrue.validation.part_registration import register

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
                "a reading waits for a decision.", hint="keep it, touch again, or skip the point."
            )
        if not at.session.kept:
            raise ConfigurationError("nothing was touched yet.", hint="take a reading first.")
        place, readings = Path(scratch), readings_name(at.session)
        file = file_of(at, at.session.kept)
        found = register(at.arm, file.touches, parts=file.parts, settings=at.settings)
        (place / readings).write_bytes(session_csv(at.session, at.session.kept))
        model_file = ""
        if found.refined is not None:
            model_file = REFINED
            write_model(place / REFINED, found.refined, at.cell)
        elif at.model_record is not None:
            model_file = at.model_record.files("model")[0].name
        table = found.table(model_file=model_file, points_file=readings, points_sha256=file.digest)
        _write_cell(workspace, at, table, place)
        pages = _reports(at, table, name, place)
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
    session = open_session(workspace, id).session
    return session_csv(session, session.kept)


def _write_cell(workspace: Workspace, at: Opened, table: PartTable, place: Path) -> None:
    """The registered cell, read back before it is kept."""
    own = place / "cell"
    own.mkdir()
    text = cells.copy_cell(workspace, at.cell_record, own).read_text(encoding="utf-8")
    data = with_part(text, part_tables(table)).encode()
    parse_cell(data, own / REGISTERED)
    write_atomic(place / REGISTERED, data)
    for each in own.iterdir():  # what the cell names stands beside it
        if each.name != "cell.toml" and not (place / each.name).exists():
            (place / each.name).write_bytes(each.read_bytes())


def _reports(at: Opened, table: PartTable, name: str, place: Path) -> list[Path]:
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
