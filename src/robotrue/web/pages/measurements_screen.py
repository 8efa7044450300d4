"""Measured poses: uploaded, previewed before import, checked by a model."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from robotrue.app.workbench import workbench_calls as calls
from robotrue.store.nouns import CELL, MEASUREMENT, CellRecord, MeasurementRecord
from robotrue.store.records import ItemQuery
from robotrue.web.page_context import PageContext
from robotrue.web.parts.residuals import draw_residuals
from robotrue.web.problems import fault_card, kind_words
from robotrue.web.uploads import find_upload

PAGE_ROWS: Final = 100
UNITS: Final[Mapping[str, tuple[str, ...]]] = {
    "joints_unit": ("deg", "rad"),
    "axes": ("model", "controller"),
    "position_unit": ("mm", "m", "um", "inch"),
    "frame": ("base", "tracker"),
}
RULES: Final = ("order", "name", "time")
"""How the rows of a joint list find their points."""
JOIN_COLUMNS: Final = ("joint_column", "point_column")
AXES: Final = ("x", "y", "z")
LENGTHS: Final = {f"position_{axis}": f"{axis} mm" for axis in AXES}


async def _build(context: PageContext) -> str:
    if context.query.get("upload"):
        return await _preview(context)
    if context.query.get("id") is None:
        return await _list(context)
    return context.render("measurement.html", record=await _record(context))


async def _record(context: PageContext) -> MeasurementRecord:
    return await context.item(MEASUREMENT, context.query["id"])


async def _list(context: PageContext) -> str:
    text = context.query.get("text", "")
    found = await context.items(MEASUREMENT, ItemQuery(text=text, limit=200))
    begun = await context.creation_times(found)
    return context.render("measurements.html", sets=found, begun=begun, text=text)


async def _judge(context: PageContext) -> str:
    """Errors of a set under the page's model."""
    record, model = await _record(context), context.model
    if model is None:
        return ""
    found = await context.answer(
        calls.judge_measurement, record.id, record.version, model.id, model.version
    )
    source = f"/api/scenes/measurement/{record.id}?model={model.id}&version={record.version}"
    residuals = draw_residuals(context, found["poses"], found["sizes"])
    return context.render(
        "measurement_judged.html", found=found, source=source, residuals=residuals
    )


async def _rows(context: PageContext) -> str:
    """Some rows of a set; a heading sorts by its column."""
    record, sort = await _record(context), context.query.get("sort", "")
    facts = (record.id, record.version, sort, context.offset(), PAGE_ROWS)
    return context.render(
        "measurement_rows.html",
        found=await context.answer(calls.list_rows, *facts),
        address=context.keep_choices(f"/measurements?id={record.id}"),
        sort=sort,
        step=PAGE_ROWS,
        lengths=LENGTHS,
    )


async def _preview(context: PageContext) -> str:
    paths = [find_upload(context.workspace, key) for key in _keys(context)]
    cells = await context.items(CELL, ItemQuery(limit=50))
    name = ", ".join(path.name for path in paths)
    return context.render("measurement_preview.html", name=name, cells=cells)


async def _columns(context: PageContext) -> str:
    """Renders the columns of an upload, their mapping, and its faults.

    The chosen mapping is in the address.
    """
    say, keys = context.say, _keys(context)
    paths = [find_upload(context.workspace, key) for key in keys]
    cells = await context.items(CELL, ItemQuery(limit=50))
    cell = _cell(context, cells)
    mapping = _read_mapping(context.query)
    found = json.loads(
        await context.server.workers.ask(
            calls.preview_file, context.folder, paths, cell.id, mapping
        )
    )
    wrong = found["fault"]
    fault = ""
    if wrong:
        place = f"{say('measurements.line')} {wrong['line']}: " if wrong.get("line") else ""
        kind, title = kind_words(wrong["kind"]), say("preview.refused")
        fault = fault_card(say, kind, place + wrong["message"], wrong["hint"], title=title)
    joint_list = found["joint_list"]
    if joint_list is not None and mapping is None:
        mapping = {**found["guess"], "joint_list": joint_list}
    used = keys if joint_list is not None else keys[:1]
    guess = mapping or found["guess"]
    columns = [(f"j{k + 1}", name) for k, name in enumerate(guess["joints"])]
    return context.render(
        "measurement_columns.html",
        found=found,
        fault=fault,
        ready="poses" in found and not wrong,
        known=found["layout"] and mapping is None,
        key=",".join(keys),
        cells=cells,
        cell=cell,
        body={"uploads": used, "cell": cell.id, "mapping": mapping},
        joint_list=joint_list,
        rules=RULES,
        guess=guess,
        columns=[*columns, *zip(AXES, guess["position"], strict=True)],
        units=UNITS,
        axes=AXES,
    )


def _keys(context: PageContext) -> list[str]:
    """Ids of the file, or of a list of points and a joint list."""
    return context.query["upload"].split(",")[:2]


def _cell(context: PageContext, cells: tuple[CellRecord, ...]) -> CellRecord:
    return next((each for each in cells if each.id == context.query.get("cell")), cells[0])


def _read_mapping(query: Mapping[str, str]) -> dict[str, Any] | None:
    """The column mapping in the address, or None where none was chosen."""
    joints = [query[f"j{k}"] for k in range(1, 10) if query.get(f"j{k}")]
    position = [query[axis] for axis in AXES if query.get(axis)]
    if not joints or len(position) != len(AXES):
        return None
    units = {name: query[name] for name, known in UNITS.items() if query.get(name) in known}
    ignored = [query["ignore"]] if query.get("ignore") else []
    stated: dict[str, Any] = {"joints": joints, "position": position, "ignore": ignored}
    stated["ignore_other"] = True
    if query.get("by") in RULES:
        joint_list: dict[str, Any] = {"by": query["by"]}
        joint_list |= {name: query[name] for name in JOIN_COLUMNS if query.get(name)}
        with suppress(KeyError, ValueError):
            joint_list["tolerance_s"] = float(query["tolerance_s"])
        stated["joint_list"] = joint_list
    return stated | units


BUILDS: Final = {"": _build, "judged": _judge, "rows": _rows, "columns": _columns}
