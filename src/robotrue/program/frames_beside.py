"""Frames and tools from the files of a controller next to a program.

Each language defines the files that its controllers save and their reader; binary files (Fanuc's
``.SV`` and ``.VR``) and the pulse ratios in Yaskawa's ``ALL.PRM`` are not read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.units import MM
from robotrue.program.controller_files import ControllerFile
from robotrue.program.lang import find_language, languages
from robotrue.program.program import FrameTable

_SYSTEM: Final = ("System", "SYSTEM", "Mada", "MaDa", "MADA")
"""Folders of a KUKA controller next to that of its programs."""
_ABOVE: Final = 3
_SAME: Final = 1e-6
"""m and rad; a frame that differs by less is the one printed with fewer digits."""


def frame_file_names() -> frozenset[str]:
    """Returns the names, in lower case, of all files that hold frames and no program."""
    kinds = [language.frame_files for language in languages().values()]
    return frozenset(name.lower() for kind in kinds if kind for name in kind.names)


def read_controller_file(name: str, data: bytes) -> ControllerFile | None:
    """Returns the frames of a file, recognised by its content; None if it is unknown.

    Raises:
        FormatError: A frame of which not all six numbers can be read, with its line.
    """
    text = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    kinds = (language.frame_files for language in languages().values())
    kind = next((kind for kind in kinds if kind and kind.recognise(text)), None)
    return None if kind is None else kind.read(name, text)


def with_files_beside(
    path: Path, dialect: str, given: FrameTable, *, root: Path | None = None
) -> tuple[FrameTable, list[str]]:
    """Returns the table with the frames of files next to a program, and notes on it.

    The cell overrides a file.

    Args:
        path: A file of the job.
        dialect: Its language.
        given: Frames of the cell.
        root: Folder of the whole job, searched with all below it; only that of the file, and the
            controller's own folders near it, if not given.

    Raises:
        FormatError: A file that cannot be read.
    """
    bases, tools = dict(given.bases), dict(given.tools)
    table, notes, declared = given, list[str](), list[tuple[str, bytes]]()
    found = []
    for beside in _frame_files(path, dialect, root):
        data = read_bytes(beside)
        one = read_controller_file(beside.name, data)
        if one is None:
            continue
        found.append(one)
        if one.declarations:
            declared.append((beside.name, data))
        if one.T_base_world is not None and np.array_equal(table.T_base_world, np.eye(4)):
            table = replace(table, T_base_world=one.T_base_world)
        if one.pulses_per_degree is not None and table.pulses_per_degree is None:
            table = replace(table, pulses_per_degree=one.pulses_per_degree)
    for one in found:
        notes += one.notes
        in_base = {key: table.T_base_world @ matrix for key, matrix in one.bases.items()}
        for side, have, new in (("base", bases, in_base), ("tool", tools, one.tools)):
            notes += _find_differing(side, one.name, have, new)
            have.update({key: matrix for key, matrix in new.items() if key not in have})
    return replace(table, bases=bases, tools=tools, declarations=tuple(declared)), notes


def _frame_files(path: Path, dialect: str, root: Path | None) -> list[Path]:
    """Returns the files of the controller that belong to a job, those next to it first.

    Of files of one name in several folders the nearest counts.
    """
    kind = find_language(dialect).frame_files
    wanted = {name.lower() for name in kind.names} if kind else set()
    if not wanted or not path.parent.is_dir():
        return []
    folders = [path.parent]
    if root is not None:
        folders += [root, *(each for each in sorted(root.rglob("*")) if each.is_dir())]
    else:
        above = list(path.parent.resolve().parents)[:_ABOVE]
        folders += [each / name for each in above for name in _SYSTEM]
    out: dict[str, Path] = {}
    for folder in folders:
        for beside in sorted(folder.iterdir()) if folder.is_dir() else []:
            name = beside.name.lower()
            if name in wanted and name not in out and beside.name != path.name and beside.is_file():
                out[name] = beside
    return list(out.values())


def _find_differing(
    side: str, name: str, have: Mapping[str, Array], new: Mapping[str, Array]
) -> list[str]:
    out = []
    for key, matrix in new.items():
        if key in have and not np.allclose(have[key], matrix, rtol=0.0, atol=_SAME):
            away = float(np.linalg.norm(have[key][:3, 3] - matrix[:3, 3])) / MM
            out.append(
                f"{side} {key} of the cell is used; that of {name} lies {away:.3f} mm from it."
            )
    return out
