"""``robotrue workspace``: items taken in, listed, shown, deleted and brought back."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_facts, emit_json, emit_table, say, say_mark
from robotrue.cli.inputs import measured
from robotrue.cli.workspace import opened
from robotrue.core.provenance import simulation_mark
from robotrue.errors import ConfigurationError
from robotrue.store import cells, items, journal, measurements, models, programs
from robotrue.store.layout import laid_out
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, NOUNS, PROGRAM, noun_of
from robotrue.store.provenance import provenance_of_record
from robotrue.store.records import Query, Record
from robotrue.store.workspace import Workspace

SHOWN: Final = {
    "robot": ("maker", "dof"),
    "tool": (),
    "cell": ("robot", "frame"),
    "measurement": ("poses", "dof", "frame"),
    "model": ("method", "robot", "made_by"),
    "registration": ("verdict", "frames", "method"),
    "program": ("stage", "dialect", "bytes"),
    "document": ("kind",),
    "drift-check": ("verdict", "poses", "p_value"),
}
"""Columns of the list of each noun, besides id, name, version and time."""
WHOLE: Final = ("poses", "dof", "version", "frames", "bytes", "file_count", "full_poses")
TAKEN_IN: Final = (CELL.name, MEASUREMENT.name, MODEL.name, PROGRAM.name)


def run_add(
    folder: Path,
    noun: str,
    files: Sequence[Path],
    *,
    cell: str | None,
    mapping: Path | None,
    name: str | None,
    note: str,
    as_json: bool,
) -> None:
    """Takes files in as one item."""
    if noun not in TAKEN_IN:
        raise ConfigurationError(
            f"{noun!r} is not taken in from files, expected {', '.join(TAKEN_IN)}."
        )
    if noun in (CELL.name, MODEL.name) and len(files) != 1:
        raise ConfigurationError(f"{len(files)} files, expected one {noun}.")
    label = name or files[0].stem
    with opened(folder) as workspace:
        made: Record
        if noun == CELL.name:
            made = cells.add(workspace, files[0], name=label, note=note)
        elif noun == MODEL.name:
            made = models.add(workspace, files[0], name=label, note=note)
        elif noun == PROGRAM.name:
            made = programs.add(workspace, files, name=name, note=note)
        else:
            made = _measurements(workspace, files, cell, mapping, label, note)
    say_mark(provenance_of_record(made))
    say(f"{noun} {made.name!r} taken in as {made.id}")
    if as_json:
        emit_json(document(noun, made))


def _measurements(
    workspace: Workspace,
    files: Sequence[Path],
    cell: str | None,
    mapping: Path | None,
    name: str,
    note: str,
) -> Record:
    if cell is None:
        raise ConfigurationError(
            "measurements without the cell they were made in.",
            hint="--cell NAME; robotrue workspace list cell shows them.",
        )
    _, id = items.resolve(workspace, cell, CELL.name)
    record = items.get(workspace, CELL, id)
    with tempfile.TemporaryDirectory() as folder:
        rows = measured(read_cell(cells.laid(workspace, record, Path(folder))), files, mapping)
    raw = [*files, *([mapping] if mapping is not None else [])]
    return measurements.add(workspace, rows, name=name, raw=raw, cell=record.ref, note=note)


def run_list(
    folder: Path,
    noun: str | None,
    *,
    text: str,
    where: Sequence[str],
    sort: str,
    offset: int,
    limit: int,
    deleted: bool,
    as_json: bool,
) -> None:
    """Shows a page of items, or how many there are of each noun."""
    with opened(folder) as workspace:
        if noun is None:
            _count(workspace, text, deleted=deleted, as_json=as_json)
            return
        query = Query(
            text=text,
            where=dict(_condition(each) for each in where),
            sort=sort,
            offset=offset,
            limit=limit,
            deleted=deleted,
        )
        page = items.listed(workspace, noun_of(noun), query)
    if as_json:
        emit_json(
            {
                "total": page.total,
                "offset": page.offset,
                "items": [document(noun, each) for each in page.items],
            }
        )
        return
    columns = SHOWN[noun]
    emit_table(
        f"{noun}: {offset + 1 if page.items else 0} to {offset + len(page.items)} of {page.total}",
        ("id", "name", "version", "created", *columns, ""),
        [
            (
                each.id[:8],
                each.name,
                str(each.version),
                _time(each.created),
                *(_text(getattr(each, column)) for column in columns),
                simulation_mark(provenance_of_record(each)),
            )
            for each in page.items
        ],
        words=True,
    )


def _count(workspace: Workspace, text: str, *, deleted: bool, as_json: bool) -> None:
    query = Query(text=text, deleted=deleted, limit=1)
    totals = {name: items.listed(workspace, noun, query).total for name, noun in NOUNS.items()}
    if as_json:
        emit_json({"nouns": totals})
    else:
        emit_table("", ("", "items"), [(name, str(total)) for name, total in totals.items()])


def run_show(
    folder: Path, item: str, *, version: int | None, output: Path | None, as_json: bool
) -> None:
    """Shows one version of an item; copies its files."""
    with opened(folder) as workspace:
        noun, id = items.resolve(workspace, item)
        found = items.get(workspace, noun_of(noun), id, version=version)
        if output is not None:
            if not output.is_dir():
                raise ConfigurationError("no folder.", source=output, hint=f"mkdir -p {output}")
            for path in laid_out(workspace, found, output):
                say(f"written: {path}")
    if as_json:
        emit_json(document(noun, found))
        return
    told = document(noun, found)
    facts = [(key, _text(told[key])) for key in told if key not in ("links", "files", "detail")]
    facts += [
        (link["role"], f"{link['id'][:8]} version {link['version']}") for link in told["links"]
    ]
    facts += [(f"file ({each['role']})", each["name"]) for each in told["files"]]
    facts += [
        (key, _text(value))
        for key, value in found.detail.items()
        if isinstance(value, str | int | float) and value != ""
    ]
    emit_facts(f"{noun} {found.name}", facts, provenance_of_record(found))


def run_history(folder: Path, item: str | None, *, limit: int, as_json: bool) -> None:
    """Shows what was done, the newest first."""
    with opened(folder) as workspace:
        id = None if item is None else items.resolve(workspace, item)[1]
        page = journal.entries(workspace, item=id, limit=limit)
    if as_json:
        entries = [{**asdict(each), "at": each.at.isoformat()} for each in page.items]
        emit_json({"total": page.total, "entries": entries})
        return
    emit_table(
        f"{page.total} entries" if page.total != 1 else "1 entry",
        ("when", "what", "noun", "id", "version", ""),
        [
            (
                _time(each.at),
                each.action,
                each.noun,
                each.item[:8],
                str(each.version or ""),
                str(each.detail.get("name", each.detail.get("kind", ""))),
            )
            for each in page.items
        ],
        words=True,
    )


def run_delete(folder: Path, item: str, *, as_json: bool) -> None:
    """Deletes an item."""
    with opened(folder) as workspace:
        noun, id = items.resolve(workspace, item)
        made = items.delete(workspace, noun_of(noun), id)
    say_mark(provenance_of_record(made))
    say(f"{noun} {made.name!r} deleted; robotrue workspace undo {id[:8]} brings it back")
    if as_json:
        emit_json(document(noun, made))


def run_undo(folder: Path, item: str, *, as_json: bool) -> None:
    """Takes the last change of an item back."""
    with opened(folder) as workspace:
        noun, id = items.resolve(workspace, item)
        made = items.undo(workspace, noun_of(noun), id)
    say_mark(provenance_of_record(made))
    state = "deleted again" if made.deleted else "as it was"
    say(f"{noun} {made.name!r} is {state}, version {made.version}")
    if as_json:
        emit_json(document(noun, made))


def document(noun: str, found: Record) -> dict[str, Any]:
    """Returns one version of an item as JSON values."""
    told = asdict(found)
    links, files = told.pop("links"), told.pop("attachments")
    told["created"] = found.created.isoformat()
    told["links"] = [{"role": each["role"], **each["to"]} for each in links]
    told = {"noun": noun, **told, "files": list(files)}
    return {"simulated": provenance_of_record(found).simulated, **told}


def _condition(text: str) -> tuple[str, str | int]:
    field, equals, value = text.partition("=")
    if not equals:
        raise ConfigurationError(f"--where {text!r}, expected FIELD=VALUE.", hint="--where dof=6")
    if field in WHOLE:
        if not value.lstrip("-").isdigit():
            raise ConfigurationError(f"--where {text!r}, expected a whole number.")
        return field, int(value)
    return field, value


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def _time(at: datetime) -> str:
    return f"{at.astimezone():%Y-%m-%d %H:%M:%S}"
