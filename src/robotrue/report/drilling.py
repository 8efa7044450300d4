"""The report of a drilling model: what one move leaves, what it knows, what it was tested on."""

from __future__ import annotations

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.evaluate import Evaluation, Residuals
from robotrue.drilling.model import NormalModel
from robotrue.report.content import (
    Column,
    Fact,
    ReportContent,
    Section,
    Table,
    Tile,
    Verdict,
)
from robotrue.report.tilt_plot import TiltPlot


def drilling_content(
    model: NormalModel,
    test: Campaign,
    result: Evaluation,
    *,
    digest: str,
    limit: float,
    simulated: bool = False,
) -> ReportContent:
    """Returns the report of a model on clamps it was not learned from.

    Args:
        model: The model.
        test: The clamps.
        result: What it left there.
        digest: SHA-256 of the test's file.
        limit: rad, 95th percentile that is asked for.
        simulated: Whether the test is.
    """
    ours = result.ours
    good = ours.p95 <= limit
    return ReportContent(
        title="Drilling normal",
        subtitle=f"correction {model.kind}, version {model.version}",
        simulated=simulated,
        verdict=Verdict(
            tone="good" if good else "bad",
            text=f"One move leaves {ours.mean / DEG:.4f} deg in the mean, "
            f"{ours.p95 / DEG:.4f} deg for 95 % of {result.clamps} clamps.",
            detail=f"{'Within' if good else 'Not within'} the {limit / DEG:g} deg asked for.",
        ),
        tiles=_tiles(result),
        sections=(
            Section(
                title="What is left",
                blocks=(
                    TiltPlot(
                        before=result.before,
                        after=result.left,
                        force=test.clamps.force,
                        tilt=np.hypot(*test.tilt.T),
                        limit=limit,
                        caption="Before: readings as they are. After: by the model. Right: where "
                        "the spindle points beside the true normal.",
                    ),
                    _residuals(model, result),
                ),
            ),
            Section(title="What the model covers", blocks=(_envelope(model),)),
        ),
        unseen=(
            "A shift of the foot's zero since the campaign: only an outside reference sees it.",
            "Friction after an approach the campaign does not hold.",
        ),
        doubts=_doubts(model, result),
        provenance=_facts(model, digest),
    )


def _tiles(result: Evaluation) -> tuple[Tile, ...]:
    ours, before = result.ours, result.uncorrected
    return (
        Tile(
            label="mean tilt left",
            value=ours.mean / DEG,
            unit="deg",
            digits=4,
            before=before.mean / DEG,
        ),
        Tile(
            label="95 % of holes within",
            value=ours.p95 / DEG,
            unit="deg",
            digits=4,
            before=before.p95 / DEG,
        ),
        Tile(
            label="in the 95 % region",
            value=100.0 * result.covered,
            unit="%",
            digits=0,
            note="true tilts in the model's own regions",
        ),
    )


def _residuals(model: NormalModel, result: Evaluation) -> Table:
    rows: list[tuple[str, Residuals]] = [("as they are", result.uncorrected)]
    if result.patent is not None:
        rows.append(("linear regression", result.patent))
    rows.append((f"the model ({model.kind})", result.ours))
    return Table(
        title="Readings corrected by",
        columns=(
            Column(title="correction"),
            Column(title="mean", unit="deg", digits=4),
            Column(title="95 %", unit="deg", digits=4),
            Column(title="largest", unit="deg", digits=4),
        ),
        rows=tuple((name, r.mean / DEG, r.p95 / DEG, r.largest / DEG) for name, r in rows),
        highlight=len(rows) - 1,
    )


def _envelope(model: NormalModel) -> Table:
    e = model.envelope
    return Table(
        title="Campaign",
        columns=(
            Column(title="cause"),
            Column(title="from", digits=1),
            Column(title="to", digits=1),
        ),
        rows=(
            ("clamp force, N", float(e.force[0]), float(e.force[1])),
            ("height, mm", float(e.height[0] / MM), float(e.height[1] / MM)),
            ("tilt, deg", 0.0, e.tilt / DEG),
        ),
        caption="A clamp force or a tilt outside is refused, a height outside is told.",
    )


def _doubts(model: NormalModel, result: Evaluation) -> tuple[str, ...]:
    doubts = []
    if result.covered < 0.9:
        doubts.append(
            f"Only {100.0 * result.covered:.0f} % of the true tilts lie in the 95 % regions: the "
            "stated uncertainty is too small here."
        )
    if result.ours.mean > 2.0 * model.left:
        doubts.append(
            f"The test is worse than the held-out campaign ({model.left / DEG:.4f} deg): something "
            "has changed since."
        )
    if model.patent is not None and result.patent is not None:
        if result.patent.mean < result.ours.mean:
            doubts.append("The plain linear regression does better on this test.")
    return tuple(doubts)


def _facts(model: NormalModel, digest: str) -> tuple[Fact, ...]:
    facts = [
        Fact(name="campaign", value=model.campaign),
        Fact(name="test", value=digest),
        Fact(
            name="refined by",
            value=f"{model.refinement.records} records of "
            f"{', '.join(model.refinement.truths) or 'no reference'}",
        ),
    ]
    if model.frozen is not None:
        facts.append(
            Fact(
                name=f"frozen as {model.frozen.version}",
                value=f"95 % within {model.frozen.p95 / DEG:.4f} deg on {model.frozen.clamps} "
                f"clamps, {model.frozen.tested_on}",
            )
        )
    return tuple(facts)
