"""Robots by name, one TOML file each: the keys of ``[robot]`` in cell.toml, and a few more.

Further keys of a preset: ``name``; ``order`` in lists; ``rated_payload_kg`` where the name of the
type contains it; ``joint_map`` of a parallelogram; and instead of ``limits_deg`` of the joints q
either ``limits_rad``, or ``axis_limits_deg`` of the axes that the controller counts. The comment at
the top of a file names source and date.

A package outside adds robots by an entry point of the group ``robotrue.robots`` that names the
folder of its TOML files, a :class:`pathlib.Path`.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Final, Required, TypedDict, cast

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.extensions import extension_files
from robotrue.core.files import parse_toml, read_bytes
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.robot.makers import count_axes
from robotrue.robot.model import Configuration, Convention, RobotModel

FOLDER: Final = Path(__file__).parent
GROUP: Final = "robotrue.robots"
"""Entry points of packages outside."""
NEEDED: Final = ("name", "maker", "convention", "dh")
"""Keys of every preset."""
_BRANDS: Final = (
    "kukalbr",
    "kuka",
    "lbr",
    "universalrobots",
    "universalrobot",
    "abb",
    "fanuc",
    "staubli",
    "yaskawa",
    "motoman",
    "frankaemika",
    "franka",
)


class _PresetTable(TypedDict, total=False):
    """The keys of a preset."""

    name: Required[str]
    maker: Required[str]
    convention: Required[Convention]
    dh: Required[list[Mapping[str, float]]]
    order: int
    rated_payload_kg: float
    joint_map: list[list[float]]
    axes_sign: list[float]
    axes_offset_deg: list[float]
    limits_deg: list[list[float]]
    limits_rad: list[list[float]]
    axis_limits_deg: list[list[float]]
    mass_kg: list[float]
    centre_of_mass_mm: list[list[float]]


@cache
def read_preset_tables() -> dict[str, _PresetTable]:
    """Reads the files of all folders; returns their tables by the name of the robot.

    Raises:
        ConfigurationError: A file of a package outside that describes no robot, or one twice.
    """
    tables: list[_PresetTable] = []
    for path in (*sorted(FOLDER.glob("*.toml")), *extension_files(GROUP)):
        table, _ = parse_toml(read_bytes(path), path, example="the other presets")
        known = sorted(_PresetTable.__annotations__)
        unknown = sorted(table.keys() - set(known))
        if unknown:
            raise ConfigurationError(
                f"unknown key {unknown[0]}; allowed in a preset are {', '.join(known)}.",
                source=path,
            )
        missing = [key for key in NEEDED if key not in table]
        if missing:
            raise ConfigurationError(f"a preset without {missing[0]}.", source=path)
        if any(other["name"] == table["name"] for other in tables):
            raise ConfigurationError(
                f"a second robot {table['name']!r}.", source=path, hint="another name."
            )
        tables.append(cast(_PresetTable, table))
    tables.sort(key=lambda table: (table.get("order", len(tables) + 1), table["name"]))
    return {table["name"]: table for table in tables}


def preset_names() -> tuple[str, ...]:
    """Returns the full names of all presets."""
    return tuple(read_preset_tables())


def rated_payload(name: str) -> float | None:
    """Returns the rated payload in kg of a preset, by its full name; None where it is not known."""
    table = read_preset_tables().get(name)
    return None if table is None else table.get("rated_payload_kg")


def preset(name: str) -> RobotModel:
    """Returns the nominal robot of a name, flange without tool.

    Upper and lower case, blanks, ``-``, ``_``, ``/`` and the brand do not matter, and the front
    part of a name is enough where it is unique: ``"kr160"``, ``"KUKA KR 160 R1570"``,
    ``"irb-6660"``.

    Raises:
        ConfigurationError: No such preset, or several; the message lists them.
    """
    names = preset_names()
    wanted = _bare("".join(_tokens(name)))
    exact = [full for full in names if wanted == _bare("".join(_tokens(full)))]
    matches = exact or [full for full in names if wanted in _short_forms(full)]
    if len(matches) > 1:
        raise ConfigurationError(
            f"preset {name!r} could be {' or '.join(matches)}.", hint="write the full name."
        )
    if not matches:
        keys = {_bare("".join(_tokens(full))): full for full in names}
        keys |= {form: full for full in names for form in _short_forms(full)}
        near = difflib.get_close_matches(wanted, keys, n=1, cutoff=0.0)
        raise ConfigurationError(
            f"no robot preset {name!r}; there are {', '.join(names)}.",
            hint=f"{keys[near[0]]!r}, or describe the arm by its dh table or urdf."
            if near
            else None,
        )
    return _build_robot(matches[0])


def similar_presets(robot: RobotModel, tolerance: float) -> list[RobotModel]:
    """Returns the other presets with as many joints and links about as long, without tool.

    Args:
        robot: The arm they are compared with.
        tolerance: Largest relative difference of the lengths.
    """
    size = np.abs(robot.a).sum() + np.abs(robot.d).sum()
    presets = (_build_robot(name) for name in preset_names() if name != robot.name)
    return [
        other for other in presets
        if other.dof == robot.dof and abs(other.reach / size - 1.0) < tolerance
    ]  # fmt: skip


@cache
def _build_robot(name: str) -> RobotModel:
    """Returns the robot of a full name; it is immutable, so one instance is shared."""
    table = read_preset_tables()[name]
    rows = table["dh"]
    theta, alpha, d, a, _ = read_dh(rows)
    counting = count_axes(
        table["maker"],
        len(rows),
        sign=np.array(table["axes_sign"], dtype=np.float64) if "axes_sign" in table else None,
        offset=np.array(table["axes_offset_deg"]) * DEG if "axes_offset_deg" in table else None,
    )
    return RobotModel(
        name=table["name"],
        convention=table["convention"],
        theta=theta,
        alpha=alpha,
        d=d,
        a=a,
        joint_map=np.array(table.get("joint_map", np.empty((0, 0)))),
        limits=_joint_limits(table, counting),
        link_mass=np.array(table.get("mass_kg", [])),
        link_com=np.array(table.get("centre_of_mass_mm", np.empty((0, 3)))) * MM,
        controller=counting,
        maker=table["maker"],
    )


def read_dh(rows: Sequence[Mapping[str, float]]) -> tuple[Array, Array, Array, Array, Array]:
    """Returns theta, alpha, d, a, beta (n,) rad and m of rows in the keys of ``dh`` in cell.toml.

    A row without ``beta_deg`` has beta zero.
    """
    units = {"theta_deg": DEG, "alpha_deg": DEG, "d_mm": MM, "a_mm": MM}
    theta, alpha, d, a = (
        np.array([row[key] for row in rows]) * unit for key, unit in units.items()
    )
    return theta, alpha, d, a, np.array([row.get("beta_deg", 0.0) for row in rows]) * DEG


def _joint_limits(table: _PresetTable, counting: Configuration) -> Array:
    """Returns the limits (n, 2) rad of q."""
    if "limits_rad" in table:
        return np.array(table["limits_rad"], dtype=np.float64)
    if "limits_deg" in table:
        return np.array(table["limits_deg"]) * DEG
    limits = counting.to_model(np.array(table["axis_limits_deg"]).T * DEG).T
    return np.sort(limits, axis=1)  # a joint that counts the other way turns its limits over


def _tokens(name: str) -> list[str]:
    """Runs of letters and runs of digits, lower case, accents dropped."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    return re.findall(r"[a-z]+|[0-9]+", plain)


def _bare(joined: str) -> str:
    for brand in _BRANDS:
        if joined.startswith(brand) and len(joined) > len(brand):
            return joined[len(brand) :]
    return joined


def _short_forms(full: str) -> set[str]:
    """Front parts of a name that hold a number: kr160, kr160r, kr160r1570."""
    tokens = [t for t in _tokens(full) if t not in _BRANDS]
    fronts = ["".join(tokens[: k + 1]) for k in range(len(tokens))]
    return {front for front in fronts if front[-1].isdigit() or front == fronts[-1]}
