"""The part in its cell: frames found by touching, and the model they belong to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class PartFrame(Columns):
    """One part, or one side of it, where touching found it.

    Attributes:
        name: Of the part or side.
        T_base_part: (4, 4) m.
        covariance: (6, 6) of the displacement of the part's origin (m) and its left rotation
            vector (rad), both in base axes.
        touches: Number of touches.
        outliers: Names of the rejected ones.
        rms: m, of the accepted ones about the frame.
        verdict: ``GO`` or ``NO-GO``.
    """

    name: str
    T_base_part: Annotated[Array, Column("4 4", unit="m")]
    covariance: Annotated[Array, Column("6 6")]
    touches: int
    outliers: tuple[str, ...] = ()
    rms: float
    verdict: str

    def document(self) -> dict[str, object]:
        """Returns what a reader wants to know of it, as JSON values: mm and deg."""
        return {
            "name": self.name,
            "xyz_mm": (self.T_base_part[:3, 3] / MM + 0.0).tolist(),
            "abc_deg": (abc_from_matrix(self.T_base_part[:3, :3]) / DEG + 0.0).tolist(),
            "touches": self.touches,
            "outliers": list(self.outliers),
            "rms_mm": float(self.rms / MM),
            "verdict": self.verdict,
        }

    def spread_document(self) -> dict[str, object]:
        """Returns one standard deviation of the frame at its origin, JSON values: mm and deg."""
        sd = np.sqrt(np.diag(self.covariance))
        return {"sd_mm": (sd[:3] / MM).tolist(), "sd_deg": (sd[3:] / DEG).tolist()}


@dataclass(frozen=True, slots=True, kw_only=True)
class PartTable:
    """Part frames of a registered cell, and how they were measured.

    Attributes:
        frames: One per part or side; the first is the one meant where none is named.
        identity: The model of the arm that touched. Only programs of that model may use the frames.
        method: How the frames were found.
        model_file: That model's file, relative to the cell file; empty for the nominal arm.
        points_file: File name of the touches.
        points_sha256: Of that file.
        provenance: Of the touches, and of the model that a joint estimate refined with them.
    """

    frames: tuple[PartFrame, ...]
    identity: ModelIdentity
    method: str
    model_file: str = ""
    points_file: str = ""
    points_sha256: str = ""
    provenance: Provenance = MEASURED

    def __post_init__(self) -> None:
        """Checks the names.

        Raises:
            ShapeError: No frame, or two of one name.
        """
        names = [frame.name for frame in self.frames]
        if not names or len(set(names)) != len(names):
            raise ShapeError(f"part frames {names}, expected one or more, of different names.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts or sides."""
        return tuple(frame.name for frame in self.frames)

    def frame(self, name: str | None = None) -> PartFrame:
        """Returns the frame of a name; without a name the only one.

        Raises:
            ConfigurationError: No such part, or several to choose from.
        """
        listed = ", ".join(self.names)
        if name is None and len(self.frames) > 1:
            raise ConfigurationError(
                f"the cell has {len(self.frames)} part frames: {listed}.",
                hint=f"--part {self.names[0]}",
            )
        for frame in self.frames:
            if name in (None, frame.name):
                return frame
        raise ConfigurationError(
            f"no part {name!r} in the cell; it has {listed}.", hint=f"--part {self.names[0]}"
        )


def part_tables(part: PartTable) -> dict[str, object]:
    """Returns the tables; poses, covariances and residuals keep every digit."""
    origin = part.provenance
    return {
        "registration": {
            "method": part.method,
            "points_file": part.points_file,
            "points_sha256": part.points_sha256,
            **({"simulated": True} if origin.simulated else {}),
            **({"instrument": origin.instrument} if origin.instrument else {}),
            "model": {**part.identity.document(), "file": part.model_file},
        },
        "part": [
            {**frame.document(), "covariance_m_rad": (frame.covariance + 0.0).tolist()}
            for frame in part.frames
        ],
    }
