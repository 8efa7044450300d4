"""The tables ``[registration]`` and ``[[part]]`` of a cell.toml."""

from __future__ import annotations

from typing import Any

import numpy as np

from robotrue.cell.part import PartFrame, PartTable
from robotrue.cell.schema import CellFile, PartFrameTable
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.provenance import Provenance, SourceFile
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError


def read_part(file: CellFile) -> PartTable | None:
    """Returns where touching found the part; None in a cell that is not registered.

    Raises:
        ConfigurationError: Frames without what they were made with, or the reverse, or two of one
            name.
    """
    if file.registration is None and not file.part:
        return None
    names = [table.name for table in file.part]
    if file.registration is None or not names or len(set(names)) < len(names):
        raise ConfigurationError(
            f"part frames {names} {'without' if file.registration is None else 'with'} a "
            "[registration], expected one table [registration] and one or more [[part]], of "
            "different names.",
            hint="robotrue register CELL POINTS -o CELL_OUT writes both.",
        )
    made = file.registration
    return PartTable(
        frames=tuple(_read_frame(table) for table in file.part),
        identity=ModelIdentity(
            kind=made.model.kind, robot=made.model.robot, sha256=made.model.sha256
        ),
        method=made.method,
        model_file=made.model.file,
        points_file=made.points_file,
        points_sha256=made.points_sha256,
        provenance=Provenance(
            simulated=made.simulated,
            instrument=made.instrument,
            files=(SourceFile(name=made.points_file, sha256=made.points_sha256),)
            if made.points_file
            else (),
        ),
    )


def _read_frame(table: PartFrameTable) -> PartFrame:
    return PartFrame(
        name=table.name,
        T_base_part=pose_from_xyz_abc(np.array(table.xyz_mm) * MM, np.array(table.abc_deg) * DEG),
        covariance=np.array(table.covariance_m_rad),
        touches=table.touches,
        outliers=tuple(table.outliers),
        rms=table.rms_mm * MM,
        verdict=table.verdict,
    )


def part_tables(part: PartTable) -> dict[str, Any]:
    """Returns the tables; every digit of poses, covariances and residuals is kept."""
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
        "part": [_frame_table(frame) for frame in part.frames],
    }


def _frame_table(frame: PartFrame) -> dict[str, Any]:
    T = frame.T_base_part
    return {
        "name": frame.name,
        "xyz_mm": (T[:3, 3] / MM + 0.0).tolist(),
        "abc_deg": (abc_from_matrix(T[:3, :3]) / DEG + 0.0).tolist(),
        "touches": frame.touches,
        "outliers": list(frame.outliers),
        "rms_mm": float(frame.rms / MM),
        "verdict": frame.verdict,
        "covariance_m_rad": (frame.covariance + 0.0).tolist(),
    }
