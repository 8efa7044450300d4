"""Text of a cell.toml: written from tables, or patched without touching other lines.

Comments, order and layout of a user's file survive a patch (tomlkit).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import tomlkit
from tomlkit.items import Item

from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM

PART_HEADING: Final = (
    "# Registered by touching; written by `robotrue register`, whole. Do not edit.\n"
)
_LONGEST_LINE: Final = 100
_INLINE: Final = frozenset({"dh"})  # lists of tables that read better as rows of one array
_ARM_FILES: Final = ("urdf", "ur_calibration")  # keys of [robot]
_COMMENTS: Final = {
    "registration.model": "programs of another model are refused",
    "part.abc_deg": "KUKA A, B, C: Rz(A) Ry(B) Rx(C)",
}


def round_digits(values: npt.ArrayLike) -> Any:
    """Returns a number or an array as floats to 1e-12, without what a change of units adds."""
    plain = np.asarray(values, dtype=np.float64).tolist()

    def round_value(value: Any) -> object:
        if isinstance(value, list):
            return [round_value(entry) for entry in value]
        return round(value, 12) + 0.0  # no negative zero

    return round_value(plain)


def pose_keys(T: Array) -> dict[str, object]:
    """Returns a pose (4, 4) m as ``xyz_mm`` and ``abc_deg``, KUKA A, B, C."""
    return {
        "xyz_mm": round_digits(T[:3, 3] / MM),
        "abc_deg": round_digits(abc_from_matrix(T[:3, :3]) / DEG),
    }


def write_toml(tables: Mapping[str, object]) -> str:
    """Returns tables as TOML; equal tables give equal text."""
    document = tomlkit.document()
    for key, value in tables.items():
        document.add(key, _item(value, key))
    return tomlkit.dumps(document)


def _item(value: object, path: str) -> Item:
    if isinstance(value, Mapping):
        table = tomlkit.table()
        for key, entry in value.items():
            table.add(key, _item(entry, f"{path}.{key}"))
        made: Item = table
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        made = _rows(value) if path.rpartition(".")[2] in _INLINE else _tables(value, path)
    else:
        made = tomlkit.item(value)
        if isinstance(value, list) and len(made.as_string()) > _LONGEST_LINE:
            made = tomlkit.array().multiline(True)
            made.extend(value)
    if path in _COMMENTS:
        made.comment(_COMMENTS[path])
    return made


def _tables(values: list[Mapping[str, object]], path: str) -> Item:
    tables = tomlkit.aot()
    for value in values:
        tables.append(_item(value, path))
    return tables


def _rows(values: list[Mapping[str, object]]) -> Item:
    rows = tomlkit.array().multiline(True)
    for value in values:
        row = tomlkit.inline_table()
        row.update(value)
        rows.append(row)
    return rows


def without_part(text: str) -> str:
    """Returns a cell.toml's text without its registration; everything else as it was."""
    document = tomlkit.parse(text)
    for key in ("registration", "part"):
        if key in document:
            document.remove(key)
    return tomlkit.dumps(document).replace(PART_HEADING, "").rstrip() + "\n"


def with_part(text: str, tables: Mapping[str, object]) -> str:
    """Returns a cell.toml's text with ``[registration]`` and ``[[part]]`` in place of any it had.

    Args:
        text: The cell.toml.
        tables: What :func:`robotrue.cell.part.part_tables` returns.
    """
    return f"{without_part(text)}\n{PART_HEADING}{write_toml(tables)}"


def with_table(text: str, key: str, table: Mapping[str, object]) -> str:
    """Returns a cell.toml's text with another table of a key; it need not have had one."""
    document = tomlkit.parse(text)
    document[key] = _item(table, key)
    return tomlkit.dumps(document)


def named_files(tables: Mapping[str, object]) -> tuple[str, ...]:
    """Returns the files a cell.toml names: of the arm, of the controller, model of its parts.

    Args:
        tables: Of the file; whether they are a cell's is not checked here.
    """
    files = _table(tables, "controller").get("files", [])
    names = [
        *(_table(tables, "robot").get(key) for key in _ARM_FILES),
        *(files if isinstance(files, list) else [files]),
        _table(_table(tables, "registration"), "model").get("file"),
    ]
    return tuple(name for name in names if isinstance(name, str) and name)


def _table(tables: Mapping[str, object], name: str) -> Mapping[str, object]:
    table = tables.get(name)
    return table if isinstance(table, Mapping) else {}


def rename_files(text: str, rename: Callable[[str], str]) -> str:
    """Returns a cell.toml's text with other names of the files that :func:`named_files` lists."""
    document = tomlkit.parse(text)
    if not named_files(document):
        return text
    robot, files = document.get("robot", {}), document.get("controller", {}).get("files", [])
    model = document.get("registration", {}).get("model", {})
    for key in _ARM_FILES:
        if robot.get(key):
            robot[key] = rename(str(robot[key]))
    for place, name in enumerate(list(files)):
        files[place] = rename(str(name))
    if model.get("file"):
        model["file"] = rename(str(model["file"]))
    return tomlkit.dumps(document)


def plain_names(text: str) -> tuple[str, dict[str, str]]:
    """Returns a cell.toml's text that names its files without folders, and those names.

    Returns:
        The text, and for each new name the one it had. Two files of one name get numbers.
    """
    taken: dict[str, str] = {}

    def rename(stated: str) -> str:
        plain = PurePosixPath(stated.replace("\\", "/")).name
        name, number = plain, 1
        while taken.get(name, stated) != stated or name == "cell.toml":
            number += 1
            name = f"{number}_{plain}"
        taken[name] = stated
        return name

    return rename_files(text, rename), taken
