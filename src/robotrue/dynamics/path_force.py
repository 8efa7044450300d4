"""The force of milling along a path whose engagement changes: what compensation asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.dynamics.cutter import Cutter, CutterEngagement, CuttingCoefficients
from robotrue.dynamics.milling_force import mean_force
from robotrue.errors import ConfigurationError
from robotrue.program.cut_path import CutPath


@dataclass(frozen=True, slots=True, kw_only=True)
class MillingAlongPath(Columns):
    """Mean force of milling by the length of the path; a ``ProcessForce``.

    Attributes:
        cutter: The tool.
        coefficients: Of the material.
        cut: Mode, feed per tooth and spindle; its depth and width are those of the table.
        along: (k,) m of feeding path, rising.
        depth: (k,) m, along the tool; zero where it does not cut.
        width: (k,) m, radial; zero where it does not cut.
    """

    cutter: Cutter
    coefficients: CuttingCoefficients
    cut: CutterEngagement
    along: Annotated[Array, Column("n", unit="m")]
    depth: Annotated[Array, Column("n", unit="m")]
    width: Annotated[Array, Column("n", unit="m")]

    def _check_rules(self) -> None:
        """Checks the values."""
        along = self.along
        if len(along) < 2 or (np.diff(along) <= 0.0).any():
            raise ConfigurationError("lengths of an engagement table have to rise, two or more.")
        for name in ("depth", "width"):
            values = getattr(self, name)
            if (values < 0.0).any():
                k = int(np.argmax(values < 0.0))
                raise ConfigurationError(
                    f"{name} is {values[k] / MM:g} mm at {along[k] / MM:g} mm of the path, "
                    "expected zero or more."
                )

    def at(self, along: Array) -> Array:
        """Returns the mean force (n, 3) N in path axes at lengths (n,) m.

        Engagement is interpolated; before the first length and after the last nothing is cut.
        """
        depth = np.interp(along, self.along, self.depth, left=0.0, right=0.0)
        width = np.interp(along, self.along, self.width, left=0.0, right=0.0)
        out = np.zeros((len(along), 3))
        cuts = np.isfinite(along) & (depth > 0.0) & (width > 0.0)
        pairs, which = np.unique(
            np.column_stack([depth[cuts], width[cuts]]), axis=0, return_inverse=True
        )
        forces = [
            mean_force(self.cutter, self._cut(float(a), float(b)), self.coefficients)
            for a, b in pairs
        ]
        if forces:
            out[cuts] = np.array(forces)[which.ravel()]
        return out

    def wrench(self, path: CutPath) -> Array:
        """Returns (n, 6) N, N m on the tool, at the tool point, in base axes; never NaN."""
        force = self.at(np.where(path.cutting, path.along, np.nan))
        frames = path.path_frames()
        known = np.isfinite(frames).all(axis=(1, 2))
        out = np.zeros((len(path), 6))
        out[known, :3] = np.einsum("nij,nj->ni", frames[known], force[known])
        return out

    def _cut(self, depth: float, width: float) -> CutterEngagement:
        return CutterEngagement(
            mode=self.cut.mode,
            depth=depth,
            width=min(width, self.cutter.diameter),
            feed_per_tooth=self.cut.feed_per_tooth,
            spindle=self.cut.spindle,
        )
