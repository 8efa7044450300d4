"""What a cell says of its controller as JSON values, SI: kept in model files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robotrue.program.external_axes import ExternalAxis
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable


def controller_document(told: FrameTable) -> dict[str, Any]:
    """Returns the tables without the defaults of the cell."""
    pulses = told.pulses_per_degree
    return {
        "bases": {key: matrix.tolist() for key, matrix in told.bases.items()},
        "tools": {key: matrix.tolist() for key, matrix in told.tools.items()},
        "external": [_axis_document(axis) for axis in told.external],
        "external_axes_at_rest": told.external_axes_at_rest,
        "fixed_tool": told.fixed_tool,
        "harmless_routines": list(told.harmless_routines),
        "orientation": {
            "angles": told.orientation.angles,
            "cutter": told.orientation.cutter.tolist(),
            "spin": told.orientation.spin,
        },
        "pulses_per_degree": None if pulses is None else np.asarray(pulses).tolist(),
        **({"start": told.start.tolist()} if len(told.start) else {}),
    }


def controller_from_document(stated: Mapping[str, Any]) -> FrameTable:
    """Returns the tables; of model files that say nothing, empty ones.

    Raises:
        KeyError: An entry is missing.
    """
    if not stated:
        return FrameTable()
    pulses = stated["pulses_per_degree"]
    return FrameTable(
        bases={key: np.array(matrix) for key, matrix in stated["bases"].items()},
        tools={key: np.array(matrix) for key, matrix in stated["tools"].items()},
        external=tuple(_axis(each) for each in stated["external"]),
        external_axes_at_rest=bool(stated["external_axes_at_rest"]),
        fixed_tool=stated["fixed_tool"],
        harmless_routines=tuple(stated.get("harmless_routines", ())),
        orientation=OrientationRule(
            angles=stated["orientation"]["angles"],
            cutter=np.array(stated["orientation"]["cutter"]),
            spin=stated["orientation"]["spin"],
        ),
        pulses_per_degree=None if pulses is None else np.array(pulses),
        start=np.array(stated.get("start", [])),
    )


def _axis_document(axis: ExternalAxis) -> dict[str, Any]:
    return {
        "number": axis.number,
        "name": axis.name,
        "direction": axis.direction.tolist(),
        "point": None if axis.point is None else axis.point.tolist(),
        "at": axis.at,
        "carries_robot": axis.carries_robot,
        "frames": list(axis.frames),
        "per_pulse": axis.per_pulse if np.isfinite(axis.per_pulse) else None,
    }


def _axis(stated: Mapping[str, Any]) -> ExternalAxis:
    point, per_pulse = stated["point"], stated["per_pulse"]
    return ExternalAxis(
        number=int(stated["number"]),
        name=stated["name"],
        direction=np.array(stated["direction"]),
        point=None if point is None else np.array(point),
        at=float(stated["at"]),
        carries_robot=bool(stated["carries_robot"]),
        frames=tuple(stated["frames"]),
        per_pulse=np.nan if per_pulse is None else float(per_pulse),
    )
