"""``robotrue dynamics fit`` and ``validate``: windows in, a model or held-out errors out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cell.config import read_cell
from robotrue.cli.console import count, emit_facts, emit_json, emit_table, say, say_mark
from robotrue.cli.dynamics_predict import curve_of
from robotrue.core.archive import read_archive, write_archive
from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line, merge
from robotrue.core.units import UM
from robotrue.dynamics.deviation import (
    DeviationModel,
    DeviationPrediction,
    WindowTrust,
    deviation_from_archive,
    fit_deviation,
)
from robotrue.dynamics.deviation_physics import CompliantArm
from robotrue.dynamics.deviation_validation import METHODS, QUESTIONS, TWO_SIDED_95, Score, scores
from robotrue.dynamics.formats.registry import read_frf
from robotrue.dynamics.formats.windows_csv import read_windows
from robotrue.dynamics.static_row import StaticRow, row_of
from robotrue.dynamics.window_checks import check_units
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError, ModelMismatchError

NAMES: Final = {
    "prediction": "frequency response and force",
    "paper": "components and support vectors",
    "deviation": "compliant joints and residual",
}


def fit(
    windows_path: Path,
    cell_path: Path,
    output: Path,
    *,
    direction: str,
    frf: Path | None,
    as_json: bool,
) -> None:
    """Learns the deviation and writes the model."""
    check_output(output, [p for p in (windows_path, cell_path, frf) if p is not None])
    windows, arm = read_windows(windows_path), arm_of(cell_path, direction)
    check_direction(windows, arm)
    origin = _origin(windows, frf)
    windows = replace(windows, provenance=origin)
    say_mark(origin)
    model = fit_deviation(windows, arm, row=_row(frf, arm))
    write_archive(output, model.to_archive())
    document = _fit_document(model, output)
    if as_json:
        emit_json(document, origin)
        return
    dof = arm.robot.dof
    emit_facts(
        f"{output}: deviation learned from {count(len(windows), 'window')} in "
        f"{count(len(windows.pass_names), 'pass')}".replace("passs", "passes"),
        [
            (f"compliance of joint {i + 1} over stated", f"{m:.2f} +- {s:.2f}")
            for i, (m, s) in enumerate(
                zip(model.factors[:dof], model.factors_sd[:dof], strict=True)
            )
        ]
        + [(name, f"{value:.3g}") for name, value in document["sizes"].items()],
        origin,
    )


def validate(
    windows_path: Path,
    cell_path: Path | None,
    *,
    model_path: Path | None,
    output: Path | None,
    direction: str,
    kinds: Sequence[str],
    known: str | None,
    seed: int,
    frf: Path | None = None,
    as_json: bool,
) -> None:
    """Scores by held-out windows; with a model, that model on these windows."""
    sources = [p for p in (windows_path, cell_path, model_path, frf) if p is not None]
    if output is not None:
        check_output(output, sources)
    windows = read_windows(windows_path)
    if model_path is not None:
        _judge(windows, model_path, output, as_json=as_json)
        return
    if cell_path is None or output is not None:
        raise ConfigurationError(
            "-o goes with --model." if cell_path is not None else "no cell and no model.",
            hint="--cell cell.toml for held-out errors, --model MODEL for a model on new windows.",
        )
    arm = arm_of(cell_path, direction)
    check_direction(windows, arm)
    if not kinds:
        several = len(windows.pass_names) > 1
        kinds = tuple(k for k in QUESTIONS if several or k in ("random", "blocks"))
        if not several:
            say("note: one pass: what it says of other poses cannot be tested")
    row = _row(frf, arm)
    found = scores(windows, arm, kinds=kinds, row=row, known=known, seed=seed)
    origin = _origin(windows, frf)
    say_mark(origin)
    if as_json:
        document = {"windows": len(windows), "scores": [s.document() for s in found]}
        emit_json(document, origin)
        return
    emit_table(
        f"{windows_path.name}: errors of windows held out, um",
        ("split", "method", "rmse", "mean", "max", "in 95 % band"),
        [_score_row(s) for s in found],
        provenance=origin,
    )
    for kind in kinds:
        say(f"{kind}: {QUESTIONS[kind]}")


def _origin(windows: WindowSet, frf: Path | None) -> Provenance:
    """Of the windows, and of the response they were predicted with."""
    return merge([windows.provenance, *([] if frf is None else [read_frf(frf).provenance])])


def arm_of(cell_path: Path, direction: str) -> CompliantArm:
    """Returns the compliant arm a cell file states.

    Raises:
        ConfigurationError: No stiffness in the cell, or no direction.
    """
    cell = read_cell(cell_path)
    prior = np.asarray(cell.compliance_prior)
    if not np.isfinite(prior).any():
        raise ConfigurationError(
            "the cell states no joint stiffness: nothing would bend.",
            source=cell_path,
            hint="[robot] stiffness_Nm_per_rad, from the data sheet or an earlier test.",
        )
    stiffness = np.where(np.isfinite(prior), 1.0 / np.where(prior > 0.0, prior, np.inf), np.inf)
    return CompliantArm(robot=cell.robot, stiffness=stiffness, direction=_direction(direction))


def _row(frf: Path | None, arm: CompliantArm) -> StaticRow | None:
    """The static row of the response the windows were predicted with, if it is given."""
    if frf is None:
        say("note: without --frf the static row of the response is learned from the windows alone")
        return None
    return row_of(curve_of(read_frf(frf), "auto"), arm.direction)


def check_direction(windows: WindowSet, arm: CompliantArm) -> None:
    """Passes unless ``f_mean_N`` is the mean force along another base axis than the error.

    Raises:
        ModelMismatchError: It is.
    """
    axis = int(np.abs(arm.direction).argmax())
    if abs(arm.direction[axis]) < 0.999 or len(windows) < 2:
        return
    if windows.force_mean.any() and not windows.force[:, axis].any():
        raise ModelMismatchError(
            f"f{'xyz'[axis]}_mean_N is zero in all windows and f_mean_N is not, though both are "
            f"along {'xyz'[axis]}.",
            source=windows.source or None,
            hint="a channel that is not connected, or --direction along the measured error.",
        )
    for k, name in enumerate("xyz"):
        same = np.allclose(np.abs(windows.force_mean), np.abs(windows.force[:, k]), atol=1e-6)
        if same and k != axis:
            raise ModelMismatchError(
                f"f_mean_N is the force along {name}, the error is said to be along {'xyz'[axis]}.",
                source=windows.source or None,
                hint="--direction along the measured error, e.g. --direction=0,-1,0.",
            )


def _direction(text: str) -> Array:
    try:
        value = np.array([float(part) for part in text.split(",")])
    except ValueError:
        value = np.empty(0)
    size = float(np.linalg.norm(value))
    if value.shape != (3,) or not np.isfinite(size) or size == 0.0:
        raise ConfigurationError(
            f"--direction {text!r}, expected three numbers.", hint="--direction=0,-1,0"
        )
    return np.asarray(value / size)


def _fit_document(model: DeviationModel, output: Path) -> dict[str, Any]:
    dof = model.arm.robot.dof
    g, b, c = model.factors[dof : dof + 3], model.factors[dof + 3], model.factors[dof + 4]
    sizes = model.sizes
    fitted = model.predict(model.windows)
    rest = (fitted.error - model.windows.measured) / UM
    return {
        "model": str(output),
        "windows": len(model.windows),
        "passes": list(model.windows.pass_names),
        "compliance_factor": model.factors[:dof].tolist(),
        "compliance_factor_sd": model.factors_sd[:dof].tolist(),
        "static_of_prediction_um_per_N": (g / UM).tolist(),
        "offset_um": b / UM,
        "gain_of_prediction": 1.0 + c,
        "sizes": {
            "pose_um": sizes["pose_m"] / UM,
            "pose_length_rad": sizes["pose_length_rad"],
            "pass_um": sizes["pass_m"] / UM,
            "pass_length_mm": sizes["pass_length_m"] * 1e3,
            "white_um": sizes["white_m"] / UM,
        },
        "training_rmse_um": float(np.sqrt((rest**2).mean())),
    }


def _judge(windows: WindowSet, path: Path, output: Path | None, *, as_json: bool) -> None:
    check_units(windows)
    model = deviation_from_archive(read_archive(path))
    found = model.predict(windows)
    origin = merge([model.windows.provenance, windows.provenance])
    say_mark(origin)
    if output is not None:
        write_atomic(output, mark_line(origin).encode() + _estimates(windows, found))
        say(f"{count(len(windows), 'window')} written to {output}")
    standing = np.bincount(found.standing, minlength=len(WindowTrust))
    known = np.isfinite(windows.measured) & (found.standing != WindowTrust.INVALID)
    document: dict[str, Any] = {
        "windows": len(windows),
        "standing": {s.name.lower(): int(standing[s]) for s in WindowTrust},
        "measured": int(known.sum()),
        "scores": [],
    }
    if known.any():
        measured = windows.measured[known]
        errors = {"prediction": windows.predicted[known], "deviation": found.error[known]}
        for method, value in errors.items():
            miss = np.abs(value - measured)
            inside = float((miss <= TWO_SIDED_95 * found.sd[known]).mean())
            document["scores"].append(
                {
                    "method": method,
                    "rmse_um": float(np.sqrt((miss**2).mean())) / UM,
                    "mean_um": float(miss.mean()) / UM,
                    "max_um": float(miss.max()) / UM,
                    "coverage_95": inside if method == "deviation" else None,
                }
            )
    if as_json:
        emit_json(document, origin)
        return
    facts = [(name, count(number, "window")) for name, number in document["standing"].items()]
    facts += [
        (f"{NAMES[s['method']]}, um", f"rmse {s['rmse_um']:.2f}, max {s['max_um']:.2f}")
        for s in document["scores"]
    ]
    emit_facts(f"{path.name} on {windows.source}", facts, origin)


def _estimates(windows: WindowSet, found: DeviationPrediction) -> bytes:
    rows = [["pass", "error_um", "sd_um", "deviation_um", "physics_um", "standing"]]
    table = np.column_stack([found.error, found.sd, found.deviation, found.physics]) / UM
    for name, row, standing in zip(windows.passes, table, found.standing, strict=True):
        numbers = ["" if np.isnan(v) else f"{v:.4f}" for v in row]
        rows.append([name, *numbers, WindowTrust(int(standing)).name.lower()])
    return csv_text(rows).encode()


def _score_row(score: Score) -> Sequence[str]:
    d = score.document()
    inside = "" if score.coverage is None else f"{100.0 * score.coverage:.1f} %"
    return (
        score.split if score.method == METHODS[0] else "",
        NAMES[score.method],
        *(f"{d[key]:.2f}" for key in ("rmse_um", "mean_um", "max_um")),
        inside,
    )
