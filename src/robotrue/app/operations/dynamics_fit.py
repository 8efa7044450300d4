"""Learn the residual of the prediction from windows with measured error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, PlainResult, Table, count
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import (
    DIRECTION,
    Direction,
    PredictedWith,
    WindowsFile,
    model_output,
)
from robotrue.core.units import MM, UM

if TYPE_CHECKING:
    from robotrue.dynamics.deviation import DeviationModel
    from robotrue.dynamics.deviation_physics import CompliantArm
    from robotrue.dynamics.learned_deviation import LearnedDeviation
    from robotrue.dynamics.windows import WindowSet

    _Fitted: TypeAlias = tuple[
        LearnedDeviation, Mapping[str, object], tuple[Facts, *tuple[Block, ...]]
    ]
    from robotrue.dynamics.paper_tables import PaperTables


class DynamicsFitRequest(Request):
    """Windows to learn from, and the arm."""

    windows: WindowsFile
    cell: Annotated[Path, InputFile()]
    """cell.toml with tool and joint stiffness."""
    output: Annotated[Path, model_output()]
    """Deviation model to write."""
    method: Literal["compliance", "jin2022"] = "compliance"
    """compliance (compliant joints and a residual) or jin2022 (components and support vectors of
    the paper, with its tables 1 to 3)."""
    direction: Direction = DIRECTION
    frf: PredictedWith = None


@operation()
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
    from robotrue.dynamics.paper_regression import fit_paper
    from robotrue.dynamics.paper_tables import paper_tables

    if request.frf is not None:
        context.note("--frf is not used by jin2022: it has no physics for its static row")
    model = fit_paper(windows, arm)
    tables = paper_tables(model)
    if len(windows.pass_names) == 1:
        context.note("one pass: the regression does not hold for another pose or line")
    return model, _tables_document(tables), (_tables_facts(tables), *_tables_shown(tables))


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
    """Returns the learned sizes in the units of their names; no drift if zeros were subtracted."""
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


SHOWN_ROWS: Final = 10
"""Of Table 1, as printed; JSON has all."""


def _tables_document(tables: PaperTables) -> Mapping[str, object]:
    """Returns JSON values, units in the names."""
    return {
        "table1": {
            "columns": [*tables.names, "measured_um"],
            "rows": [
                [*row, error]
                for row, error in zip(
                    tables.features.tolist(), tables.measured_um.tolist(), strict=True
                )
            ],
        },
        "table2": {
            "eigenvalues": tables.eigenvalues.tolist(),
            "contribution_percent": tables.contribution_percent.tolist(),
            "components": tables.kept,
        },
        "table3": {"columns": list(tables.names), "loadings": tables.loadings.tolist()},
        "support_vectors": tables.support_vectors,
        **dict(zip(("C", "gamma", "epsilon"), tables.chosen, strict=True)),
        "before_um": dict(zip(("mean", "max"), tables.before_um, strict=True)),
        "after_um": dict(zip(("mean", "max"), tables.after_um, strict=True)),
        "rmse_um": tables.rmse_um,
    }


def _tables_shown(tables: PaperTables) -> tuple[Table, Table, Table]:
    """Returns tables 1 to 3."""
    whole = len(tables.features)
    one = Table(
        title=f"table 1: {min(SHOWN_ROWS, whole)} of {count(whole, 'window')}",
        columns=("window", *tables.names, "measured_um"),
        rows=tuple(
            (str(k + 1), *(f"{v:.3f}" for v in row), f"{tables.measured_um[k]:.1f}")
            for k, row in enumerate(tables.features[:SHOWN_ROWS])
        ),
    )
    two = Table(
        title=f"table 2: {tables.kept} components carry 95 %",
        columns=("", *(str(k + 1) for k in range(len(tables.eigenvalues)))),
        rows=(
            ("eigenvalue", *(f"{v:.3g}" for v in tables.eigenvalues)),
            ("contribution %", *(f"{v:.2f}" for v in tables.contribution_percent)),
        ),
    )
    three = Table(
        title="table 3: loadings",
        columns=("component", *tables.names),
        rows=tuple(
            (str(k + 1), *(f"{v:.4f}" for v in row)) for k, row in enumerate(tables.loadings)
        ),
    )
    return one, two, three


def _tables_facts(tables: PaperTables) -> Facts:
    """Returns the regression of the windows."""
    penalty, gamma, tube = tables.chosen
    rmse = tables.rmse_um
    return Facts(
        title="support vector regression of the deviation",
        rows=(
            ("support vectors", f"{tables.support_vectors} of {len(tables.features)} windows"),
            ("C, gamma, epsilon", f"{penalty:g}, {gamma:g}, {tube:g}"),
            ("before, um", "mean {:.2f}, max {:.2f}".format(*tables.before_um)),
            ("after, um", "mean {:.2f}, max {:.2f}".format(*tables.after_um)),
            ("rmse um, all windows learned from", f"{rmse['training']:.2f}"),
            (
                "rmse um, random 70 / 23 as in the paper",
                f"{rmse['random_train']:.2f} learned from, {rmse['random_test']:.2f} held out",
            ),
            ("rmse um, blocks held out", f"{rmse['blocks']:.2f}"),
        ),
    )
