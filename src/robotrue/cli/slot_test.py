"""``robotrue slot-test``: slots cut from two sides, in the virtual cell or as a gauge read them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_facts, emit_json, emit_table, progress, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.number_list import parse_number_list
from robotrue.core.provenance import Provenance, read_provenance
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.slot_steps import read_slot_steps
from robotrue.validation.datum_check import DatumCheck
from robotrue.validation.slot_test import Frames, SlotEvaluation, SlotTest, evaluate_slots
from robotrue_reproductions.feng2018.slot_page import slot_page
from robotrue_reproductions.feng2018.slot_trial import SlotTrial, check_trial, run_slot_trial
from robotrue_reproductions.feng2018.way_results import WayResult

VIRTUAL: Final = Provenance(simulated=True, instrument="virtual cell")


def run_simulated(*, seed: int, way: str, output: Path | None, as_json: bool) -> None:
    """Cuts the slots every way in one virtual cell; a table, JSON, or a page."""
    check_trial(seed, way)
    if output is not None:
        check_output(output, [])
    with progress() as bar:
        trial = run_slot_trial(seed, way, bar)
    if output is not None:
        write_atomic(output, slot_page(trial).encode())
        say(f"page: {output}")
    if as_json:
        emit_json(_simulated_document(trial), VIRTUAL)
        return
    say_mark(VIRTUAL)
    _tell(trial)


def run_measured(
    path: Path, *, across: str, first: str, second: str, per_side: bool, as_json: bool
) -> None:
    """Evaluates steps that a gauge read."""
    names, step = read_slot_steps(path)
    frames: Frames = "one per side" if per_side else "shared"
    test = SlotTest(
        step=step,
        names=names,
        across=_three("--across", across),
        R_part_first=matrix_from_abc(_three("--first-abc-deg", first) * DEG),
        R_part_second=matrix_from_abc(_three("--second-abc-deg", second) * DEG),
        frames=frames,
    )
    found = evaluate_slots(test)
    origin = read_provenance(path)
    say_mark(origin)
    if as_json:
        emit_json({"source": path.name} | _document(found, names), origin)
        return
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
        facts.append(("chance that slots differ so", f"{found.uneven:.3f}"))
    if np.isfinite(found.tip):
        facts.append(("tip that alone explains it", f"{found.tip / MM:+.3f} mm across the tool"))
    emit_facts(f"Slot test {path.name}", facts, origin)
    _tell_sight(found, origin)


def _three(name: str, text: str) -> Array:
    values = parse_number_list(text)
    if values.shape != (3,):
        raise ConfigurationError(f"{name} {text!r}, expected three numbers like 1,0,0.")
    return values


def _document(found: SlotEvaluation, names: Sequence[str]) -> dict[str, Any]:
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


def _simulated_document(trial: SlotTrial) -> dict[str, Any]:
    def way(t: WayResult) -> dict[str, Any]:
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

    def datum(check: DatumCheck) -> dict[str, Any]:
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


def _tell(trial: SlotTrial) -> None:
    rows = [
        (
            t.way.key,
            t.way.name,
            f"{t.slots.mismatch / MM:.3f}",
            f"{t.slots.evaluation.spread / MM:.3f}",
            *(f"{v / MM:.3f}" for v in t.slots.side_rms),
            f"{t.outline.mismatch / MM:.3f}",
        )
        for t in trial.results
    ]
    columns = ("way", "", "step", "sd of 4", "rms first", "rms second", "sculpture")
    title = f"slots cut from two sides, cell {trial.seed}, mm"
    emit_table(title, columns, rows, provenance=VIRTUAL)
    emit_facts(
        "A datum that was not used for the frame, touched again",
        [("block where it was", trial.rest.reason), ("block pushed by 1 mm", trial.knocked.reason)],
        VIRTUAL,
    )
    _tell_sight(trial.chosen.slots.evaluation, VIRTUAL)


def _tell_sight(found: SlotEvaluation, origin: Provenance) -> None:
    emit_facts("The steps see", [("", text) for text in found.sees], origin)
    emit_facts("The steps do not see", [("", text) for text in found.blind], origin)
