"""Tools: every operation with a page made from its request, or the reason why it has none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Final

from robotrue.app.job_files import BLOCKS, INPUT, job_fields, takes_files
from robotrue.app.operation import AnyOperation
from robotrue.app.registry import GROUPS, Listing, job_operations, listings, why_no_job
from robotrue.app.request import Item
from robotrue.errors import ConfigurationError
from robotrue.store import items, jobs
from robotrue.store.nouns import DOCUMENT, NOUNS, DocumentRecord
from robotrue.store.records import ItemQuery, ItemRecord, Ref, provenance_of_record
from robotrue.web.page_context import PageContext, Screen
from robotrue.web.pages.history_screen import PAGES_OF
from robotrue.web.parts.generated_form import GeneratedForm, field_words
from robotrue.web.parts.request_form import name_options
from robotrue.web.problems import fault_card, kind_words

OFFERED: Final = 50
"""Items to choose from, the newest."""
RUNS: Final = 20
FILES: Final = ("cell", "model", "measurement", "program", "registration")
"""Nouns whose files can be read besides those of documents."""
TONES: Final[Mapping[str, str]] = {"done": "good", "failed": "bad", "cancelled": "caution"}


async def _build(context: PageContext) -> str:
    name = context.query.get("operation")
    if name is None:
        return context.render("tools.html", groups=list(_groups(context)))
    listing = next((each for each in listings() if each.name == name), None)
    if listing is None or name not in job_operations():
        raise ConfigurationError(f"no page is made of the operation {name[:60]!r}.")
    if "job" in context.query:
        return await _show_run(context, listing, context.query["job"])
    return await _show_form(context, listing)


def _groups(
    context: PageContext,
) -> Iterator[tuple[str, str, list[tuple[Listing, str, tuple[Screen, ...]]]]]:
    """Heading and help of each group, and of its operations why they have no page, and others."""
    for group in ("", *GROUPS):
        rows = [
            (each, why_no_job(each), _own_pages(context, each.name))
            for each in listings()
            if each.group == group
        ]
        if rows:
            title = context.say(f"tools.group_{group}" if group else "tools.general")
            yield title, GROUPS.get(group, ""), rows


def _own_pages(context: PageContext, name: str) -> tuple[Screen, ...]:
    return tuple(each for each in context.screens if name in each.operations)


async def _show_form(context: PageContext, listing: Listing) -> str:
    name, operation = listing.name, job_operations()[listing.name]
    found = (await context.ask(jobs.search, context.workspace, kind=name, limit=RUNS)).items
    return context.render(
        "tool.html",
        name=name,
        title=listing.words,
        help=listing.help,
        pages=_own_pages(context, name),
        jobs=await context.jobs(name),
        form=await _form(context, operation, await _read_parameters(context, name)),
        runs=[(each, await _document(context, each)) for each in found if each.over],
        tones=TONES,
    )


async def _read_parameters(context: PageContext, kind: str) -> Mapping[str, object]:
    """The parameters of the job that is to be done again with other values."""
    id = context.query.get("again")
    if id is None:
        return {}
    job = await context.ask(jobs.status, context.workspace, id)
    return job.parameters if job.kind == kind else {}


async def _form(
    context: PageContext, operation: AnyOperation, stated: Mapping[str, object]
) -> GeneratedForm:
    """The form with the items and files that its fields may refer to."""
    fields = job_fields(operation)
    entries = [each.entry for each in fields if isinstance(each.entry, Item)]
    nouns = {noun for each in entries for noun in (each.noun, *each.also)}
    records: dict[str, Sequence[ItemRecord]] = {
        noun: await context.items(NOUNS[noun], ItemQuery(limit=OFFERED)) for noun in sorted(nouns)
    }
    if DOCUMENT.name in records:
        records[DOCUMENT.name] = [
            each
            for each in records[DOCUMENT.name]
            if isinstance(each, DocumentRecord) and each.attachments and each.kind != INPUT
        ]
    reads = any(takes_files(each) for each in fields)
    return GeneratedForm(
        context=context,
        request=operation.request,
        group="tools",
        operation=operation,
        records=records,
        files=await _kept_files(context) if reads else {},
        stated=stated,
        chosen={} if context.model is None else {"model": context.model.id},
    )


async def _kept_files(context: PageContext) -> dict[str, Sequence[ItemRecord]]:
    """Items with files, by their heading; items without files are left out."""
    say, asked = context.say, ItemQuery(limit=OFFERED)
    sent = ItemQuery(where={"kind": INPUT}, limit=OFFERED)
    made = await context.items(DOCUMENT, asked)
    inputs = await context.items(DOCUMENT, sent)
    found: dict[str, Sequence[ItemRecord]] = {
        say("tools.kept_inputs"): inputs,
        say("tools.kept_results"): [each for each in made if each.kind != INPUT],
    }
    for noun in FILES:
        found[say.word("history.noun", noun)] = await context.items(NOUNS[noun], asked)
    with_files = {
        heading: [each for each in records if each.attachments]
        for heading, records in found.items()
    }
    return {heading: records for heading, records in with_files.items() if records}


async def _document(context: PageContext, job: jobs.Job) -> ItemRecord | None:
    """The document that a job left, with the blocks that it shows."""
    made = (job.result or {}).get("document")
    if not made:
        return None
    record = await context.item(DOCUMENT, made["id"])
    return record if BLOCKS in record.detail else None


async def _show_run(context: PageContext, listing: Listing, id: str) -> str:
    """One run: what it shows, its files, what it rests on, what it failed with."""
    job = await context.ask(jobs.status, context.workspace, id)
    if job.kind != listing.name:
        raise ConfigurationError(f"job {id[:8]!r} is of another kind, {job.kind}.")
    record, error, fault = await _document(context, job), job.error, ""
    fields, say = job_fields(job_operations()[job.kind]), partial(field_words, context.say)
    reword = partial(name_options, fields=fields, words=say)
    if error is not None:
        source = str(error.get("source") or "").rpartition("/")[2]
        line = f":{error['line']}" if error.get("line") else ""
        place = f"{source}{line}: " if source else ""
        kind = kind_words(error["kind"])
        fault = fault_card(
            context.say, kind, place + error["message"], str(reword(error.get("hint") or ""))
        )
    result = job.result or {}
    made = [each for each in result.values() if isinstance(each, Mapping)]
    left = [Ref(id=each["id"], version=each["version"]) for each in made if "version" in each]
    rests = [] if record is None else [each.to for each in record.links]
    shown = [
        (context.say("tools.left"), [] if record else await _find_linked(context, left)),
        (context.say("tools.rests"), await _find_linked(context, rests)),
    ]
    running = [each for each in await context.jobs(job.kind) if not each.over]
    return context.render(
        "tool_result.html",
        name=job.kind,
        title=listing.words,
        job=job,
        record=record,
        blocks=reword(result.get(BLOCKS, []) if record is None else record.detail[BLOCKS]),
        simulated=result.get("simulated") is True
        if record is None
        else provenance_of_record(record).simulated,
        jobs=running,
        fault=fault,
        remarks=reword(record.detail["remarks"] if record else job.remarks),
        linked=[(heading, rows) for heading, rows in shown if rows],
    )


async def _find_linked(
    context: PageContext, refs: Sequence[Ref]
) -> list[tuple[str, ItemRecord, str]]:
    """Noun, record and address of items; a document is replaced by its files."""
    found = []
    for ref in refs:
        noun, id = await context.ask(items.resolve, context.workspace, ref.id)
        record = await context.item(NOUNS[noun], id, ref.version)
        page = PAGES_OF.get(noun, "")
        found.append((noun, record, page and page + id))
    return found


BUILDS: Final = {"": _build}
