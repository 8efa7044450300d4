"""A file before it is taken in: its columns, how they are read, what is wrong with that."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from typing import Any, Final

from robotrue.errors import RobotrueError
from robotrue.store import items
from robotrue.store.nouns import CELL, CellRecord
from robotrue.store.records import ItemQuery
from robotrue.web.bench import Bench
from robotrue.web.parts.elements import Tile, table, tiles
from robotrue.web.parts.faults import not_found, stated
from robotrue.web.parts.frame import html
from robotrue.web.parts.later import later
from robotrue.web.uploads import uploaded

UNITS: Final[Mapping[str, tuple[str, ...]]] = {
    "joints_unit": ("deg", "rad"),
    "position_unit": ("mm", "m", "um"),
    "frame": ("base", "tracker"),
}
AXES: Final = ("x", "y", "z")


async def preview(bench: Bench) -> None:
    """Builds the page of one upload; what is chosen stands in its address."""
    say, workspace = bench.say, bench.house.workspace
    key = bench.query["upload"].partition(",")[0]
    try:
        path = uploaded(workspace, key)
    except RobotrueError as error:
        html(not_found(say, error))
        return
    cells = (await bench.ask(items.search, workspace, CELL, ItemQuery(limit=50))).items
    html(f"<h1>{escape(path.name)}</h1><p class='lead'>{escape(say('preview.lead'))}</p>").classes(
        "head"
    )
    if not cells:
        html(f"<p>{escape(say('preview.no_cell'))}</p>").classes("card")
        return
    cell = next((each for each in cells if each.id == bench.query.get("cell")), cells[0])
    mapping = _chosen(bench.query)

    async def ask() -> bytes:
        text = json.dumps(mapping) if mapping else ""
        folder = str(workspace.folder)
        return await bench.house.workers.ask("preview.previewed", folder, str(path), cell.id, text)

    later(bench, ask, lambda found: _show(bench, found, key, cells, cell, mapping))


def _chosen(query: Mapping[str, str]) -> dict[str, Any] | None:
    """The column mapping in the address, or None where none was chosen."""
    joints = [query[f"j{k}"] for k in range(1, 10) if query.get(f"j{k}")]
    position = [query[axis] for axis in AXES if query.get(axis)]
    if not joints or len(position) != len(AXES):
        return None
    units = {name: query[name] for name, known in UNITS.items() if query.get(name) in known}
    return {"joints": joints, "position": position, "ignore_other": True, **units}


def _show(
    bench: Bench,
    found: dict[str, Any],
    key: str,
    cells: tuple[CellRecord, ...],
    cell: CellRecord,
    mapping: dict[str, Any] | None,
) -> None:
    say, wrong = bench.say, found["fault"]
    ready = "poses" in found and not wrong
    if ready:
        html(_summary(bench, found)).classes("tiles").props('data-testid="preview-ready"')
        for remark in found["remarks"]:
            html(f"<p class='note'>{escape(remark)}</p>").classes("card")
    elif wrong:
        place = f"{say('measurements.line')} {wrong['line']}: " if wrong.get("line") else ""
        message, title = place + wrong["message"], say("preview.refused")
        html(stated(say, wrong["kind"], message, wrong["hint"], title=title))
    else:
        html(f"<p>{escape(say('preview.unknown'))}</p>").classes("card")
    html(_form(bench, found, key, cells, cell, mapping, ready=ready)).classes("card")
    columns = [escape(c) for c in found["columns"]]
    rows = [[escape(value) for value in row] for row in found["rows"]]
    title = say("preview.first_rows", shown=len(rows), count=found["count"])
    shown = table(columns, rows, words=(), mark="preview")
    html(f"<h2>{escape(title)}</h2>{shown}").classes("card")


def _summary(bench: Bench, found: dict[str, Any]) -> str:
    say = bench.say
    spans = [
        Tile(label=f"{axis} mm", value=f"{low:.0f} … {high:.0f}")
        for axis, low, high in zip(AXES, found["low_mm"], found["high_mm"], strict=True)
    ]
    return tiles(
        [
            Tile(label=say("measurements.poses"), value=f"{found['poses']:,}", tone="good"),
            Tile(
                label=say("measurements.frame"), value=say(f"measurements.frame_{found['frame']}")
            ),
            *spans,
        ]
    )


def _form(
    bench: Bench,
    found: dict[str, Any],
    key: str,
    cells: tuple[CellRecord, ...],
    cell: CellRecord,
    mapping: dict[str, Any] | None,
    *,
    ready: bool,
) -> str:
    say = bench.say
    known = found["layout"] and mapping is None
    options = "".join(
        f'<option value="{each.id}"{" selected" if each.id == cell.id else ""}>'
        f"{escape(each.name)}</option>"
        for each in cells
    )
    fields = (
        f'<label class="field">{escape(say("preview.cell"))}'
        f'<select name="cell">{options}</select></label>'
    )
    title = say("preview.layout_known", layout=found["layout"]) if known else say("preview.columns")
    if not known:
        fields += _columns(bench, found, mapping)
    body = {"uploads": [key], "cell": cell.id, "mapping": mapping}
    take = (
        f'<button type="button" class="act" data-testid="take-in" data-body="'
        f"{escape(json.dumps(body), quote=True)}\" onclick=\"bench.make('/api/measurements',"
        "JSON.parse(this.dataset.body),'/measurements?id={id}',this)\">"
        f"{escape(say('preview.take'))}</button>"
        if ready
        else ""
    )
    return (
        f"<h2>{escape(title)}</h2><form method='get' class='mapping'>"
        f"<input type='hidden' name='upload' value='{key}'>"
        f"<div class='fields'>{fields}</div><div class='head' style='margin:14px 0 0'>"
        f"<div class='acts'><button class='act quiet' data-testid='look-again'>"
        f"{escape(say('preview.again'))}</button>{take}</div></div></form>"
    )


def _columns(bench: Bench, found: dict[str, Any], mapping: dict[str, Any] | None) -> str:
    """One choice for each joint and axis, and the units; what the names say is chosen already."""
    say, guess = bench.say, mapping or found["guess"]
    wanted = [(f"j{k + 1}", name) for k, name in enumerate(guess["joints"])]
    wanted += list(zip(AXES, guess["position"], strict=True))
    out = ""
    for name, column in wanted:
        listed = [""] + found["columns"]
        options = "".join(
            f"<option{' selected' if each == column else ''}>{escape(each)}</option>"
            for each in listed
        )
        out += (
            f'<label class="field">{escape(name)}<select name="{name}" '
            f'data-testid="column-{name}">{options}</select></label>'
        )
    for name, choices in UNITS.items():
        options = "".join(
            f"<option{' selected' if guess.get(name) == each else ''}>{each}</option>"
            for each in choices
        )
        out += (
            f'<label class="field">{escape(say(f"preview.{name}"))}<select name="{name}" '
            f'data-testid="unit-{name}">{options}</select></label>'
        )
    return out
