"""Learn what the prediction misses, from windows with measured error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

from robotrue.app.context import Context
from robotrue.app.dynamics_fields import DIRECTION, Direction, PredictedWith, WindowsFile
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Block, Facts, count
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import model_output
from robotrue.core.units import MM, UM

if TYPE_CHECKING:
    from robotrue.dynamics.deviation import DeviationModel
    from robotrue.dynamics.deviation_physics import CompliantArm
    from robotrue.dynamics.learned_deviation import LearnedDeviation
    from robotrue.dynamics.windows import WindowSet

    _Fitted: TypeAlias = tuple[
        LearnedDeviation, Mapping[str, object], tuple[Facts, *tuple[Block, ...]]
    ]


class DynamicsFitRequest(Request):
    """Which windows to learn from, on which arm."""

    windows: WindowsFile
    cell: Annotated[Path, InputFile(help="cell.toml with tool and joint stiffness.")]
    output: Annotated[Path, model_output("Deviation model to write.")]
    method: Annotated[
        Literal["compliance", "jin2022"],
        Option(
            help="compliance (joints that give way, and a residual) or jin2022 (components and "
            "support vectors of the paper, with its tables 1 to 3)."
        ),
    ] = "compliance"
    direction: Direction = DIRECTION
    frf: PredictedWith = None


def run(request: DynamicsFitRequest, context: Context) -> PlainResult:
    """Learns the deviation and writes the model."""
    from robotrue.app.dynamics_inputs import read_arm, windows_origin
    from robotrue.core.archive import write_archive
    from robotrue.dynamics.formats.dynamics_csv import read_windows
    from robotrue.dynamics.windows import check_direction

    windows = read_windows(request.windows)
    arm = read_arm(request.cell, request.direction)
    check_direction(windows, arm.direction)
    origin = windows_origin(windows, request.frf)
    windows = replace(windows, provenance=origin)
    fit = _fit_paper if request.method == "jin2022" else _fit_compliance
    model, values, shown = fit(request, windows, arm, context)
    output = context.output(request.output)
    write_archive(output, model.to_archive())
    passes = windows.pass_names
    head = Facts(
        title=f"{output}: deviation learned from {count(len(windows), 'window')} in "
        f"{len(passes)} pass{'' if len(passes) == 1 else 'es'}",
        rows=shown[0].rows,
    )
    document = {
        "model": str(output),
        "method": request.method,
        "windows": len(windows),
        "passes": list(passes),
        **values,
    }
    return PlainResult(values=document, shown=(head, *shown[1:]), provenance=origin)


def _fit_paper(
    request: DynamicsFitRequest, windows: WindowSet, arm: CompliantArm, context: Context
) -> _Fitted:
    """The paper's regression, its tables as JSON values and as blocks."""
    from robotrue.app.paper_view import tables_document, tables_facts, tables_shown
    from robotrue.dynamics.paper_regression import fit_paper
    from robotrue.dynamics.paper_tables import paper_tables

    if request.frf is not None:
        context.note("--frf is not used by jin2022: it has no physics to tell its static row to")
    model = fit_paper(windows, arm)
    tables = paper_tables(model)
    if len(windows.pass_names) == 1:
        context.note("one pass: the regression says nothing of another pose or line")
    return model, tables_document(tables), (tables_facts(tables), *tables_shown(tables))


def _fit_compliance(
    request: DynamicsFitRequest, windows: WindowSet, arm: CompliantArm, context: Context
) -> _Fitted:
    """Compliant joints and a residual process, their factors as JSON values and as facts."""
    from robotrue.app.dynamics_inputs import read_static_row
    from robotrue.dynamics.deviation import fit_deviation

    model = fit_deviation(windows, arm, row=read_static_row(request.frf, arm, context))
    values, sizes, dof = _document(model), _sizes(model), arm.robot.dof
    factors = zip(model.factors[:dof], model.factors_sd[:dof], strict=True)
    facts = Facts(
        title="",
        rows=(
            *(
                (f"compliance of joint {i + 1} over stated", f"{factor:.2f} +- {sd:.2f}")
                for i, (factor, sd) in enumerate(factors)
            ),
            *((name, f"{size:.3g}") for name, size in sizes.items() if size is not None),
        ),
    )
    return model, {**values, "sizes": sizes}, (facts,)


def _sizes(model: DeviationModel) -> dict[str, float | None]:
    """What the windows share, in the units of its names; no drift where every zero was taken."""
    sizes = model.sizes
    return {
        "pose_um": sizes["pose_m"] / UM,
        "pose_length_rad": sizes["pose_length_rad"],
        "pass_um": sizes["pass_m"] / UM,
        "pass_length_mm": sizes["pass_length_m"] / MM,
        "white_um": sizes["white_m"] / UM,
        "drift_N": None if model.windows.zero_taken.all() else sizes["drift_N"],
    }


def _document(model: DeviationModel) -> dict[str, object]:
    import numpy as np

    dof = model.arm.robot.dof
    g, b, c = model.factors[dof : dof + 3], model.factors[dof + 3], model.factors[dof + 4]
    fitted = model.predict(model.windows)
    rest = (fitted.error - model.windows.measured) / UM
    return {
        "compliance_factor": model.factors[:dof].tolist(),
        "compliance_factor_sd": model.factors_sd[:dof].tolist(),
        "static_of_prediction_um_per_N": (g / UM).tolist(),
        "offset_um": b / UM,
        "gain_of_prediction": 1.0 + c,
        "training_rmse_um": float(np.sqrt((rest**2).mean())),
    }


OPERATION: Final = Operation(request=DynamicsFitRequest, run=run)
