"""Tables 1 to 3 of Jin, Sun, Tang, Li 2022, and its figures of error, for any windows.

Table 1: the columns and the measured error. Table 2: eigenvalues and contributions. Table 3: the
loadings of the kept components. The paper draws 70 of 93 windows at random to train on; that split
is repeated here, together with the error of contiguous blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, UM
from robotrue.dynamics.paper_learners import COLUMNS
from robotrue.dynamics.paper_regression import PaperModel, fit_paper, paper_columns
from robotrue.dynamics.window_folds import folds


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperTables:
    """Tables that the paper prints of a model.

    Attributes:
        names: (m,) of the columns, units in them.
        features: (n, m) joints in deg, peak and mean force in N.
        measured_um: (n,)
        eigenvalues: (m,) of the correlation matrix, falling.
        contribution_percent: (m,)
        kept: K, components that carry 95 %.
        loadings: (K, m), a component each row.
        support_vectors: Windows that the regression rests on.
        chosen: C, gamma, epsilon.
        before_um: Mean and largest size of the deviation.
        after_um: The same of what is left in the windows learned from.
        rmse_um: Root mean squares: ``training`` of all windows, ``random_train`` and
            ``random_test`` of the paper's split, ``blocks`` of sixths of every pass held out.
    """

    names: tuple[str, ...]
    features: Array
    measured_um: Array
    eigenvalues: Array
    contribution_percent: Array
    kept: int
    loadings: Array
    support_vectors: int
    chosen: tuple[float, float, float]
    before_um: tuple[float, float]
    after_um: tuple[float, float]
    rmse_um: dict[str, float]


def paper_tables(model: PaperModel) -> PaperTables:
    """Returns the tables of a model.

    Raises:
        ObservabilityError: The split leaves too few windows to learn from.
    """
    windows, parts, machine = model.windows, model.components, model.machine
    columns = paper_columns(windows)
    dof = windows.joints.shape[1]
    rest = model.predict(windows).error - windows.measured
    train, test = folds(windows, "random")[0]
    learned = fit_paper(windows.take(train), model.arm)
    apart = learned.predict(windows).error - windows.measured
    return PaperTables(
        names=(*(f"j{k + 1}_deg" for k in range(dof)), *COLUMNS[-2:]),
        features=np.column_stack([columns[:, :dof] / DEG, columns[:, dof:]]),
        measured_um=windows.measured / UM,
        eigenvalues=parts.eigenvalues,
        contribution_percent=100.0 * parts.share,
        kept=parts.count,
        loadings=parts.loadings[:, : parts.count].T,
        support_vectors=len(machine),
        chosen=(machine.penalty, machine.gamma, machine.tube),
        before_um=_sizes(windows.deviation),
        after_um=_sizes(rest),
        rmse_um={
            "training": _rms(rest),
            "random_train": _rms(apart[train]),
            "random_test": _rms(apart[test]),
            "blocks": model.held_out / UM,
        },
    )


def _sizes(values: Array) -> tuple[float, float]:
    """Mean and largest size, um."""
    return float(np.abs(values).mean()) / UM, float(np.abs(values).max()) / UM


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean())) / UM
