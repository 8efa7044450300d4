"""Frames and tools from the files of a controller that lie beside a program.

Each language says which files its controllers save and how they are read; binary files (Fanuc's
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

_SAME: Final = 1e-6
"""m and rad; a frame that differs by less is the one printed with fewer digits."""


def frame_file_names() -> frozenset[str]:
    """Returns the names, in lower case, of all files that hold frames and no program."""
    kinds = [language.frame_files for language in languages().values()]
    return frozenset(name.lower() for kind in kinds if kind for name in kind.names)


def read_controller_file(name: str, data: bytes) -> ControllerFile | None:
    """Returns the frames of a file, told by its content; None if it is none that is known.

    Raises:
        FormatError: A frame of which not all six numbers can be read, with its line.
    """
    text = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    kinds = (language.frame_files for language in languages().values())
    kind = next((kind for kind in kinds if kind and kind.recognise(text)), None)
    return None if kind is None else kind.read(name, text)


def with_files_beside(path: Path, dialect: str, given: FrameTable) -> tuple[FrameTable, list[str]]:
    """Returns the table with what files beside a program hold, and what to say of it.

    What the cell says goes before what a file says.

    Raises:
        FormatError: A file that cannot be read.
    """
    bases, tools = dict(given.bases), dict(given.tools)
    notes: list[str] = []
    kind = find_language(dialect).frame_files
    wanted = {name.lower() for name in kind.names} if kind else set()
    folder = sorted(path.parent.iterdir()) if wanted and path.parent.is_dir() else []
    for beside in folder:
        if beside.name.lower() not in wanted or beside.name == path.name or not beside.is_file():
            continue
        found = read_controller_file(beside.name, read_bytes(beside))
        if found is None:
            continue
        notes += found.notes
        for side, have, new in (("base", bases, found.bases), ("tool", tools, found.tools)):
            notes += _differing(side, beside.name, have, new)
            have.update({key: matrix for key, matrix in new.items() if key not in have})
    return replace(given, bases=bases, tools=tools), notes


def _differing(
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
