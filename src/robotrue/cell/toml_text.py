"""Numbers as TOML: to 1e-12, so that what a conversion of units adds is not written."""

from __future__ import annotations

import numpy as np

from robotrue.core.arrays import Array


def number(value: float) -> str:
    """Returns a TOML float."""
    return repr(round(float(value), 12) + 0.0)


def numbers(values: Array) -> str:
    """Returns a TOML list of floats."""
    return "[" + ", ".join(number(v) for v in np.asarray(values).ravel()) + "]"
