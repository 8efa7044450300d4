"""Cut slots from two sides in the virtual cell, or evaluate measured steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult, Table
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import OUTPUT
from robotrue.core.provenance import Provenance, read_provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.validation.slot_test import DatumCheck, SlotEvaluation
    from robotrue_reproductions.feng2018.slot_trial import SlotTrial
    from robotrue_reproductions.feng2018.way_results import WayResult

VIRTUAL: Final = Provenance(simulated=True, instrument="virtual cell")


class SlotTestRequest(Request):
    """Measured steps, or the virtual cell that cuts them."""

    measured: Annotated[Path | None, InputFile(argument="[STEPS.csv]")] = None
    """Measured steps: slot,step_mm. None: simulate."""
    seed: int = 1
    """Seed of the virtual cell."""
    way: str = "calibrated"
    """Method compared with the paper's: calibrated, planned-30, per-side, ..."""
    output: Annotated[
        Path | None, Output(names=OUTPUT, what="a page", suffixes=(".html", ".htm"))
    ] = None
    """Page (.html) with the error per side."""
    across: str = "1,0,0"
    """Measured: direction of the step in the part, x,y,z."""
    first_abc_deg: str = "0,-90,-90"
    """Measured: KUKA A,B,C of the tool in the part, first side."""
    second_abc_deg: str = "0,-90,90"
    """Measured: the same, second side."""
    per_side: bool = False
    """Measured: each side had a separate frame or clamping."""


@operation()
def run(request: SlotTestRequest, context: Context) -> PlainResult:
    """Cuts the slots every way in one virtual cell, or evaluates steps that a gauge read.

    Raises:
        ConfigurationError: An invalid way, direction or attitude.
    """
    if request.measured is None:
        return _simulate(request, context)
    return _evaluate(request.measured, request)


def _simulate(request: SlotTestRequest, context: Context) -> PlainResult:
    from robotrue_reproductions.feng2018.slot_page import slot_page
    from robotrue_reproductions.feng2018.slot_trial import check_trial, run_slot_trial

    check_trial(request.seed, request.way)
    trial = run_slot_trial(request.seed, request.way, context.step)
    if request.output is not None:
        page = context.write(request.output, slot_page(trial))
        context.inform(f"page: {page}")
    datum = (
        ("block where it was", trial.rest.reason),
        ("block pushed by 1 mm", trial.knocked.reason),
    )
    return PlainResult(
        values=_trial_document(trial),
        shown=(
            _trial_table(trial),
            Facts(title="A datum that was not used for the frame, touched again", rows=datum),
            *_sight(trial.chosen.slots.evaluation),
        ),
        provenance=VIRTUAL,
    )


def _evaluate(path: Path, request: SlotTestRequest) -> PlainResult:
    from robotrue.core.rotations import matrix_from_abc
    from robotrue.measurement.formats.slot_steps import read_slot_steps
    from robotrue.validation.slot_test import SlotTest, evaluate_slots

    names, step = read_slot_steps(path)
    test = SlotTest(
        step=step,
        names=names,
        across=_three("--across", request.across),
        R_part_first=matrix_from_abc(_three("--first-abc-deg", request.first_abc_deg) * DEG),
        R_part_second=matrix_from_abc(_three("--second-abc-deg", request.second_abc_deg) * DEG),
        frames="one per side" if request.per_side else "shared",
    )
    found = evaluate_slots(test)
    return PlainResult(
        values={"source": path.name} | _document(found, names),
        shown=(Facts(title=f"Slot test {path.name}", rows=_facts(found, names)), *_sight(found)),
        provenance=read_provenance(path),
    )


def _facts(found: SlotEvaluation, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    import numpy as np

    low, high = found.interval / MM
    facts = [
        (f"slot {name}", f"{value / MM:+.3f} mm")
        for name, value in zip(names, found.slots, strict=True)
    ]
    facts.append(("mean size", f"{found.mismatch / MM:.3f} mm"))
    if np.isfinite(found.spread):
        facts.append(("sd between slots", f"{found.spread / MM:.3f} mm"))
        facts.append(("mean, 95 %", f"{found.mean / MM:+.3f} [{low:+.3f} {high:+.3f}] mm"))
    if np.isfinite(found.uneven):
        facts.append(("probability of such differences", f"{found.uneven:.3f}"))
    if np.isfinite(found.tip):
        facts.append(("tip that alone explains it", f"{found.tip / MM:+.3f} mm across the tool"))
    return tuple(facts)


def _three(name: str, text: str) -> Array:
    from robotrue.core.arrays import parse_number_list

    values = parse_number_list(text)
    if values.shape != (3,):
        raise ConfigurationError(f"{name} {text!r}, expected three numbers like 1,0,0.")
    return values


def _document(found: SlotEvaluation, names: Sequence[str]) -> dict[str, object]:
    return {
        "slots_mm": dict(zip(names, (found.slots / MM).tolist(), strict=True)),
        "mismatch_mm": found.mismatch / MM,
        "mean_mm": found.mean / MM,
        "sd_mm": found.spread / MM,
        "interval_mm": (found.interval / MM).tolist(),
        "uneven": found.uneven,
        "per_tip": found.per_tip.tolist(),
        "per_frame": found.per_frame,
        "tip_mm": found.tip / MM,
        "sees": list(found.sees),
        "blind": list(found.blind),
    }


def _trial_document(trial: SlotTrial) -> dict[str, object]:
    def way(t: WayResult) -> dict[str, object]:
        first, second = t.slots.side_rms
        return {
            "key": t.way.key,
            "name": t.way.name,
            **_document(t.slots.evaluation, t.slots.measured.names),
            "rms_mm": t.slots.rms / MM,
            "first_rms_mm": first / MM,
            "second_rms_mm": second / MM,
            "sculpture_mm": t.outline.mismatch / MM,
            "sculpture_worst_mm": t.outline.worst / MM,
        }

    def datum(check: DatumCheck) -> dict[str, object]:
        return {
            "verdict": check.verdict,
            "reason": check.reason,
            "distance_mm": dict(zip(check.names, (check.distance / MM).tolist(), strict=True)),
            "tolerance_mm": check.tolerance / MM,
            "resolution_mm": check.resolution / MM,
        }

    return {
        "seed": trial.seed,
        "chosen": trial.chosen.way.key,
        "ways": [way(t) for t in trial.results],
        "datum_at_rest": datum(trial.rest),
        "datum_knocked_1_mm": datum(trial.knocked),
    }


def _trial_table(trial: SlotTrial) -> Table:
    rows = tuple(
        (
            t.way.key,
            t.way.name,
            f"{t.slots.mismatch / MM:.3f}",
            f"{t.slots.evaluation.spread / MM:.3f}",
            *(f"{v / MM:.3f}" for v in t.slots.side_rms),
            f"{t.outline.mismatch / MM:.3f}",
        )
        for t in trial.results
    )
    return Table(
        title=f"slots cut from two sides, cell {trial.seed}, mm",
        columns=("way", "", "step", "sd of 4", "rms first", "rms second", "sculpture"),
        rows=rows,
    )


def _sight(found: SlotEvaluation) -> tuple[Facts, Facts]:
    """Returns what the steps can detect, and what they cannot."""
    return (
        Facts(title="Detected by the steps", rows=tuple(("", text) for text in found.sees)),
        Facts(title="Not detected by the steps", rows=tuple(("", text) for text in found.blind)),
    )
