"""Learn what the prediction misses, from windows with measured error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from robotrue.app.context import Context
from robotrue.app.dynamics_fields import (
    DIRECTION,
    Direction,
    PredictedWith,
    WindowsFile,
    model_output,
)
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts, count
from robotrue.app.request import InputFile, Request
from robotrue.core.units import MM, UM

if TYPE_CHECKING:
    from robotrue.dynamics.deviation import DeviationModel


class DynamicsFitRequest(Request):
    """Which windows to learn from, on which arm."""

    windows: WindowsFile
    cell: Annotated[Path, InputFile(help="cell.toml with tool and joint stiffness.")]
    output: Annotated[Path, model_output("Deviation model to write.")]
    direction: Direction = DIRECTION
    frf: PredictedWith = None


def run(request: DynamicsFitRequest, context: Context) -> PlainResult:
    """Learns the deviation and writes the model."""
    from robotrue.app.dynamics_inputs import read_arm, read_static_row, windows_origin
    from robotrue.core.archive import write_archive
    from robotrue.dynamics.deviation import fit_deviation
    from robotrue.dynamics.formats.windows_csv import read_windows
    from robotrue.dynamics.windows import check_direction

    windows = read_windows(request.windows)
    arm = read_arm(request.cell, request.direction)
    check_direction(windows, arm.direction)
    origin = windows_origin(windows, request.frf)
    windows = replace(windows, provenance=origin)
    model = fit_deviation(windows, arm, row=read_static_row(request.frf, arm, context))
    output = context.output(request.output)
    write_archive(output, model.to_archive())
    values = _document(model, output)
    passes = len(windows.pass_names)
    dof = arm.robot.dof
    factors = zip(model.factors[:dof], model.factors_sd[:dof], strict=True)
    facts = Facts(
        title=f"{output}: deviation learned from {count(len(windows), 'window')} in "
        f"{passes} pass{'' if passes == 1 else 'es'}",
        rows=(
            *(
                (f"compliance of joint {i + 1} over stated", f"{factor:.2f} +- {sd:.2f}")
                for i, (factor, sd) in enumerate(factors)
            ),
            *((name, f"{value:.3g}") for name, value in values["sizes"].items()),
        ),
    )
    return PlainResult(values=values, shown=(facts,), provenance=origin)


def _document(model: DeviationModel, output: Path) -> dict[str, Any]:
    import numpy as np

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
            "pass_length_mm": sizes["pass_length_m"] / MM,
            "white_um": sizes["white_m"] / UM,
        },
        "training_rmse_um": float(np.sqrt((rest**2).mean())),
    }


OPERATION: Final = Operation(request=DynamicsFitRequest, run=run)
