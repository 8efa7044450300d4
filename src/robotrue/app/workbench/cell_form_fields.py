"""The optional fields of the cell form: reflector, instrument place, floor, boxes, stiffness."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

BOXES: Final = 8
"""Boxes that the form states; a cell.toml may hold more."""
JOINTS: Final = 7
"""Most joints that the form states a stiffness of."""
OPTIONAL_FIELDS: Final[Mapping[str, tuple[float, float]]] = {
    **{f"reflector_{axis}_mm": (-3000.0, 3000.0) for axis in "xyz"},
    **{f"tracker_{axis}_mm": (-50_000.0, 50_000.0) for axis in "xyz"},
    "floor_z_mm": (-5000.0, 1000.0),
    **{
        f"box{number}_{corner}_{axis}_mm": (-20_000.0, 20_000.0)
        for number in range(1, BOXES + 1)
        for corner in ("low", "high")
        for axis in "xyz"
    },
    **{f"stiffness_{joint}_MNm_per_rad": (1e-4, 1000.0) for joint in range(1, JOINTS + 1)},
}
"""Least and most of each number that may be left blank: it is then not stated."""


def find_incomplete_fields(values: Mapping[str, float], dof: int) -> dict[str, dict[str, object]]:
    """Returns a fault for each blank field of a point, a box or a stiffness that is half stated."""
    faults: dict[str, dict[str, object]] = {}
    for names in _list_groups(dof):
        missing = [name for name in names if name not in values]
        if 0 < len(missing) < len(names):
            faults |= {name: {"kind": "incomplete"} for name in missing}
    for number in range(1, BOXES + 1):
        low, high = (_read_point(values, f"box{number}_{side}") for side in ("low", "high"))
        if not low or not high:
            continue
        for axis, least, largest in zip("xyz", low, high, strict=True):
            if not least < largest:
                faults[f"box{number}_high_{axis}_mm"] = {"kind": "flat"}
    return faults


def state_surroundings(
    values: Mapping[str, float], dof: int, frame: str
) -> dict[str, dict[str, object] | list[dict[str, object]]]:
    """Returns the keys that the optional fields add to the tables of a cell.toml.

    Args:
        values: The fields that are stated, complete.
        dof: Joints of the arm.
        frame: Frame of the measured positions, ``base`` or ``unknown``.
    """
    tables: dict[str, dict[str, object] | list[dict[str, object]]] = {}
    stiffness = [values.get(name) for name in _list_stiffness(dof)]
    stated = [round(each * 1e6, 3) for each in stiffness if each is not None]
    if stated:
        tables["robot"] = {"stiffness_Nm_per_rad": stated}
    if reflector := _read_point(values, "reflector"):
        tables["target"] = {"xyz_mm": reflector}
    if place := _read_point(values, "tracker"):
        # Measured positions in the base frame share it with the instrument's own place.
        tables["tracker"] = {"place_mm" if frame == "unknown" else "xyz_mm": place}
    obstacles: list[dict[str, object]] = []
    if "floor_z_mm" in values:
        height = values["floor_z_mm"]
        obstacles.append({"name": "floor", "below_mm": [[0.0, 0.0, height], [0.0, 0.0, 1.0]]})
    for number in range(1, BOXES + 1):
        low, high = (_read_point(values, f"box{number}_{side}") for side in ("low", "high"))
        if low and high:
            obstacles.append({"name": f"box {number}", "box_mm": [low, high]})
    if obstacles:
        tables["obstacle"] = obstacles
    return tables


def _list_groups(dof: int) -> list[list[str]]:
    """The fields that are stated together or not at all."""
    points = [[f"{what}_{axis}_mm" for axis in "xyz"] for what in ("reflector", "tracker")]
    boxes = [
        [f"box{number}_{corner}_{axis}_mm" for corner in ("low", "high") for axis in "xyz"]
        for number in range(1, BOXES + 1)
    ]
    return [*points, *boxes, _list_stiffness(dof)]


def _list_stiffness(dof: int) -> list[str]:
    return [f"stiffness_{joint}_MNm_per_rad" for joint in range(1, dof + 1)]


def _read_point(values: Mapping[str, float], name: str) -> list[float]:
    point = [values.get(f"{name}_{axis}_mm") for axis in "xyz"]
    stated = [each for each in point if each is not None]
    return stated if len(stated) == len(point) else []
