"""Validate the predicted dynamic error on windows not used for learning."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, Note, PlainResult, Table, count
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import (
    DIRECTION,
    Direction,
    PredictedWith,
    WindowsFile,
    table_output,
)
from robotrue.core.provenance import mark_line, merge
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.dynamics.deviation_validation import Score
    from robotrue.dynamics.learned_deviation import DeviationPrediction
    from robotrue.dynamics.windows import WindowSet

BY_CHANCE: Final = (
    "by chance: the share a correct band holds in 95 of 100 cases, since neighbouring windows "
    "share their errors"
)
NAMES: Final = {
    "prediction": "frequency response and force",
    "paper": "components and support vectors",
    "deviation": "compliant joints and residual",
}


class DynamicsValidateRequest(Request):
    """Windows to check on, and either a model or the arm to learn with."""

    windows: WindowsFile
    cell: Annotated[Path | None, InputFile()] = None
    """cell.toml: fit to part of the windows, check on the others."""
    model: Annotated[Path | None, InputFile()] = None
    """Model of `dynamics fit` to check on these windows."""
    output: Annotated[Path | None, table_output()] = None
    """With --model: CSV of the estimates of all windows."""
    split: tuple[str, ...] = ()
    """random, blocks, passes or unseen; default: all that the data support."""
    known: str | None = None
    """Pass that `unseen` learns from; default: the first."""
    direction: Direction = DIRECTION
    seed: int = 0
    """Seed of the random split."""
    frf: PredictedWith = None


@operation()
def run(request: DynamicsValidateRequest, context: Context) -> PlainResult:
    """Scores by held-out windows; with a model, that model on these windows.

    Raises:
        ConfigurationError: No cell and no model, or an output that a cell has none of.
    """
    from robotrue.dynamics.formats.dynamics_csv import read_windows

    windows = read_windows(request.windows)
    if request.model is not None:
        return _judge(request, request.model, windows, context)
    if request.cell is None or request.output is not None:
        raise ConfigurationError(
            "-o goes with --model." if request.cell is not None else "no cell and no model.",
            hint="--cell cell.toml for held-out errors, --model MODEL for a model on new windows.",
        )
    return _hold_out(request, request.cell, windows, context)


def _hold_out(
    request: DynamicsValidateRequest, cell: Path, windows: WindowSet, context: Context
) -> PlainResult:
    """Errors of windows that were held out, by each split."""
    from robotrue.app.dynamics_inputs import read_arm, read_static_row, windows_origin
    from robotrue.dynamics.deviation_validation import scores
    from robotrue.dynamics.window_folds import QUESTIONS
    from robotrue.dynamics.windows import check_direction

    arm = read_arm(cell, request.direction)
    check_direction(windows, arm.direction)
    kinds = request.split
    if not kinds:
        several = len(windows.pass_names) > 1
        kinds = tuple(k for k in QUESTIONS if several or k in ("random", "blocks"))
        if not several:
            context.note("one pass: predictions of other poses cannot be tested")
    row = read_static_row(request.frf, arm, context)
    found = scores(windows, arm, kinds=kinds, row=row, known=request.known, seed=request.seed)
    table = Table(
        title=f"{request.windows.name}: errors of windows held out, um",
        columns=("split", "method", "rmse", "mean", "max", "in 95 % band", "by chance"),
        rows=tuple(_score_row(each) for each in found),
    )
    return PlainResult(
        values={"windows": len(windows), "scores": [each.document() for each in found]},
        shown=(
            table,
            *(Note(f"{kind}: {QUESTIONS[kind]}") for kind in kinds),
            Note(BY_CHANCE),
        ),
        provenance=windows_origin(windows, request.frf),
    )


def _judge(
    request: DynamicsValidateRequest, path: Path, windows: WindowSet, context: Context
) -> PlainResult:
    """Compares a model's estimates of these windows with the measured error."""
    from robotrue.dynamics.deviation_file import read_learned_deviation
    from robotrue.dynamics.paper_regression import PaperModel
    from robotrue.dynamics.windows import check_units

    check_units(windows)
    model = read_learned_deviation(path)
    found = model.predict(windows)
    origin = merge([model.windows.provenance, windows.provenance])
    if request.output is not None:
        table = mark_line(origin).encode() + _estimates(windows, found)
        context.write(request.output, table, count(len(windows), "window"))
    method = "paper" if isinstance(model, PaperModel) else "deviation"
    values, rows = _describe(windows, found, method)
    facts = Facts(title=f"{path.name} on {windows.source}", rows=tuple(rows))
    return PlainResult(values=values, shown=(facts,), provenance=origin)


def _describe(
    windows: WindowSet, found: DeviationPrediction, learned: str
) -> tuple[dict[str, object], list[tuple[str, str]]]:
    """Returns trust of the windows and error of each estimate, as JSON values and as facts."""
    import numpy as np

    from robotrue.dynamics.deviation_validation import TWO_SIDED_95
    from robotrue.dynamics.learned_deviation import WindowTrust

    number = np.bincount(found.standing, minlength=len(WindowTrust))
    standing = {s.name.lower(): int(number[s]) for s in WindowTrust}
    rows = [(name, count(windows_of, "window")) for name, windows_of in standing.items()]
    known = np.isfinite(windows.measured) & (found.standing != WindowTrust.INVALID)
    scores: list[dict[str, object]] = []
    estimates = {"prediction": windows.predicted, learned: found.error} if known.any() else {}
    for method, estimate in estimates.items():
        miss = np.abs(estimate - windows.measured)[known]
        inside = float((miss <= TWO_SIDED_95 * found.sd[known]).mean())
        rmse, largest = float(np.sqrt((miss**2).mean())) / UM, float(miss.max()) / UM
        rows.append((f"{NAMES[method]}, um", f"rmse {rmse:.2f}, max {largest:.2f}"))
        scores.append(
            {
                "method": method,
                "rmse_um": rmse,
                "mean_um": float(miss.mean()) / UM,
                "max_um": largest,
                "coverage_95": inside if method == learned else None,
            }
        )
    values = {"windows": len(windows), "standing": standing, "measured": int(known.sum())}
    return {**values, "scores": scores}, rows


def _estimates(windows: WindowSet, found: DeviationPrediction) -> bytes:
    import numpy as np

    from robotrue.core.csv_text import csv_text
    from robotrue.dynamics.learned_deviation import WindowTrust

    rows = [["pass", "error_um", "sd_um", "deviation_um", "physics_um", "standing"]]
    table = np.column_stack([found.error, found.sd, found.deviation, found.physics]) / UM
    for name, row, standing in zip(windows.passes, table, found.standing, strict=True):
        numbers = ["" if np.isnan(v) else f"{v:.4f}" for v in row]
        rows.append([name, *numbers, WindowTrust(int(standing)).name.lower()])
    return csv_text(rows).encode()


def _score_row(score: Score) -> tuple[str, ...]:
    from robotrue.dynamics.deviation_validation import METHODS

    d = score.document()
    inside = "" if score.coverage is None else f"{100.0 * score.coverage:.1f} %"
    chance = ""
    if score.by_chance is not None:
        low, high = score.by_chance.range
        chance = f"{100.0 * low:.0f} to {100.0 * high:.0f} %"
    return (
        score.split if score.method == METHODS[0] else "",
        NAMES[score.method],
        *(f"{d[key]:.2f}" for key in ("rmse_um", "mean_um", "max_um")),
        inside,
        chance,
    )
