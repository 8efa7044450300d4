"""From an archive back to a model: a registry by kind, and the robot inside every archive."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.archive import Archive, read_archive
from robotrue.core.arrays import Array
from robotrue.errors import ArchiveError
from robotrue.robot.model import Configuration, RobotModel

KINDS: Final[dict[str, str]] = {
    "error-model/rigid-flexible": "robotrue.calibration.rigid_flexible:from_archive",
    "error-model/learned": "robotrue.calibration.residual:from_archive",
    "error-model/deng2022": "robotrue.calibration.deng2022.joined:from_archive",
}
"""Kind of archive and its reader, ``module:function``; the module is imported when needed."""

_ROBOT_ARRAYS: Final = (
    "theta",
    "d",
    "a",
    "alpha",
    "joint_map",
    "limits",
    "link_mass",
    "link_com",
    "T_flange_tool",
    "gravity",
    "errors",
)


def register(kind: str, reader: str) -> None:
    """Adds a kind of model and its reader, ``"module:function"``."""
    KINDS[kind] = reader


def open_model(source: Archive | str | Path) -> ErrorModel:
    """Returns the error model in an archive or in a file.

    Raises:
        ArchiveError: Damaged, or of a kind this robotrue does not know.
        FormatError: The file cannot be read.
    """
    archive = source if isinstance(source, Archive) else read_archive(source)
    if archive.kind not in KINDS:
        raise ArchiveError(
            f"an archive of kind {archive.kind!r}; models are {sorted(KINDS)}.",
            source=None if isinstance(source, Archive) else source,
            hint="update robotrue, or pass a model file.",
        )
    module, name = KINDS[archive.kind].split(":")
    reader: Callable[[Archive], ErrorModel] = getattr(import_module(module), name)
    return reader(archive)


def robot_document(robot: RobotModel) -> dict[str, Any]:
    """Returns the JSON part of a robot."""
    return {
        "name": robot.name,
        "convention": robot.convention,
        "maker": robot.maker,
        "parameters": "theta d a alpha beta gear compliance per joint, base, tool; SI",
    }


def robot_arrays(robot: RobotModel, prefix: str = "robot_") -> dict[str, Array]:
    """Returns the arrays of a robot under prefixed names."""
    out = {prefix + name: getattr(robot, name) for name in _ROBOT_ARRAYS}
    if robot.controller is not None:
        out[prefix + "controller_sign"] = robot.controller.sign
        out[prefix + "controller_offset"] = robot.controller.offset
    return out


def robot_from(archive: Archive, prefix: str = "robot_") -> RobotModel:
    """Returns the robot kept by :func:`robot_document` and :func:`robot_arrays`.

    Raises:
        ArchiveError: A part is missing.
    """
    document = archive.document.get("robot")
    if not isinstance(document, dict) or not {"name", "convention", "maker"} <= set(document):
        raise ArchiveError(f"{archive.kind} holds no robot.")
    return RobotModel(
        name=document["name"],
        convention=document["convention"],
        maker=document["maker"],
        controller=Configuration(
            sign=np.asarray(archive.array(prefix + "controller_sign")),
            offset=np.asarray(archive.array(prefix + "controller_offset")),
        ),
        **{name: archive.array(prefix + name) for name in _ROBOT_ARRAYS},
    )
