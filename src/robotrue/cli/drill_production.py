"""``robotrue drill plan`` and ``refine``: the sheet of a campaign, the life of its model."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import count, emit_json, say, say_mark
from robotrue.cli.drill import residuals_document, setup_of
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign_csv import (
    ProductionRecord,
    read_campaign,
    read_production,
    write_sheet,
)
from robotrue.drilling.campaign_plan import By, planned_campaign
from robotrue.drilling.correction import correct_readings
from robotrue.drilling.evaluate import Residuals
from robotrue.drilling.foot_file import read_foot
from robotrue.drilling.foot_model import NormalModel, with_refinement
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.production import frozen, record_of, update_model
from robotrue.errors import ConfigurationError


def run_plan(
    foot: Path,
    output: Path,
    *,
    clamps: int,
    forces_N: str,
    z_mm: str,
    tilt_deg: float,
    by: str,
    seed: int,
    as_json: bool,
) -> None:
    """Writes the execution sheet of a campaign."""
    check_output(output, [foot])
    setup = read_foot(foot)
    known: tuple[By, ...] = get_args(By)
    if by not in known:
        raise ConfigurationError(
            f"--by {by!r}, expected {' or '.join(known)}.", hint=f"--by {known[-1]}"
        )
    if tilt_deg * DEG > setup.foot.max_tilt:
        raise ConfigurationError(
            f"--tilt-deg {tilt_deg:g}, the foot follows up to {setup.foot.max_tilt / DEG:g} deg.",
            hint="a smaller tilt, or max_tilt_deg of the foot.",
        )
    plan = planned_campaign(
        clamps,
        forces=_list(forces_N, "--forces-n"),
        heights=_list(z_mm, "--z-mm") * MM,
        largest=tilt_deg * DEG,
        seed=seed,
        by="chance" if by == "chance" else "information",
    )
    write_sheet(output, plan, len(setup.foot.radius))
    if as_json:
        emit_json({"output": str(output), "clamps": len(plan), "by": by, "seed": seed})
        return
    say(f"{count(len(plan), 'clamp')} planned by {by}, written to {output}")
    say(
        "Turn the head to a_deg, b_deg off the calibration plane, bring the foot down out of its "
        "rest position every time, clamp, and fill in the readings less their zero."
    )


def run_refine(
    model_path: Path,
    records: Path | None,
    output: Path,
    *,
    truth: str,
    sigma_deg: float,
    freeze: Path | None,
    allowed_deg: float,
    foot: Path | None,
    as_json: bool,
) -> None:
    """Takes what a reference measured after holes into a model, and freezes it on request."""
    check_output(output, [p for p in (model_path, records, freeze, foot) if p is not None])
    if not sigma_deg > 0.0 or not allowed_deg > 0.0:
        raise ConfigurationError("--sigma-deg and --allowed-deg are above 0 deg.")
    model = read_model(model_path)
    setup = setup_of(model, model_path, foot)
    before, holes = model, 0
    alarms: list[dict[str, Any]] = []
    if records is not None:
        production = read_production(records, setup)
        holes = len(production.hole)
        model, alarms = _refined(model, production, truth, sigma_deg * DEG)
    elif freeze is None:
        raise ConfigurationError(
            "no RECORDS to refine the model by, and no --freeze.", hint="RECORDS, or --freeze TEST."
        )
    if freeze is not None:
        test, digest = read_campaign(freeze, setup, model.head.order)
        model = frozen(model, test, digest, allowed=allowed_deg * DEG, before=before)
    write_model(output, model)
    say_mark(model.provenance)
    if as_json:
        emit_json(_document(output, before, model, holes, alarms), model.provenance)
        return
    if records is not None:
        say(f"{count(holes, 'record')} of {truth}, {count(len(alarms), 'alarm')}")
    say(_said(model) + f", written to {output}")


def _refined(
    before: NormalModel, holes: ProductionRecord, truth: str, reference: float
) -> tuple[NormalModel, list[dict[str, Any]]]:
    """The model after holes that it moved all of, and the alarms of its watch."""
    model = before
    alarms: list[dict[str, Any]] = []
    plain = correct_readings(before.foot, before.head.order, before.correction, holes.clamps)
    moved = with_refinement(before, plain).tilt
    for i, name in enumerate(holes.hole):
        found = with_refinement(model, plain.row(i))
        record = record_of(name, found, holes.left[i], truth, holes.provenance, moved=moved[i])
        step = update_model(model, found, record, reference=reference)
        model = step.model
        if step.alarm:
            alarms.append({"hole": name, "shift_deg": (step.shift / DEG).tolist()})
            say(f"ALARM: {step.said}")
    return model, alarms


def _document(
    output: Path, before: NormalModel, after: NormalModel, records: int, alarms: list[Any]
) -> dict[str, Any]:
    kept = after.frozen
    return {
        "output": str(output),
        "records": records,
        "alarms": alarms,
        "version_before": before.version,
        "version": after.version,
        "refinement": {
            "records": after.refinement.records,
            "truths": list(after.refinement.truths),
            "constant_deg": (after.refinement.coefficients[0] / DEG).tolist(),
        },
        "frozen": None
        if kept is None
        else {
            "version": kept.version,
            "tested_on_sha256": kept.tested_on,
            "clamps": kept.clamps,
            **residuals_document(Residuals(mean=kept.mean, p95=kept.p95, largest=kept.largest)),
        },
    }


def _said(model: NormalModel) -> str:
    if model.frozen is None:
        return f"version {model.version}, refined by {count(model.refinement.records, 'record')}"
    kept = model.frozen
    return (
        f"frozen as {kept.version}: {kept.clamps} clamps within {kept.p95 / DEG:.4f} deg (95 %), "
        f"{kept.largest / DEG:.4f} deg at most"
    )


def _list(text: str, option: str) -> Any:
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all():
        raise ConfigurationError(
            f"{option} {text!r}, expected numbers with commas between.", hint=f"{option} 0,250,500"
        )
    return values
