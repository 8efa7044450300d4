"""How well a deviation predicts windows it has not seen: blocks, passes, poses; and at random.

Windows of one pass are neighbours in everything. Split at random, each one held out lies between
two learned from, and any regression looks good; that row is printed because the paper printed it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.units import UM
from robotrue.dynamics.deviation import DeviationSettings, fit_deviation
from robotrue.dynamics.deviation_physics import CompliantArm, StaticCompliance
from robotrue.dynamics.paper_regression import fit_paper
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError, ObservabilityError

QUESTIONS: Final = {
    "random": "windows between neighbours that were learned from; as in the paper, flattering",
    "blocks": "stretches of a pass nobody learned from",
    "passes": "a whole pass nobody learned from, the others known",
    "unseen": "every other pass, one pass known",
}
BLOCKS: Final = 6
TRAINED: Final = 70.0 / 93.0
"""Part that is learned from in the random split: the paper's."""
TWO_SIDED_95: Final = 1.959964
METHODS: Final = ("prediction", "paper", "deviation")

Fold = tuple[IntArray, IntArray]
Estimate = Callable[[WindowSet, WindowSet], tuple[Array, Array | None]]
"""Training and test windows to error (m,) m and its standard deviation (m,) m or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One method on one kind of split.

    Attributes:
        split: Key of :data:`QUESTIONS`.
        method: ``prediction`` (frequency response and force), ``paper``, ``deviation`` (ours).
        residual: (n,) m, estimated less measured, of all held-out windows.
        sd: (n,) m as stated, or None.
    """

    split: str
    method: str
    residual: Array
    sd: Array | None

    @property
    def rmse(self) -> float:
        """Root mean square, m."""
        return float(np.sqrt((self.residual**2).mean()))

    @property
    def coverage(self) -> float | None:
        """Part of windows inside the stated 95 % band, or None."""
        if self.sd is None:
            return None
        return float((np.abs(self.residual) <= TWO_SIDED_95 * self.sd).mean())

    def document(self) -> dict[str, Any]:
        """Returns JSON values."""
        return {
            "split": self.split,
            "question": QUESTIONS[self.split],
            "method": self.method,
            "windows": len(self.residual),
            "rmse_um": self.rmse / UM,
            "mean_um": float(np.abs(self.residual).mean()) / UM,
            "max_um": float(np.abs(self.residual).max()) / UM,
            "coverage_95": self.coverage,
        }


def folds(windows: WindowSet, kind: str, *, known: str | None = None, seed: int = 0) -> list[Fold]:
    """Returns index pairs, learned from and held out.

    Args:
        windows: To split.
        kind: Key of :data:`QUESTIONS`.
        known: Pass learned from in ``unseen``; default the first.
        seed: Of the random split.

    Raises:
        ConfigurationError: No such kind or pass.
        ObservabilityError: One pass, where several are needed.
    """
    member, count = windows.pass_index, len(windows.pass_names)
    every = np.arange(len(windows))
    if kind not in QUESTIONS:
        raise ConfigurationError(f"no split {kind!r}; there are {', '.join(QUESTIONS)}.")
    if kind == "random":
        order = np.random.default_rng([seed, 5]).permutation(len(windows))
        cut = round(TRAINED * len(windows))
        return [(np.sort(order[:cut]), np.sort(order[cut:]))]
    if kind == "blocks":
        part = np.empty(len(windows), dtype=np.int64)
        for k in range(count):
            for b, rows in enumerate(np.array_split(np.flatnonzero(member == k), BLOCKS)):
                part[rows] = b
        return [(every[part != b], every[part == b]) for b in range(BLOCKS)]
    if count < 2:
        raise ObservabilityError(
            f"the split {kind!r} needs two passes or more, there is one.",
            source=windows.source or None,
            hint="mill another pass elsewhere in the workspace.",
        )
    if kind == "passes":
        return [(every[member != k], every[member == k]) for k in range(count)]
    name = windows.pass_names[0] if known is None else known
    if name not in windows.pass_names:
        raise ConfigurationError(f"no pass {name!r}; there are {', '.join(windows.pass_names)}.")
    k = windows.pass_names.index(name)
    return [(every[member == k], every[member != k])]


def scores(
    windows: WindowSet,
    arm: CompliantArm,
    *,
    kinds: Sequence[str] = tuple(QUESTIONS),
    methods: Sequence[str] = METHODS,
    settings: DeviationSettings | None = None,
    row: StaticCompliance | None = None,
    known: str | None = None,
    seed: int = 0,
) -> list[Score]:
    """Returns every method on every kind of split.

    Args:
        windows: Measured.
        arm: As stated.
        kinds: Of :data:`QUESTIONS`.
        methods: Of :data:`METHODS`.
        settings: Priors of the deviation.
        row: As of :func:`robotrue.dynamics.deviation.fit_deviation`.
        known: As of :func:`folds`.
        seed: As of :func:`folds`.

    Raises:
        ConfigurationError: No such split or method.
        ObservabilityError: Too few windows or passes.
    """
    out = []
    for kind in kinds:
        for method in methods:
            estimate = _estimate(method, arm, settings, row)
            residual, deviation = [], []
            for train, test in folds(windows, kind, known=known, seed=seed):
                held = windows.take(test)
                error, sd = estimate(windows.take(train), held)
                residual.append(error - held.measured)
                deviation.append(sd)
            stated = [sd for sd in deviation if sd is not None]
            out.append(
                Score(
                    split=kind,
                    method=method,
                    residual=np.concatenate(residual),
                    sd=np.concatenate(stated) if len(stated) == len(deviation) else None,
                )
            )
    return out


def _estimate(
    method: str, arm: CompliantArm, settings: DeviationSettings | None, row: StaticCompliance | None
) -> Estimate:
    def deviation(train: WindowSet, test: WindowSet) -> tuple[Array, Array | None]:
        found = fit_deviation(train, arm, settings, row=row).predict(test)
        return found.error, found.sd

    known: dict[str, Estimate] = {
        "prediction": lambda train, test: (test.predicted, None),
        "paper": lambda train, test: (fit_paper(train).predict(test), None),
        "deviation": deviation,
    }
    if method not in known:
        raise ConfigurationError(f"no method {method!r}; there are {', '.join(METHODS)}.")
    return known[method]
