"""``robotrue drill fit``, ``evaluate`` and ``report``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_json, emit_table, say, say_mark
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, UM
from robotrue.drilling.campaign import Campaign, reading_errors
from robotrue.drilling.campaign_checks import check_campaign
from robotrue.drilling.campaign_csv import read_campaign
from robotrue.drilling.choose import Trial
from robotrue.drilling.correction import Kind
from robotrue.drilling.evaluate import Residuals, TiltEvaluation, evaluate_test
from robotrue.drilling.foot_file import FootSetup, read_foot
from robotrue.drilling.foot_model import NormalModel, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.model_document import model_document
from robotrue.drilling.regression import LinearCorrection, fit_linear, significance
from robotrue.drilling.terms import conditions
from robotrue.errors import ConfigurationError

AUTO: Final = "auto"
ENOUGH: Final = 16
"""Clamps above which eight terms with interactions are shown beside another kind than patent."""
CLEAR: Final = 3.0
"""|t| from which a term is called significant."""


def run_fit(foot: Path, campaign: Path, output: Path, *, kind: str, as_json: bool) -> None:
    """Learns a model from a campaign and writes it."""
    check_output(output, [foot, campaign])
    wanted = kind_of(kind)
    setup = read_foot(foot)
    head = setup.head or Head(p_pivot_tip=np.full(3, np.nan))
    if setup.head is None:
        say("note: no [head] in the foot file: A carries B, and X, Y, Z of a move are not known.")
    data, digest = read_campaign(campaign, setup, head.order)
    check_campaign(setup.foot, data)
    model, trials = fit_model(setup.foot, head, data, kind=wanted, digest=digest)
    write_model(output, model)
    terms = terms_of(model, data)
    say_mark(model.provenance)
    if as_json:
        emit_json({"output": str(output), **model_document(model, trials), "terms": terms})
        return
    _show_trials(model, trials)
    _show_terms(terms, model)
    say(f"{model.kind} learned from {len(data)} clamps, written to {output}")


def run_evaluate(model_path: Path, test: Path, *, foot: Path | None, as_json: bool) -> None:
    """Says what one move leaves on clamps with known tilts."""
    model = read_model(model_path)
    data, _ = read_campaign(test, setup_of(model, model_path, foot), model.head.order)
    check_campaign(model.foot, data)
    result = evaluate_test(model, data)
    origin = merge([model.provenance, data.provenance])
    say_mark(origin)
    if as_json:
        emit_json(evaluation_document(result), origin)
        return
    rows = [("uncorrected", result.uncorrected)]
    rows += [("patent's regression", result.patent)] if result.patent is not None else []
    rows.append((f"ours ({model.kind})", result.ours))
    emit_table(
        f"Tilt left after one move, {result.clamps} clamps",
        ("", "mean deg", "p95 deg", "max deg"),
        [(name, *(f"{v / DEG:.4f}" for v in (r.mean, r.p95, r.largest))) for name, r in rows],
        provenance=origin,
    )
    say(f"{100.0 * result.covered:.0f} % of the true tilts lie in the model's 95 % regions")


def setup_of(model: NormalModel, path: Path, foot: Path | None) -> FootSetup:
    """Returns the setup readings are read with: the foot file's zero, the model's sensors."""
    if foot is None:
        return FootSetup(foot=model.foot, head=model.head, count=None, zero=None, source=str(path))
    stated = read_foot(foot)
    same = len(stated.foot.radius) == len(model.foot.radius) and np.allclose(
        stated.foot.seat, model.foot.seat, rtol=0.0, atol=1.0 * UM
    )
    if not same:
        raise ConfigurationError(
            f"the sensors of {foot.name} stand elsewhere than those the model was learned with.",
            source=foot,
            hint="pass the foot file of the campaign, or learn anew.",
        )
    return stated


def evaluation_document(result: TiltEvaluation) -> dict[str, Any]:
    """Returns an evaluation as JSON values."""
    return {
        "clamps": result.clamps,
        "uncorrected": residuals_document(result.uncorrected),
        "patent": None if result.patent is None else residuals_document(result.patent),
        "ours": residuals_document(result.ours),
        "covered_95": result.covered,
    }


def residuals_document(left: Residuals) -> dict[str, float]:
    """Returns residual tilts in degrees."""
    return {
        "mean_deg": left.mean / DEG,
        "p95_deg": left.p95 / DEG,
        "max_deg": left.largest / DEG,
    }


def kind_of(word: str) -> Kind | None:
    """Returns the correction a word means; None chooses by trials."""
    if word == AUTO:
        return None
    known: tuple[Kind, ...] = get_args(Kind)
    for kind in known:
        if word == kind:
            return kind
    raise ConfigurationError(
        f"--kind {word!r}, expected {AUTO}, {', '.join(known)}.", hint=f"--kind {AUTO}"
    )


def terms_of(model: NormalModel, data: Campaign) -> list[dict[str, Any]]:
    """Returns the significance of each term.

    The terms are the patent's five where the patent's regression was asked for or the clamps are
    few, and the eight with interactions otherwise.
    """
    if model.patent is None:
        return []
    causes = conditions(model.foot, data.order, data.clamps)
    fitted = model.patent
    if len(data) > ENOUGH and model.kind != "patent":
        fitted = fit_linear("interactions", causes, reading_errors(model.foot, data))
    if not isinstance(fitted, LinearCorrection):
        return []
    return [
        {
            "term": term.term,
            "coefficient_um": (term.coefficient / UM).tolist(),
            "deviation_um": (term.deviation / UM).tolist(),
            "t": term.t.tolist(),
            "significant": bool(np.max(np.abs(term.t)) > CLEAR),
        }
        for term in significance(fitted, causes)
    ]


def _show_trials(model: NormalModel, trials: tuple[Trial, ...]) -> None:
    rows = []
    for trial in trials:
        known = len(trial.residual) > 0
        rows.append(
            (
                trial.kind + (" (chosen)" if trial.kind == model.kind else ""),
                f"{trial.mean / DEG:.4f}" if known else "-",
                f"{np.percentile(trial.residual, 95.0) / DEG:.4f}" if known else trial.reason,
            )
        )
    emit_table(
        "Tilt left on forces and tilts held out",
        ("correction", "mean deg", "p95 deg"),
        rows,
        provenance=model.provenance,
    )


def _show_terms(terms: list[dict[str, Any]], model: NormalModel) -> None:
    if not terms:
        return
    emit_table(
        "Terms per sensor, um per unit (deg, kN, 100 mm)",
        ("term", "coefficient", "t", ""),
        [
            (
                term["term"],
                " ".join(f"{v:9.1f}" for v in term["coefficient_um"]),
                " ".join(f"{v:7.1f}" for v in term["t"]),
                "" if term["significant"] else "not significant",
            )
            for term in terms
        ],
        provenance=model.provenance,
    )


def run_report(
    model_path: Path,
    test: Path,
    output: Path,
    *,
    foot: Path | None,
    limit_deg: float,
    simulated: bool,
    lang: str,
    as_json: bool,
) -> None:
    """Writes the report of a model on clamps with known tilts, and its JSON twin."""
    from robotrue.app.reported import check_reports
    from robotrue.report.drilling_report import drilling_content
    from robotrue.report.report_files import write_reports
    from robotrue.report.words import language

    speech = language(lang)
    check_reports([output], [p for p in (model_path, test, foot) if p is not None])
    model = read_model(model_path)
    data, digest = read_campaign(test, setup_of(model, model_path, foot), model.head.order)
    check_campaign(model.foot, data)
    result = evaluate_test(model, data)
    content = drilling_content(
        model, data, result, digest=digest, limit=limit_deg * DEG, simulated=simulated, lang=speech
    )
    origin = replace(merge([model.provenance, data.provenance]), simulated=content.simulated)
    say_mark(origin)
    written = write_reports([output], content)
    say(f"report written to {', '.join(str(path) for path in written)}")
    if as_json:
        twin = str(written[-1])
        emit_json({"output": str(output), "json": twin, **evaluation_document(result)}, origin)
        return
    say(content.verdict.text)
