"""The paper's tables as a terminal, a page and JSON show them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from robotrue.app.presentation import Facts, Table, count

if TYPE_CHECKING:
    from robotrue.dynamics.paper_tables import PaperTables

SHOWN_ROWS: Final = 10
"""Of Table 1, as printed; JSON has all."""


def tables_document(tables: PaperTables) -> Mapping[str, object]:
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


def tables_shown(tables: PaperTables) -> tuple[Table, Table, Table]:
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


def tables_facts(tables: PaperTables) -> Facts:
    """Returns what the regression makes of the windows."""
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
