"""The process force that options state: one wrench, or the description in a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from robotrue.cell.cell import Cell, cutter_axis
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.process_force_file import read_force
from robotrue.core.arrays import Array, parse_number_list
from robotrue.dynamics.cutting_data import cutting_data
from robotrue.dynamics.milling_force import mean_force
from robotrue.errors import ConfigurationError


def read_force_options(
    cell: Cell, wrench: str | None, force: Path | None, cutter: str | None
) -> Array | DescribedForce:
    """Returns the force of the options: one wrench (6,), empty for none, or a description.

    Raises:
        ConfigurationError: Both are given, or one cannot be read.
        FormatError: A file that cannot be read.
    """
    if force is None:
        return parse_wrench(wrench) if wrench else np.empty(0)
    if wrench:
        raise ConfigurationError(
            "--wrench and --force are both given.",
            hint='a [[force]] with axes = "base" holds everywhere no other does.',
        )
    found = read_force(force, milling=_milling_wrench)
    if any(part.axes == "path" for part in found.parts):
        found = replace(found, cutter=cutter_axis(cell, cutter))
    return found


def parse_wrench(text: str) -> Array:
    """Returns (6,) N, N m from ``FX,FY,FZ[,MX,MY,MZ]``.

    Raises:
        ConfigurationError: Not three or six numbers.
    """
    numbers = parse_number_list(text)
    if numbers.size not in (3, 6):
        raise ConfigurationError(
            f"wrench {text!r}, expected 3 or 6 numbers in N and N m.", hint="--wrench 120,-40,-60"
        )
    return np.concatenate([numbers, np.zeros(6 - numbers.size)])


def _milling_wrench(stated: Mapping[str, object]) -> Array:
    """The mean force of milling (6,) N in path axes, from the keys of ``milling``.

    Raises:
        ConfigurationError: A missing or unknown key, or an invalid cut.
    """
    cutter, cut, coefficients = cutting_data(stated, where="milling")
    return np.concatenate([mean_force(cutter, cut, coefficients), np.zeros(3)])
