"""Learn what makes a foot's readings wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from robotrue.app.context import Context
from robotrue.app.drill_fields import ModelOutput
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block, Note, Table
from robotrue.app.request import ON_COMMAND_LINE, InputFile, Item, Option, Reference, Request
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG
from robotrue.drilling.drill_defaults import Kind
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.drilling.correction import Trial
    from robotrue.drilling.foot_model import NormalModel
    from robotrue.store.workspace import Transaction


class DrillFitRequest(Request):
    """Which campaign to learn from, and which correction."""

    foot: Annotated[
        Path | None,
        InputFile(argument="FOOT", needed_in=ON_COMMAND_LINE, help="Foot file (TOML)."),
    ] = None
    campaign: Annotated[
        Reference,
        Item(
            noun="document",
            argument="CAMPAIGN",
            help="Clamps with known tilts (CSV or workbook).",
        ),
    ]
    output: ModelOutput
    kind: Annotated[
        Literal["auto", Kind],
        Option(
            help="auto (what wins on held-out forces and tilts), patent, interactions, quadratic, "
            "cubic, gp or physics."
        ),
    ] = "auto"


@dataclass(frozen=True, slots=True, kw_only=True)
class FootLearned:
    """A model of a foot's readings.

    Attributes:
        model: What was learned.
        trials: Of the corrections it was chosen from.
        terms: Significance of each term, JSON values.
        clamps: Of the campaign.
        output: File of the model.
        provenance: Of the model.
    """

    model: NormalModel
    trials: tuple[Trial, ...]
    terms: Sequence[Mapping[str, Any]]
    clamps: int
    output: Path
    provenance: Provenance

    def document(self) -> Mapping[str, Any]:
        """Returns the model as JSON values in deg, mm and N."""
        from robotrue.drilling.evaluate import model_document

        numbers = model_document(self.model, self.trials)
        return {"output": str(self.output), **numbers, "terms": self.terms}

    def blocks(self) -> Iterable[Block]:
        """Returns the trials and the terms."""
        yield Table(
            title="Tilt left on forces and tilts held out",
            columns=("correction", "mean deg", "p95 deg"),
            rows=tuple(_trial_row(each, self.model.kind) for each in self.trials),
        )
        if self.terms:
            yield Table(
                title="Terms per sensor, um per unit (deg, kN, 100 mm)",
                columns=("term", "coefficient", "t", ""),
                rows=tuple(_term_row(each) for each in self.terms),
            )
        yield Note(f"{self.model.kind} learned from {self.clamps} clamps, written to {self.output}")


def _trial_row(trial: Trial, chosen: str) -> tuple[str, ...]:
    import numpy as np

    name = trial.kind + (" (chosen)" if trial.kind == chosen else "")
    if not len(trial.residual):
        return (name, "-", trial.reason)
    worst = np.percentile(trial.residual, 95.0)
    return (name, f"{trial.mean / DEG:.4f}", f"{worst / DEG:.4f}")


def _term_row(term: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        term["term"],
        " ".join(f"{v:9.1f}" for v in term["coefficient_um"]),
        " ".join(f"{v:7.1f}" for v in term["t"]),
        "" if term["significant"] else "not significant",
    )


def run(request: DrillFitRequest, context: Context) -> FootLearned:
    """Learns a model from a campaign and writes it.

    Raises:
        ConfigurationError: A campaign of a workspace without its foot file.
        ObservabilityError: No correction, or not that one, can be learned.
    """
    import numpy as np

    from robotrue.drilling.campaign import check_campaign
    from robotrue.drilling.campaign_csv import read_campaign
    from robotrue.drilling.drill_defaults import CAMPAIGN, campaign_parts
    from robotrue.drilling.evaluate import terms_of
    from robotrue.drilling.foot_file import read_foot
    from robotrue.drilling.foot_model import fit_model
    from robotrue.drilling.head import Head
    from robotrue.drilling.model_archive import write_model

    rows, beside = campaign_parts(context.document_files(request.campaign, CAMPAIGN))
    foot = request.foot or beside
    if foot is None:
        raise ConfigurationError(
            f"the campaign {context.name(request.campaign)!r} has no foot file.",
            hint="drop both together.",
        )
    setup = read_foot(foot)
    head = setup.head or Head(p_pivot_tip=np.full(3, np.nan))
    if setup.head is None:
        context.note(
            "no [head] in the foot file: A carries B, and X, Y, Z of a move are not known."
        )
    data, digest = read_campaign(rows, setup, head.order)
    check_campaign(setup.foot, data)
    wanted = None if request.kind == "auto" else request.kind
    model, trials = fit_model(setup.foot, head, data, kind=wanted, digest=digest, step=context.step)
    output = context.output(request.output)
    write_model(output, model)
    return FootLearned(
        model=model,
        trials=trials,
        terms=terms_of(model, data),
        clamps=len(data),
        output=output,
        provenance=model.provenance,
    )


def save(
    request: DrillFitRequest, result: FootLearned, into: Transaction, context: WorkspaceContext
) -> Mapping[str, Any]:
    """Leaves a document ``drilling model`` with the trials it was chosen by."""
    from robotrue.core.json_values import json_values
    from robotrue.drilling.drill_defaults import CAMPAIGN, MODEL
    from robotrue.store.records import Link

    record = context.document(request.campaign, CAMPAIGN)
    numbers = {k: v for k, v in result.document().items() if k != "output"}
    detail = json_values({**numbers, "clamps": result.clamps})
    links = [Link(role="data", to=record.ref)]
    return context.leave_document(into, MODEL, record.name, [result.output], links, detail)


OPERATION: Final = Operation(request=DrillFitRequest, run=run, save=save)
