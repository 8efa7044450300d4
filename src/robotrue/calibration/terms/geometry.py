"""Geometry of the arm: joint zeros, links, gear ratios, base and tool."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.calibration.mean_tables import MeanTables
from robotrue.calibration.terms.term import without_errors
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError

PER_JOINT_GROUPS: Final = ("theta", "d", "a", "alpha", "beta", "gear")
"""Groups of the error vector with a prior scale that is learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorScales:
    """Standard deviation of each group of errors: those of a production industrial arm.

    Attributes:
        theta: rad, joint offsets.
        d: m.
        a: m.
        alpha: rad.
        beta: rad, Hayati's angle about y.
        gear: Relative error of the gear ratio.
        base: m, position of the robot root.
        base_rotation: rad.
        tool: m, position of the reflector on the flange.
        tool_rotation: rad.
    """

    theta: float = 1e-3
    d: float = 5e-4
    a: float = 5e-4
    alpha: float = 5e-4
    beta: float = 5e-4
    gear: float = 2e-5
    base: float = 2e-2
    base_rotation: float = 2e-2
    tool: float = 1e-2
    tool_rotation: float = 2e-2

    def __post_init__(self) -> None:
        """Refuses scales that are not positive."""
        for name in self.__slots__:
            if not getattr(self, name) > 0.0:
                raise ConfigurationError(
                    f"prior scale {name} is {getattr(self, name)}, must be positive."
                )

    def deviations(self, dof: int) -> Mapping[str, Array]:
        """Returns the sd of every parameter, by group of the error vector, SI."""
        per_joint = {name: np.full(dof, getattr(self, name)) for name in PER_JOINT_GROUPS}
        return {
            **per_joint,
            "base": np.repeat([self.base, self.base_rotation], 3),
            "tool": np.repeat([self.tool, self.tool_rotation], 3),
        }


def without_geometry(tables: MeanTables) -> MeanTables:
    """Returns the tables without errors of links; joint zeros, base and tool stay."""
    return without_errors(tables, ("d", "a", "alpha", "beta"))


def without_gear(tables: MeanTables) -> MeanTables:
    """Returns the tables without errors of gear ratios."""
    return without_errors(tables, ("gear",))
