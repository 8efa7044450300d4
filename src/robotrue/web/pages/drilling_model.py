"""A foot's model on the page Drilling: which correction is to be trusted, and what tests say."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from nicegui import ui

from robotrue.store.nouns import DocumentRecord
from robotrue.web.bench import Bench
from robotrue.web.parts.drilling import DrillMonitor
from robotrue.web.parts.elements import Tile, delete_button, table, tag, tiles, when
from robotrue.web.parts.frame import html
from robotrue.web.parts.icons import icon
from robotrue.web.parts.naming import record_mark


def model_cards(
    bench: Bench,
    record: DocumentRecord,
    tests: Sequence[DocumentRecord],
    campaigns: Sequence[DocumentRecord],
    *,
    tolerance_deg: float,
) -> None:
    """Shows a model.

    Args:
        bench: Who looks.
        record: Its document.
        tests: Of it, the one to be shown first.
        campaigns: On which it may be judged, besides its own.
        tolerance_deg: What tilts left are judged against, unless the user says otherwise.
    """
    say, d = bench.say, record.detail
    mark = record_mark(say, record)
    html(
        f"<h2>{escape(record.name)}</h2>{mark}"
        f"<span class='note'>{when(record.created)}</span><div class='acts'>"
        f"{delete_button(say('frame.delete'), 'document', record.id, '/drilling?view=model')}"
        f"{_download(bench, record)}</div>"
    ).classes("head")
    html(_tiles(bench, d)).classes("tiles").props('data-testid="drill-model"')
    with ui.element("div").classes("columns even"):
        if d["trials"]:
            html(_trials(bench, d)).classes("card")
        if d["terms"]:
            html(_terms(bench, d)).classes("card")
    _tests(bench, record, tests, campaigns, tolerance_deg)


def _tiles(bench: Bench, d: Any) -> str:
    say, e = bench.say, d["envelope"]
    frozen = d.get("frozen")
    state = say("drilling.frozen", n=frozen["version"]) if frozen else say("drilling.learning")
    out = [
        Tile(label=say("drilling.trusted"), value=say(f"drilling.kind_{d['kind']}"), tone="good"),
        Tile(label=say("drilling.held_out"), value=f"{d['held_out_mean_deg']:.4f}", unit="deg"),
        Tile(
            label=say("drilling.force"),
            value=f"{e['force_N'][0]:.0f} … {e['force_N'][1]:.0f}",
            unit="N",
        ),
        Tile(label=say("drilling.tilt"), value=f"{e['tilt_deg']:.1f}", unit="deg"),
        Tile(label=state, value=f"v{d['version']}"),
    ]
    return tiles(out)


def _trials(bench: Bench, d: Any) -> str:
    say = bench.say
    rows = []
    for each in d["trials"]:
        known = each["held_out_p95_deg"] is not None
        rows.append(
            (
                escape(say(f"drilling.kind_{each['kind']}"))
                + (f" {tag(say('drilling.chosen'), 'good')}" if each["kind"] == d["kind"] else ""),
                f"{each['held_out_mean_deg']:.4f}" if known else "–",
                f"{each['held_out_p95_deg']:.4f}" if known else escape(each["reason"]),
            )
        )
    marks = ['class="chosen"' if e["kind"] == d["kind"] else "" for e in d["trials"]]
    columns = [
        say("drilling.correction"),
        f"{say('drilling.mean')} deg",
        f"{say('drilling.p95')} deg",
    ]
    return (
        f"<h2>{escape(say('drilling.trials'))}</h2>"
        f"{table(columns, rows, attributes=marks, mark='trials')}"
        f"<p class='note'>{escape(say('drilling.rule'))}</p>"
    )


def _terms(bench: Bench, d: Any) -> str:
    say = bench.say
    rows = [
        (
            f"<span class='mono'>{escape(each['term'])}</span>",
            *(f"{v:.1f}" for v in each["coefficient_um"]),
            f"{max(map(abs, each['t'])):.0f}",
            tag(say("drilling.matters"), "good") if each["significant"] else tag("–"),
        )
        for each in d["terms"]
    ]
    sensors = len(d["terms"][0]["coefficient_um"])
    columns = ["", *(f"d{k + 1} µm" for k in range(sensors)), "|t|", ""]
    return (
        f"<h2>{escape(say('drilling.terms'))}</h2>{table(columns, rows, mark='terms')}"
        f"<p class='note'>{escape(say('drilling.terms_note'))}</p>"
    )


def _tests(
    bench: Bench,
    record: DocumentRecord,
    tests: Sequence[DocumentRecord],
    campaigns: Sequence[DocumentRecord],
    tolerance_deg: float,
) -> None:
    say = bench.say
    others = [e for e in campaigns if e.detail.get("sha256") != record.detail["campaign_sha256"]]
    if others:
        options = "".join(f'<option value="{e.id}">{escape(e.name)}</option>' for e in others)
        form = (
            "<form class='drill-line' onsubmit=\"return bench.jobForm('drill_report',this)\" "
            f"data-testid='drill-judge'><input type='hidden' name='model' value='{record.id}'>"
            f"<input type='hidden' name='lang' value='{say.language}'>"
            f"<label class='field'>{escape(say('drilling.on'))}<select name='campaign'>{options}"
            f"</select></label><label class='field short'>{escape(say('drilling.tolerance'))}"
            f"<input type='number' name='limit_deg' min='0.0001' step='any' "
            f"value='{tolerance_deg:g}'></label>"
            f"<button class='act' data-testid='judge'>{escape(say('drilling.report'))}</button>"
            "</form>"
        )
    else:
        form = f"<p class='note'>{escape(say('drilling.no_test'))}</p>"
    html(f"<h2>{escape(say('drilling.tests'))}</h2>{form}{_listed(bench, tests)}").classes("card")
    if not tests:
        return
    first = tests[0].detail
    holes = [
        {"before": before, "left": left}
        for before, left in zip(first["before_deg"], first["left_deg"], strict=True)
    ]
    own = {
        name: say(f"drilling.test_{name}")
        for name in ("before", "before_note", "after", "after_note")
    }
    DrillMonitor(bench, tolerance_deg=float(first["limit_deg"]), holes=holes, texts=own)


def _listed(bench: Bench, tests: Sequence[DocumentRecord]) -> str:
    say = bench.say
    if not tests:
        return ""
    rows = []
    for each in tests:
        d = each.detail
        good = d["ours"]["p95_deg"] <= d["limit_deg"]
        page = next((f for f in each.files("file") if f.name.endswith(".html")), None)
        shown = (
            f'<a class="act quiet" target="_blank" data-testid="drill-report" '
            f'href="/reports/document/{each.id}/{page.sha256}">{escape(say("drilling.open"))}</a>'
            if page is not None
            else ""
        )
        linear = "–" if d["patent"] is None else f"{d['patent']['p95_deg']:.4f}"
        rows.append(
            (
                when(each.created),
                str(d["clamps"]),
                f"{d['uncorrected']['p95_deg']:.4f}",
                linear,
                f"<b>{d['ours']['p95_deg']:.4f}</b>",
                f"{100 * d['covered_95']:.0f} %",
                tag(say("drilling.state_within" if good else "drilling.state_beyond"),
                    "good" if good else "bad") + f" {d['limit_deg']:g}°",
                shown,
            )
        )  # fmt: skip
    columns = [
        say("drilling.taken"), say("drilling.clamps"), say("drilling.as_is"),
        say("drilling.kind_patent"), say("drilling.ours"), say("drilling.covered"), "", "",
    ]  # fmt: skip
    return (
        f"<p class='note' style='margin-top:12px'>{escape(say('drilling.p95_of'))}</p>"
        f"{table(columns, rows, words=(0, 6), mark='drill-tests')}"
    )


def _download(bench: Bench, record: DocumentRecord) -> str:
    return "".join(
        f'<a class="act quiet" data-testid="download" download '
        f'href="/api/items/document/{record.id}/files/{each.sha256}?version={record.version}">'
        f"{icon('download')}{escape(each.name)}</a>"
        for each in record.files("file")
    )
