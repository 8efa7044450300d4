"""``robotrue drift``: is the robot still the one that was calibrated?"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.calibration.lineage import provenance_of
from robotrue.cli.console import emit_facts, emit_json, emit_table, say, say_mark
from robotrue.cli.inputs import measured
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, MM
from robotrue.store.model_file import read_model
from robotrue.validation.drift_check import Cause, DriftCheck, drift_check

VERDICTS: Final = {
    "keep": "nothing has changed beyond chance: keep the model",
    "update": "one cause explains what has changed: update the model by transfer with these poses",
    "recalibrate": "the robot has changed, and no single cause explains it: calibrate again",
    "measure again": "one reading explains it: measure that pose again before anything else",
}
MOST_CAUSES: Final = 6


def run(
    model_path: Path, poses: Path, *, level: float, mapping: Path | None, as_json: bool
) -> None:
    """Judges the poses and prints the verdict; exits with 0 whatever it is."""
    stored = read_model(model_path)
    check = measured(stored.cell, [poses], mapping, minimum=4)
    found = drift_check(stored.model, check, payload=stored.cell.payload, level=level)
    origin = merge([provenance_of(stored.model), check.provenance])
    say_mark(origin)
    if as_json:
        emit_json(document(found), origin)
        return
    facts = [
        ("verdict", found.verdict),
        ("that is", VERDICTS[found.verdict]),
        (
            "chi-square",
            f"{found.chi2:.1f} for {found.degrees} numbers, chance of more {found.p:.2g}",
        ),
        ("residual rms", f"{_rms(found) / MM:.4f} mm"),
        ("level", f"false alarm in {100 * found.level:g} % of checks or fewer"),
    ]
    if found.not_seen:
        facts.append(("not seen by these poses", ", ".join(found.not_seen)))
    emit_facts(f"drift check of {stored.model.robot.name}", facts, origin)
    if found.changed:
        emit_table(
            "causes, most likely first",
            ("cause", "shift", "chance", "chance of the rest", ""),
            [
                (
                    _place(c, found),
                    _shift(c),
                    f"{c.p:.2g}",
                    f"{c.p_left:.2g}",
                    "explains it" if c.explains else "",
                )
                for c in found.causes[:MOST_CAUSES]
            ],
            words=True,
            provenance=origin,
        )
    if found.verdict == "update":
        say(f"try: robotrue transfer CELL {poses} --source old={model_path},campaign -o MODEL_NEW")


def document(found: DriftCheck) -> dict[str, Any]:
    """Returns JSON values; lengths in mm, angles in deg."""
    return {
        "verdict": found.verdict,
        "meaning": VERDICTS[found.verdict],
        "chi2": found.chi2,
        "degrees_of_freedom": found.degrees,
        "p": found.p,
        "level": found.level,
        "residual_rms_mm": _rms(found) / MM,
        "causes": [
            {
                "name": c.name,
                "explains": c.explains,
                "p": c.p,
                "p_left": c.p_left,
                "chi2_gain": c.gain,
                "shift": {
                    _named(term): float(v) / _size(term)
                    for term, v in zip(c.terms, c.shift, strict=True)
                },
                "sd": {
                    _named(term): float(v) / _size(term)
                    for term, v in zip(c.terms, c.sd, strict=True)
                },
            }
            for c in found.causes
        ],
        "not_seen": list(found.not_seen),
        "poses": [
            {
                "line": int(line),
                "residual_mm": (residual / MM).tolist(),
                "sigmas": float(sigmas),
            }
            for line, residual, sigmas in zip(
                found.source_row, found.residual, found.sigmas, strict=True
            )
        ],
    }


def _rms(found: DriftCheck) -> float:
    return float(np.sqrt(np.mean(np.sum(found.residual**2, axis=1))))


def _place(cause: Cause, found: DriftCheck) -> str:
    if cause.kind != "reading":
        return cause.name
    row = int(cause.name.removeprefix("reading ")) - 1
    return f"reading of line {int(found.source_row[row])}"


def _shift(cause: Cause) -> str:
    return ", ".join(
        f"{term} {v / _size(term):+.4f}({s / _size(term):.4f}) {_unit(term)}"
        for term, v, s in zip(cause.terms, cause.shift, cause.sd, strict=True)
    )


def _unit(term: str) -> str:
    return "mm" if term in ("x", "y", "z") else "deg"


def _size(term: str) -> float:
    return MM if _unit(term) == "mm" else DEG


def _named(term: str) -> str:
    return f"{term}_{_unit(term)}"
