"""Learn the errors of a foot's readings from a campaign."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, Table
from robotrue.app.request import NOT_IN_FORMS, ON_COMMAND_LINE, InputFile, Item, Reference, Request
from robotrue.app.request_fields import FootModelOutput
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG
from robotrue.drilling.drill_defaults import (
    CAMPAIGN,
    CORRECTS,
    MACHINE_INPUTS,
    MODEL,
    Corrects,
    Inputs,
    Kind,
    campaign_parts,
)
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.drilling.correction_trials import Trial
    from robotrue.drilling.foot_model import NormalModel
    from robotrue.store.workspace import Transaction


class DrillFitRequest(Request):
    """Campaign to learn from, and the kind of correction."""

    foot: Annotated[
        Path | None, InputFile(argument="FOOT", shells=NOT_IN_FORMS, needed_in=ON_COMMAND_LINE)
    ] = None
    """Foot file (TOML)."""
    campaign: Annotated[Reference, Item(noun="document", argument="CAMPAIGN", sent=True)]
    """Clamps with known tilts (CSV or workbook)."""
    output: FootModelOutput
    kind: Literal["auto", Kind] = "auto"
    """auto (the best on held-out forces and tilts), patent, interactions, quadratic, cubic, gp
    or physics."""
    inputs: Inputs = MACHINE_INPUTS
    """Machine positions as inputs: auto (the best on held-out blocks), none, AB, XY or XYAB;
    columns X_mm, Y_mm, axis_A_deg, axis_B_deg."""
    corrects: Corrects = CORRECTS
    """Corrected quantity: readings, or joints (the targets of A and B)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FootLearned:
    """A model of a foot's readings.

    Attributes:
        model: What was learned.
        trials: Of the corrections it was chosen from.
        input_trials: Of the machine positions that were tried as causes.
        terms: Significance of each term, JSON values.
        clamps: Of the campaign.
        output: File of the model.
        provenance: Of the model.
    """

    model: NormalModel
    trials: tuple[Trial, ...]
    input_trials: tuple[Trial, ...]
    terms: Sequence[Mapping[str, object]]
    clamps: int
    output: Path
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns the model as JSON values in deg, mm and N."""
        from robotrue.drilling.evaluate import model_document, trial_document

        numbers = model_document(self.model, self.trials)
        tried = [{"inputs": [*t.inputs], **trial_document(t)} for t in self.input_trials]
        return {
            "output": str(self.output),
            **numbers,
            "input_trials": tried,
            "terms": self.terms,
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the trials and the terms."""
        used = self.model.correction.inputs
        if self.input_trials:
            named = tuple(
                (t, "".join(t.inputs) or "none", t.inputs == used) for t in self.input_trials
            )
            yield Table(
                title="Machine positions as causes: residual tilt on held-out blocks",
                columns=("inputs", "mean deg", "p95 deg"),
                rows=tuple(_trial_row(*each) for each in named),
            )
        yield Table(
            title="Residual tilt on held-out forces and tilts",
            columns=("correction", "mean deg", "p95 deg"),
            rows=tuple(_trial_row(t, t.kind, t.kind == self.model.kind) for t in self.trials),
        )
        if self.terms:
            yield self._terms_table()
        beside = f" with {', '.join(used)}" if used else ""
        of = "targets of A and B" if self.model.correction.corrects == "joints" else "readings"
        yield Note(
            f"{self.model.kind}{beside} learned from {self.clamps} clamps, corrects the {of}, "
            f"written to {self.output}"
        )

    def _terms_table(self) -> Table:
        unit, of = ("um", "sensor")
        if self.model.correction.corrects == "joints":
            unit, of = ("deg", "axis")
        what = "The patent's weights" if self.model.kind == "patent" else "Terms"
        return Table(
            title=f"{what} per {of}, {unit} per unit (deg, kN, 100 mm; X, Y m; A, B 10 deg)",
            columns=("term", "coefficient", "deviation", "t", ""),
            rows=tuple(_term_row(each, unit) for each in self.terms),
        )


def _trial_row(trial: Trial, name: str, chosen: bool) -> tuple[str, ...]:
    import numpy as np

    name += " (chosen)" if chosen else ""
    if not len(trial.residual):
        return (name, "-", trial.reason)
    worst = np.percentile(trial.residual, 95.0)
    return (name, f"{trial.mean / DEG:.4f}", f"{worst / DEG:.4f}")


def _term_row(term: Mapping[str, Any], unit: str) -> tuple[str, ...]:
    digits = "9.1f" if unit == "um" else "9.5f"
    return (
        term["term"],
        " ".join(f"{v:{digits}}" for v in term[f"coefficient_{unit}"]),
        " ".join(f"{v:{digits}}" for v in term[f"deviation_{unit}"]),
        " ".join(f"{v:7.1f}" for v in term["t"]),
        "" if term["significant"] else "not significant",
    )


@operation()
def run(request: DrillFitRequest, context: Context) -> FootLearned:
    """Learns a model from a campaign and writes it.

    Raises:
        ConfigurationError: A campaign of a workspace without its foot file.
        ObservabilityError: No correction, or not that one, can be learned.
    """
    import numpy as np

    from robotrue.drilling.campaign_checks import campaign_warnings, check_campaign, check_head
    from robotrue.drilling.campaign_csv import read_campaign
    from robotrue.drilling.correction_trials import resolve_inputs
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
        context.note("no [head] in the foot file: A carries B, and X, Y, Z of a move are unknown.")
    data, digest = read_campaign(rows, setup, head.order)
    check_campaign(setup.foot, data)
    check_head(head, data)
    for warning in campaign_warnings(setup.foot, data):
        context.note(warning)
    wanted = None if request.kind == "auto" else request.kind
    used, tried = resolve_inputs(request.inputs, setup.foot, data, corrects=request.corrects)
    model, trials = fit_model(
        setup.foot,
        head,
        data,
        kind=wanted,
        inputs=used,
        corrects=request.corrects,
        digest=digest,
        zero=setup.taken_zero,
        step=context.step,
    )
    output = context.output(request.output)
    write_model(output, model)
    return FootLearned(
        model=model,
        trials=trials,
        input_trials=tried,
        terms=terms_of(model, data),
        clamps=len(data),
        output=output,
        provenance=model.provenance,
    )


@run.saves
def save(
    request: DrillFitRequest, result: FootLearned, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a document ``drilling model`` with the trials it was chosen by."""
    from robotrue.core.json_values import json_values
    from robotrue.store.records import Link

    record = context.keep_document(into, request.campaign, CAMPAIGN, request.foot)
    numbers = {k: v for k, v in result.document().items() if k != "output"}
    detail = json_values({**numbers, "clamps": result.clamps})
    links = [Link(role="data", to=record.ref)]
    return context.leave_document(into, MODEL, record.name, [result.output], links, detail)
