"""Numbers with commas between, as options state them."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array


def parse_number_list(text: str) -> Array:
    """Returns the numbers (n,) of a text; empty where one of them is no finite number."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)
