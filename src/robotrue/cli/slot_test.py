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
from robotrue.core.provenance import Provenance, read_provenance
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.slot_steps import read_slot_steps
from robotrue.validation.datum_check import DatumCheck
from robotrue.validation.slot_test import Frames, SlotEvaluation, SlotTest, evaluate_slots
from robotrue_reproductions.feng2018.blind_spots import datums_touched, knocked, registered
from robotrue_reproductions.feng2018.registration_ways import Session
from robotrue_reproductions.feng2018.slot_experiment import cut_contour, cut_slots
from robotrue_reproductions.feng2018.slot_page import SlotPage, Tried, slot_page
from robotrue_reproductions.feng2018.way_results import WAYS, Way, calibrated_of, session_of

VIRTUAL: Final = Provenance(simulated=True, instrument="virtual cell")
PAPER: Final = "paper"
LONG: Final = "planned-90"
"""Planning its touches takes longer than all the rest; shown only when asked for."""


def run_simulated(*, seed: int, way: str, output: Path | None, as_json: bool) -> None:
    """Cuts the slots every way in one virtual cell; a table, JSON, or a page."""
    if way not in [w.key for w in WAYS]:
        raise ConfigurationError(f"no way {way!r}; ways are {', '.join(w.key for w in WAYS)}.")
    ways = [w for w in WAYS if w.key == way or w.key != LONG]
    keys = [w.key for w in ways]
    if seed < 0:
        raise ConfigurationError(f"seed {seed}, expected 0 or more.")
    if output is not None:
        check_output(output, [])
    sessions: dict[str, Session] = {}
    tried = []
    with progress() as bar:
        for k, one in enumerate(ways):
            bar(one.name, k, len(ways))
            if one.cell not in sessions:
                sessions[one.cell] = session_of(one.cell, seed)
            tried.append(_tried(one, sessions[one.cell], seed))
    plain = sessions["plain"]
    model = calibrated_of(plain)
    frame = registered(model, plain)
    rng = np.random.default_rng([seed, 59])
    pushed = knocked(plain.cell, rng)
    page = SlotPage(
        seed=seed,
        tried=tuple(tried),
        paper=tried[keys.index(PAPER)],
        chosen=tried[keys.index(way)],
        rest=datums_touched(plain.cell, model, frame, rng),
        knocked=datums_touched(pushed, model, frame, rng),
    )
    if output is not None:
        write_atomic(output, slot_page(page).encode())
        say(f"page: {output}")
    if as_json:
        emit_json(_simulated_document(page), VIRTUAL)
        return
    say_mark(VIRTUAL)
    _tell(page)


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


def _tried(way: Way, session: Session, seed: int) -> Tried:
    first, second = way.sides(session)
    rng = np.random.default_rng([seed, 53])
    slots = cut_slots(first, second, rng)
    return Tried(way=way, slots=slots, body=cut_contour(first, second, rng))


def _three(name: str, text: str) -> Array:
    try:
        values = np.array([float(word) for word in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if values.shape != (3,) or not np.isfinite(values).all():
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


def _simulated_document(page: SlotPage) -> dict[str, Any]:
    def way(t: Tried) -> dict[str, Any]:
        first, second = t.slots.side_rms
        return {
            "key": t.way.key,
            "name": t.way.name,
            **_document(t.slots.evaluation, t.slots.measured.names),
            "rms_mm": t.slots.rms / MM,
            "first_rms_mm": first / MM,
            "second_rms_mm": second / MM,
            "sculpture_mm": t.body.mismatch / MM,
            "sculpture_worst_mm": t.body.worst / MM,
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
        "seed": page.seed,
        "chosen": page.chosen.way.key,
        "ways": [way(t) for t in page.tried],
        "datum_at_rest": datum(page.rest),
        "datum_knocked_1_mm": datum(page.knocked),
    }


def _tell(page: SlotPage) -> None:
    rows = [
        (
            t.way.key,
            t.way.name,
            f"{t.slots.mismatch / MM:.3f}",
            f"{t.slots.evaluation.spread / MM:.3f}",
            *(f"{v / MM:.3f}" for v in t.slots.side_rms),
            f"{t.body.mismatch / MM:.3f}",
        )
        for t in page.tried
    ]
    columns = ("way", "", "step", "sd of 4", "rms first", "rms second", "sculpture")
    title = f"slots cut from two sides, cell {page.seed}, mm"
    emit_table(title, columns, rows, provenance=VIRTUAL)
    emit_facts(
        "A datum that was not used for the frame, touched again",
        [("block where it was", page.rest.reason), ("block pushed by 1 mm", page.knocked.reason)],
        VIRTUAL,
    )
    _tell_sight(page.chosen.slots.evaluation, VIRTUAL)


def _tell_sight(found: SlotEvaluation, origin: Provenance) -> None:
    emit_facts("The steps see", [("", text) for text in found.sees], origin)
    emit_facts("The steps do not see", [("", text) for text in found.blind], origin)
