"""Registration: probing sessions and their results."""

from __future__ import annotations

from typing import Final

from robotrue.errors import ConfigurationError
from robotrue.measurement.touch_session import session_of
from robotrue.store.nouns import (
    CELL,
    DOCUMENT,
    MODEL,
    REGISTRATION,
    DocumentRecord,
    RegistrationRecord,
)
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext
from robotrue.web.parts.reports import find_reports

KIND: Final = "touching"
"""Of the documents that are sessions; ``store.touchings`` would bring numeric libraries with it."""


async def _build(context: PageContext) -> str:
    session, made = context.query.get("id"), context.query.get("registration")
    if session is not None:
        record = await context.item(DOCUMENT, session)
        if record.kind != KIND:
            raise ConfigurationError(f"document {record.name!r} is no session of touches.")
        return context.render("registration_session.html", record=record)
    if made is not None:
        return await _show_registration(context, await context.item(REGISTRATION, made))
    return await _list(context)


async def _list(context: PageContext) -> str:
    cells = await context.items(CELL, ItemQuery(limit=50))
    names = {each.id: each.name for each in cells}
    models = await context.items(MODEL, ItemQuery(limit=50))
    sessions = await context.items(DOCUMENT, ItemQuery(where={"kind": KIND}, limit=100))
    registrations = await context.items(REGISTRATION, ItemQuery(limit=100))

    def cell_of(record: DocumentRecord | RegistrationRecord) -> str:
        return ", ".join(names.get(to.id, "–") for to in record.refs("cell"))

    return context.render(
        "registrations.html",
        cells=[{"id": each.id, "name": each.name} for each in cells],
        models=[{"id": each.id, "name": each.name} for each in models],
        sessions=[
            (each, session_of(each.detail["session"]), cell_of(each))
            for each in (sessions if cells else ())
        ],
        registrations=[(each, cell_of(each)) for each in (registrations if cells else ())],
    )


async def _show_registration(context: PageContext, record: RegistrationRecord) -> str:
    """A registration: its frames, and what it rests on."""
    linked, session, simulated = record.refs("session"), None, False
    tolerance: object = None
    if linked:
        session = await context.item(DOCUMENT, linked[0].id)
        probed = session_of(session.detail["session"])
        simulated, tolerance = probed.simulated, probed.settings.get("tolerance_mm")
    cells = [await context.item(CELL, to.id, to.version) for to in record.refs("cell")]
    models = [await context.item(MODEL, to.id, to.version) for to in record.refs("model")]
    used = [
        *((context.say("registration.of_cell"), f"{each.name} v{each.version}") for each in cells),
        *((context.say("registration.model_named"), f"{m.name} v{m.version}") for m in models),
    ]
    return context.render(
        "registration.html",
        record=record,
        session=session,
        simulated=simulated,
        tolerance_mm=tolerance,
        used=used,
        report="report_zh.html" if context.say.language == "zh" else "report.html",
        reports=await find_reports(context, record, "registration"),
    )


BUILDS: Final = {"": _build}
