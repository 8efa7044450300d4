"""What operations of dynamics make of their options: load tests, arms, rows at rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotrue.app.context import Context
from robotrue.app.number_options import parse_numbers
from robotrue.cell.config import read_cell
from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import UM
from robotrue.dynamics.deviation_physics import CompliantArm, StaticCompliance, compliance_of
from robotrue.dynamics.formats.frf_table import read_frf
from robotrue.dynamics.frf import AXES
from robotrue.dynamics.interpolation import fit_curve
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError


def parse_static(text: str | None) -> dict[str, float]:
    """Returns pair of axes to m/N from ``xx=1.1,yx=0.1`` in um/N.

    Raises:
        ConfigurationError: Not of that form.
    """
    found: dict[str, float] = {}
    for item in [] if text is None else text.split(","):
        pair, _, number = item.strip().partition("=")
        try:
            value = float(number)
        except ValueError:
            value = np.nan
        if len(pair) != 2 or not set(pair) <= set(AXES) or not np.isfinite(value) or pair in found:
            raise ConfigurationError(
                f"static deflection {item.strip()!r}, expected pair=um/N.",
                hint="--static-um-per-n xx=1.1,yy=0.9",
            )
        found[pair] = value * UM
    return found


def parse_direction(text: str) -> Array:
    """Returns the unit vector (3,) of ``X,Y,Z``.

    Raises:
        ConfigurationError: No three numbers, or all of them zero.
    """
    value = parse_numbers("--direction", text, 3, hint="--direction=0,-1,0")
    size = float(np.linalg.norm(value))
    if size == 0.0:
        raise ConfigurationError(
            f"--direction {text!r}, expected three numbers.", hint="--direction=0,-1,0"
        )
    return np.asarray(value / size)


def read_arm(cell_path: Path, direction: str) -> CompliantArm:
    """Returns the compliant arm a cell file states.

    Args:
        cell_path: The cell.
        direction: ``X,Y,Z`` in base, along which the error counts positive.

    Raises:
        ConfigurationError: No stiffness in the cell, or no direction.
    """
    cell = read_cell(cell_path)
    prior = np.asarray(cell.compliance_prior)
    if not np.isfinite(prior).any():
        raise ConfigurationError(
            "the cell states no joint stiffness: nothing would bend.",
            source=cell_path,
            hint="[robot] stiffness_Nm_per_rad, from the data sheet or an earlier test.",
        )
    stiffness = np.where(np.isfinite(prior), 1.0 / np.where(prior > 0.0, prior, np.inf), np.inf)
    return CompliantArm(robot=cell.robot, stiffness=stiffness, direction=parse_direction(direction))


def read_static_row(
    frf: Path | None, arm: CompliantArm, context: Context
) -> StaticCompliance | None:
    """Returns the static row of the response the windows were predicted with, if it is given."""
    if frf is None:
        context.note(
            "without --frf the static row of the response is learned from the windows alone"
        )
        return None
    return compliance_of(fit_curve(read_frf(frf), "auto"), arm.direction)


def windows_origin(windows: WindowSet, frf: Path | None) -> Provenance:
    """Returns where windows come from, and the response they were predicted with."""
    return merge([windows.provenance, *([] if frf is None else [read_frf(frf).provenance])])
