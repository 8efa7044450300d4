"""What a KRL program tells of targets it leaves alone."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import BoolArray, IntArray


def conflict_notes(name: str, lines: IntArray) -> list[str]:
    """Returns a sentence on each of the first points used in several frames."""
    return [
        f"{name}:{line}: this point is used with more than one base or tool; it is not compensated."
        for line in lines[:5].tolist()
    ]


def incomplete_notes(name: str, line: IntArray, rows: BoolArray) -> list[str]:
    """Returns the sentence on targets that leave components out, if there are any."""
    at = np.flatnonzero(rows)
    if not len(at):
        return []
    return [
        f"{name}:{line[at[0]]}: {len(at)} targets from this line on leave components out, and what "
        "they inherit is not known; they are not compensated, but follow the target before them "
        "where it is. Write all six components."
    ]
