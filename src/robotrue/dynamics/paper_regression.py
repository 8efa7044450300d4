"""The paper's regression: support vectors on principal components of joints and force.

Source: Jin, Sun, Tang, Li 2022, section 2. Kernel, C, gamma and epsilon are not printed: a radial
kernel with the three chosen by cross-validation inside the training windows, as its users would.
Kept as the baseline; :mod:`robotrue.dynamics.deviation` is what robotrue uses.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.dynamics.paper_components import SHARE, Components, components_of, paper_columns
from robotrue.dynamics.window_checks import FEWEST
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ObservabilityError

PENALTY: Final = (1.0, 10.0, 100.0)
GAMMA: Final = (0.03, 0.1, 0.3)
TUBE: Final = (0.05, 0.2)
"""Searched, with the deviation in its own standard deviations."""
FOLDS: Final = 5
LONGEST: Final = 200_000
"""Steps of the solver; a combination that has not converged by then is judged as it stands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperModel:
    """Deviation by support vectors on components.

    Attributes:
        components: Of the training windows.
        regression: The fitted support vector regression (scikit-learn).
        centre: m, mean deviation in training.
        scale: m, its standard deviation.
        chosen: C, gamma, epsilon.
    """

    components: Components
    regression: Any
    centre: float
    scale: float
    chosen: tuple[float, float, float]

    def predict(self, windows: WindowSet) -> Array:
        """Returns the error (n,) m of windows: predicted plus learned deviation (eq. 2)."""
        scores = self.components.scores(paper_columns(windows))
        return np.asarray(
            windows.predicted + self.centre + self.scale * self.regression.predict(scores)
        )


def fit_paper(windows: WindowSet, *, share: float = SHARE) -> PaperModel:
    """Returns the paper's regression of the deviation on joints, peak and mean force.

    Args:
        windows: Measured.
        share: Of the variance that the kept components carry.

    Raises:
        ObservabilityError: Too few windows.
        ImplausibleDataError: A column that does not vary.

    Fails when: it is asked for poses it has not seen; it then returns its mean and says nothing.
    """
    if len(windows) < FEWEST:
        raise ObservabilityError(f"{len(windows)} windows, {FEWEST} are the least.")
    components = components_of(paper_columns(windows), share=share)
    scores = components.scores(paper_columns(windows))
    centre = float(windows.deviation.mean())
    scale = float(windows.deviation.std()) or 1.0
    values = (windows.deviation - centre) / scale
    chosen = _choose_settings(scores, values)
    return PaperModel(
        components=components,
        regression=_fit_regression(chosen, scores, values),
        centre=centre,
        scale=scale,
        chosen=chosen,
    )


def _choose_settings(scores: Array, values: Array) -> tuple[float, float, float]:
    """C, gamma, epsilon of least squared error over shuffled folds inside the training windows."""
    fold = np.random.default_rng(0).permutation(len(values)) % FOLDS
    best, least = (PENALTY[0], GAMMA[0], TUBE[0]), np.inf
    for penalty in PENALTY:
        for gamma in GAMMA:
            for tube in TUBE:
                trial = (penalty, gamma, tube)
                miss = 0.0
                for k in range(FOLDS):
                    held = fold == k
                    model = _fit_regression(trial, scores[~held], values[~held])
                    miss += float(((model.predict(scores[held]) - values[held]) ** 2).sum())
                if miss < least:
                    best, least = trial, miss
    return best


def _fit_regression(chosen: tuple[float, float, float], scores: Array, values: Array) -> Any:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.svm import SVR

    penalty, gamma, tube = chosen
    machine = SVR(kernel="rbf", C=penalty, gamma=gamma, epsilon=tube, max_iter=LONGEST)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # judged by its held-out error instead
        return machine.fit(scores, values)
