"""Probing sessions: started, read, entered into, decided, finished."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from fastapi.responses import Response
from pydantic import BaseModel, Field

from robotrue.app.workbench import workbench_calls as calls
from robotrue.planning.plan_defaults import LEAN_DEG, ROUGH_MM, TIP_AXIS
from robotrue.store.nouns import DOCUMENT, REGISTRATION, DocumentRecord
from robotrue.store.records import ItemRecord
from robotrue.validation.validation_defaults import REGISTRATION_FIT
from robotrue.web.api.items_routes import CSV, JSON, Id, csv_file, get_item, record_document
from robotrue.web.api.upload_routes import Files, UploadId, use_uploads
from robotrue.web.page_context import ServerContext

Version = Annotated[int, Field(ge=1, le=1_000_000)]
Feature = Annotated[int, Field(ge=-1, le=100_000)]
Length = Annotated[float, Field(ge=0.0, le=1000.0, allow_inf_nan=False)]


class Begin(BaseModel):
    """A requested session; lengths in mm as in ``robotrue register``.

    Attributes:
        uploads: One table: features, touched points, or a plan of ``robotrue probe-plan``.
        cell: Id of the cell of the part.
        model: Id of the model of the arm; None: the nominal arm.
        name: In the workspace; empty: that of the file.
        reads: Kind of readings.
        axes: Convention of joints where a reading does not state it.
        frame: ``X, Y, Z, A, B, C`` in mm and deg, the rough frame of the part; empty: as planned,
            or from the cell.
        tip_axis: The way from the flange to the tip, in the tool frame.
        lean_deg: Largest lean of the tool where postures are chosen.
        fit: auto, frame or joint.
    """

    uploads: Annotated[list[UploadId], Field(min_length=1, max_length=1)]
    cell: Annotated[str, Field(max_length=40)]
    model: Annotated[str, Field(max_length=40)] | None = None
    name: Annotated[str, Field(max_length=200)] = ""
    reads: Literal["joints", "position"] = "joints"
    axes: Literal["controller", "model"] = "controller"
    frame: Annotated[str, Field(max_length=200)] = ""
    tip_axis: Literal["+x", "-x", "+y", "-y", "+z", "-z"] = TIP_AXIS
    lean_deg: Annotated[float, Field(ge=0.0, le=60.0)] = LEAN_DEG
    rough_mm: Annotated[float, Field(ge=0.1, le=1000.0)] = ROUGH_MM
    touch_sigma_mm: Annotated[float, Field(gt=0.0, lt=100.0)] | None = None
    robot_sigma_mm: Length | None = None
    tool_sigma_mm: Length | None = None
    tolerance_mm: Length | None = None
    probe_radius_mm: Length = 0.0
    fit: Literal["auto", "frame", "joint"] = REGISTRATION_FIT


class Entered(BaseModel):
    """A reading of a feature, as the controller shows it or as typed."""

    version: Version
    feature: Annotated[int, Field(ge=0, le=100_000)]
    text: Annotated[str, Field(min_length=1, max_length=2000)]


class Decision(BaseModel):
    """Decision on the pending reading, a feature, or the last entry."""

    version: Version
    decision: Literal["keep", "retake", "skip", "undo"]
    feature: Feature = -1


class Taken(BaseModel):
    """A file of readings."""

    version: Version
    uploads: Annotated[list[UploadId], Field(min_length=1, max_length=1)]


class Finish(BaseModel):
    """The registration that is wanted."""

    version: Version
    name: Annotated[str, Field(min_length=1, max_length=200)]


class Latest(BaseModel):
    """The latest version of a session."""

    version: int


def router(server: ServerContext) -> APIRouter:
    """Returns the routes of sessions at the part."""
    routes = APIRouter(tags=["touching"])
    folder = str(server.workspace.folder)

    @routes.post("/touching", status_code=201)
    async def begin_session(asked_for: Begin) -> dict[str, object]:
        """A session: features, where the part is roughly, and postures to touch them with."""

        def begin(paths: Files) -> Awaitable[DocumentRecord]:
            stated = {**asked_for.model_dump(exclude={"uploads"}), "paths": list(map(str, paths))}
            return server.workers.ask(calls.begin_probing, folder, stated)

        return record_document(await use_uploads(server, asked_for.uploads, begin), DOCUMENT.name)

    @routes.get("/touching/{id}")
    async def show_session(
        id: Id,
        feature: Annotated[int, Query(ge=-1, le=100_000)] = -1,
    ) -> Response:
        """Next point, its expected reading, and the present estimate of the part's frame."""
        record = await _read_session(server, id)
        answer = await server.answers.once(calls.show_probing, folder, id, record.version, feature)
        return Response(answer, media_type=JSON)

    @routes.get("/touching/{id}/version")
    async def look_for_news(id: Id) -> Latest:
        """Returns the version of the session, which shows new entries."""
        record = await _read_session(server, id)
        return Latest(version=record.version)

    @routes.post("/touching/{id}/readings", status_code=201)
    async def enter_reading(id: Id, entered: Entered) -> dict[str, object]:
        """The session with one more reading; held, if it is not as expected."""
        await _read_session(server, id)
        made = await server.workers.ask(
            calls.enter_reading, folder, id, entered.version, entered.feature, entered.text
        )
        return record_document(made, DOCUMENT.name)

    _offer_outcomes(routes, server)
    return routes


def _offer_outcomes(routes: APIRouter, server: ServerContext) -> None:
    """Adds the routes that decide on readings, take a file of them, and end a session."""
    folder = str(server.workspace.folder)

    @routes.post("/touching/{id}/decisions", status_code=201)
    async def decide(id: Id, made: Decision) -> dict[str, object]:
        """The session after keep, retake, skip or undo."""
        await _read_session(server, id)
        changed = await server.workers.ask(
            calls.decide_reading, folder, id, made.version, made.decision, made.feature
        )
        return record_document(changed, DOCUMENT.name)

    @routes.post("/touching/{id}/files", status_code=201)
    async def take_readings(id: Id, taken: Taken) -> dict[str, object]:
        """The session with the readings of a file; those not as expected are set aside."""
        await _read_session(server, id)

        def import_readings(paths: Files) -> Awaitable[DocumentRecord]:
            return server.workers.ask(calls.import_readings, folder, id, taken.version, paths[0])

        made = await use_uploads(server, taken.uploads, import_readings)
        return record_document(made, DOCUMENT.name)

    @routes.post("/touching/{id}/registration", status_code=201)
    async def finish(id: Id, wanted: Finish) -> dict[str, object]:
        """The registration that the readings give, and the refined model where there is one."""
        await _read_session(server, id)
        made = await server.workers.ask(
            calls.finish_probing, folder, id, wanted.version, wanted.name
        )
        return record_document(made, REGISTRATION.name)

    @routes.get(
        "/touching/{id}/readings.csv",
        response_class=Response,
        responses=CSV,
    )
    async def download_readings(id: Id) -> Response:
        """The readings that count, as ``robotrue register`` reads them."""
        record = await _read_session(server, id)
        data = await server.workers.ask(calls.write_readings, folder, id)
        mark = " simulated" if record.detail["session"]["simulated"] else ""
        return csv_file(data, f"readings{mark}.csv")


async def _read_session(server: ServerContext, id: str) -> ItemRecord:
    return await asyncio.to_thread(get_item, server.workspace, DOCUMENT.name, id)
