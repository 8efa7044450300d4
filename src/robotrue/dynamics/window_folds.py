"""Windows learned from and held out: at random, blocks of a pass, passes, poses."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError, ObservabilityError

QUESTIONS: Final = {
    "random": "windows between neighbours used in the fit; as in the paper, optimistic",
    "blocks": "stretches of a pass not used for learning",
    "passes": "a whole pass not used for learning, the others known",
    "unseen": "every other pass, one pass known",
}
BLOCKS: Final = 6
TRAINED: Final = 70.0 / 93.0
"""Part that is learned from in the random split: the paper's."""

Fold = tuple[IntArray, IntArray]


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
