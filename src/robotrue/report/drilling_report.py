"""The report of a drilling model: what one move leaves, what it knows, what it was tested on."""

from __future__ import annotations

import numpy as np

from robotrue.core.files import DEFAULT_LANG
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.evaluate import TiltEvaluation
from robotrue.drilling.foot_model import NormalModel, Residuals
from robotrue.report.content import Conclusion, Fact, KeyFigure, ReportContent, ReportTable, Section
from robotrue.report.curve_plots import TiltPlot
from robotrue.report.labels import column, columns, fact, tile, versions
from robotrue.report.words import Lang, ReportTexts


def drilling_content(
    model: NormalModel,
    test: Campaign,
    result: TiltEvaluation,
    *,
    digest: str,
    limit: float,
    simulated: bool = False,
    lang: Lang = DEFAULT_LANG,
) -> ReportContent:
    """Returns the report of a model on clamps it was not learned from.

    Args:
        model: The model.
        test: The clamps.
        result: Residual tilts of the test.
        digest: SHA-256 of the test's file.
        limit: rad, required 95th percentile.
        simulated: Whether the test is simulated; also set by the provenance of model and test.
        lang: Language of the report.
    """
    t = ReportTexts(lang=lang)
    ours = result.ours
    good = ours.p95 <= limit
    return ReportContent(
        title=t("drill.title"),
        subtitle=t("drill.subtitle", kind=model.kind, version=model.version),
        simulated=simulated or merge([model.provenance, test.provenance]).simulated,
        verdict=Conclusion(
            tone="good" if good else "bad",
            text=t("drill.verdict", mean=ours.mean / DEG, p95=ours.p95 / DEG, n=result.clamps),
            detail=t("drill.within" if good else "drill.not_within", limit=limit / DEG),
        ),
        tiles=_tiles(result, t),
        sections=(
            Section(
                title=t("drill.left"),
                blocks=(
                    TiltPlot(
                        before=result.before,
                        after=result.left,
                        force=test.clamps.force,
                        tilt=np.hypot(*test.tilt.T),
                        limit=limit,
                        title=t("drill.plot"),
                        caption=t("drill.plot_text"),
                    ),
                    _residuals(model, result, t),
                ),
            ),
            Section(title=t("drill.covers"), blocks=(_envelope(model, t),)),
        ),
        unseen=(t("drill.unseen_zero"), t("drill.unseen_friction")),
        doubts=_doubts(model, result, t),
        provenance=(*_facts(model, digest, t), *versions()),
        lang=lang,
    )


def _tiles(result: TiltEvaluation, t: ReportTexts) -> tuple[KeyFigure, ...]:
    pairs = (
        ("drill.mean", result.ours.mean, result.uncorrected.mean),
        ("drill.p95", result.ours.p95, result.uncorrected.p95),
    )
    note = t("drill.region_note")
    return (
        *(tile(t, key, a / DEG, "deg", digits=4, before=b / DEG) for key, a, b in pairs),
        tile(t, "drill.region", 100.0 * result.covered, "%", digits=0, note=note),
    )


def _residuals(model: NormalModel, result: TiltEvaluation, t: ReportTexts) -> ReportTable:
    rows: list[tuple[str, Residuals]] = [(t("drill.as_is"), result.uncorrected)]
    if result.patent is not None:
        rows.append((t("drill.linear"), result.patent))
    rows.append((t("drill.model", kind=model.kind), result.ours))
    return ReportTable(
        title=t("drill.corrected"),
        columns=(
            column(t, "drill.correction"),
            *columns(t, "mean", "p95", "drill.largest", unit="deg", digits=4),
        ),
        rows=tuple((name, r.mean / DEG, r.p95 / DEG, r.largest / DEG) for name, r in rows),
        highlight=len(rows) - 1,
    )


def _envelope(model: NormalModel, t: ReportTexts) -> ReportTable:
    e = model.envelope
    return ReportTable(
        title=t("drill.campaign"),
        columns=(
            column(t, "drill.cause"),
            *columns(t, "drill.from", "drill.to", digits=1),
        ),
        rows=(
            (t("drill.force"), float(e.force[0]), float(e.force[1])),
            (t("drill.height"), float(e.height[0] / MM), float(e.height[1] / MM)),
            (t("drill.tilt"), 0.0, e.tilt / DEG),
        ),
        caption=t("drill.envelope"),
    )


def _doubts(model: NormalModel, result: TiltEvaluation, t: ReportTexts) -> tuple[str, ...]:
    doubts = []
    if result.covered < 0.9:
        doubts.append(t("drill.doubt_region", share=100.0 * result.covered))
    if result.ours.mean > 2.0 * model.left:
        doubts.append(t("drill.doubt_test", left=model.left / DEG))
    if model.patent is not None and result.patent is not None:
        if result.patent.mean < result.ours.mean:
            doubts.append(t("drill.doubt_linear"))
    return tuple(doubts)


def _facts(model: NormalModel, digest: str, t: ReportTexts) -> tuple[Fact, ...]:
    truths = ", ".join(model.refinement.truths) or t("fact.no_reference")
    facts = [
        fact(t, "fact.campaign", model.campaign),
        fact(t, "fact.clamps", digest),
        fact(
            t,
            "fact.refined",
            t("fact.records", n=model.refinement.records, truths=truths),
        ),
    ]
    if model.frozen is not None:
        facts.append(
            fact(
                t,
                "fact.frozen",
                version=model.frozen.version,
                value=t(
                    "fact.frozen_value",
                    p95=model.frozen.p95 / DEG,
                    n=model.frozen.clamps,
                    tested=model.frozen.tested_on,
                ),
            )
        )
    return tuple(facts)
