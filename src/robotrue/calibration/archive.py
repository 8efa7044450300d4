"""From an archive back to a model: a registry by kind, and the robot inside every archive."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.core.archive import Archive, archive_reader, read_archive
from robotrue.core.arrays import Array
from robotrue.errors import ArchiveError
from robotrue.robot.model import (
    MOMENTS,
    PER_JOINT,
    Configuration,
    RobotModel,
    moment_slice,
    parameter_names,
)

KINDS: Final[dict[str, str]] = {
    "error-model/rigid-flexible": "robotrue.calibration.calibrated_archive:read_rigid_flexible",
    "error-model/learned": "robotrue.calibration.calibrated_archive:read_learned",
    "error-model/nominal": "robotrue.calibration.nominal:from_archive",
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
_LARGEST: Final = {
    "theta": 100.0,
    "d": 1e3,
    "a": 1e3,
    "alpha": 100.0,
    "beta": 100.0,
    "joint_map": 1e3,
    "limits": 1e6,
    "link_mass": 1e6,
    "link_com": 1e3,
    "gravity": 1e3,
    "errors": 1e5,
}
"""Largest magnitudes of a robot's numbers, SI."""


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


def robot_document(robot: RobotModel) -> dict[str, object]:
    """Returns the JSON part of a robot."""
    return {
        "name": robot.name,
        "convention": robot.convention,
        "maker": robot.maker,
        "parameters": f"{' '.join(PER_JOINT)} per joint, base, tool; SI",
        **({"total_mass": robot.total_mass} if robot.total_mass else {}),
    }


def robot_arrays(robot: RobotModel) -> dict[str, Array]:
    """Returns the arrays of a robot under prefixed names."""
    out = {"robot_" + name: getattr(robot, name) for name in _ROBOT_ARRAYS}
    out["robot_controller_sign"] = robot.controller.sign
    out["robot_controller_offset"] = robot.controller.offset
    if robot.beta.any():
        out["robot_beta"] = robot.beta
    if robot.controller.coupling.size:
        out["robot_controller_coupling"] = robot.controller.coupling
    return out


@archive_reader
def robot_from(archive: Archive) -> RobotModel:
    """Returns the robot stored by :func:`robot_document` and :func:`robot_arrays`.

    Raises:
        ArchiveError: A part is missing, or cannot be.
    """
    document = archive.document.get("robot")
    words = ("name", "convention", "maker")
    if not isinstance(document, dict) or not all(isinstance(document.get(w), str) for w in words):
        raise ArchiveError(f"{archive.kind} holds no robot.")
    parts = {name: archive.array("robot_" + name) for name in _ROBOT_ARRAYS}
    parts["beta"] = archive.arrays.get("robot_beta", np.zeros(len(parts["d"])))
    parts["errors"] = with_moments(parts["errors"], len(parts["d"]))
    sign, offset = (archive.array(f"robot_controller_{n}") for n in ("sign", "offset"))
    dof = (len(parts["d"]),)
    empty = [name for name, part in parts.items() if not part.size]
    if empty or not sign.shape == offset.shape == dof or (np.abs(sign) != 1.0).any():
        raise ArchiveError(
            f"the robot of {archive.kind} is damaged: {empty[0] if empty else 'its controller'}."
        )
    for name, largest in _LARGEST.items():
        if (np.abs(parts[name]) > largest).any():
            raise ArchiveError(f"the robot of {archive.kind} has {name} beyond {largest:g}.")
    check_pose(parts["T_flange_tool"], "T_flange_tool")
    total_mass = float(document.get("total_mass", 0.0))
    if not 0.0 <= total_mass <= _LARGEST["link_mass"]:
        raise ArchiveError(f"the robot of {archive.kind} weighs {total_mass:g} kg.")
    coupling = archive.arrays.get("robot_controller_coupling", np.empty((0, 0)))
    if coupling.size and (
        coupling.shape != dof * 2
        or (np.abs(coupling) > 1e3).any()
        or abs(np.linalg.det(coupling)) < 1e-9
    ):
        raise ArchiveError(f"the coupling of the axes of {archive.kind} cannot be.")
    return RobotModel(
        name=document["name"],
        convention=document["convention"],
        maker=document["maker"],
        total_mass=total_mass,
        controller=Configuration(sign=sign, offset=offset, coupling=coupling),
        **parts,
    )


def with_moments(array: Array, dof: int) -> Array:
    """Returns errors (e,), or a covariance (e, e) of errors, with those that newer arms have.

    Archives from before arms had first moments of their links have none: zero, and certain.
    """
    if len(array) != len(parameter_names(dof)) - len(MOMENTS) * dof:
        return array
    where = np.full(len(MOMENTS) * dof, moment_slice(dof).start)
    for axis in range(array.ndim):
        array = np.insert(array, where, 0.0, axis=axis)
    return array


def check_pose(T: Array, name: str) -> None:
    """Refuses matrices (..., 4, 4) of a file that are no poses.

    Raises:
        ArchiveError: Not a rotation and a translation.
    """
    turn = T[..., :3, :3]
    if (
        T.shape[-2:] != (4, 4)
        or not np.allclose(turn @ np.swapaxes(turn, -1, -2), np.eye(3), atol=1e-6)
        or not (np.linalg.det(turn) > 0.0).all()
        or not np.allclose(T[..., 3, :], [0.0, 0.0, 0.0, 1.0], atol=1e-12)
        or (np.abs(T[..., :3, 3]) > 1e3).any()
    ):
        raise ArchiveError(f"{name} is no pose.")
