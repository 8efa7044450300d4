"""The tables ``[registration]`` and ``[[part]]`` of a cell.toml: read, written, taken out."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Final

import numpy as np

from robotrue.cell.part import PartFrame, PartTable
from robotrue.cell.schema import CellFile, PartFrameTable
from robotrue.core.arrays import Array
from robotrue.core.identity import ModelIdentity
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.provenance import Provenance, SourceFile
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

HEADING: Final = "# Registered by touching; written by `robotrue register`, whole. Do not edit.\n"
_TABLE: Final = re.compile(
    r"^[ \t]*\[\[?[ \t]*(part|registration([ \t]*\.[ \t]*model)?)[ \t]*\]\]?", re.MULTILINE
)
_URDF: Final = re.compile(r"^([ \t]*urdf[ \t]*=[ \t]*)(\"[^\"\n]*\"|'[^'\n]*')", re.MULTILINE)
_FILES: Final = re.compile(r"^([ \t]*files[ \t]*=[ \t]*\[)([^\]]*)(\])", re.MULTILINE)
_ANY: Final = re.compile(r"^[ \t]*\[\[?[ \t]*[A-Za-z_][\w. \t-]*\]\]?[ \t]*(#.*)?$", re.MULTILINE)


def part_of(file: CellFile) -> PartTable | None:
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
        frames=tuple(_frame(table) for table in file.part),
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


def _frame(table: PartFrameTable) -> PartFrame:
    return PartFrame(
        name=table.name,
        T_base_part=pose_from_xyz_abc(np.array(table.xyz_mm) * MM, np.array(table.abc_deg) * DEG),
        covariance=np.array(table.covariance_m_rad),
        touches=table.touches,
        outliers=tuple(table.outliers),
        rms=table.rms_mm * MM,
        verdict=table.verdict,
    )


def part_text(part: PartTable) -> str:
    """Returns the tables as TOML; equal content gives equal text, every number with all digits."""
    made = part.identity
    lines = [
        HEADING.rstrip("\n"),
        "[registration]",
        f"method = {_quoted(part.method)}",
        f"points_file = {_quoted(part.points_file)}",
        f"points_sha256 = {_quoted(part.points_sha256)}",
        *_origin_lines(part.provenance),
        "",
        "[registration.model]              # programs of another model are refused",
        f"kind = {_quoted(made.kind)}",
        f"robot = {_quoted(made.robot)}",
        f"sha256 = {_quoted(made.sha256)}",
        f"file = {_quoted(part.model_file)}",
    ]
    for frame in part.frames:
        lines += ["", *_frame_lines(frame)]
    return "\n".join(lines) + "\n"


def _origin_lines(origin: Provenance) -> list[str]:
    return [
        *(["simulated = true"] if origin.simulated else []),
        *([f"instrument = {_quoted(origin.instrument)}"] if origin.instrument else []),
    ]


def _frame_lines(frame: PartFrame) -> list[str]:
    T = frame.T_base_part
    return [
        "[[part]]",
        f"name = {_quoted(frame.name)}",
        f"xyz_mm = {numbers(T[:3, 3] / MM)}",
        f"abc_deg = {numbers(abc_from_matrix(T[:3, :3]) / DEG)}"
        "    # KUKA A, B, C: Rz(A) Ry(B) Rx(C)",
        f"touches = {frame.touches}",
        f"outliers = [{', '.join(_quoted(name) for name in frame.outliers)}]",
        f"rms_mm = {float(frame.rms / MM)!r}",
        f"verdict = {_quoted(frame.verdict)}",
        "covariance_m_rad = [",
        *(f"  {numbers(row)}," for row in frame.covariance),
        "]",
    ]


def numbers(values: Array) -> str:
    """Returns a TOML list of floats, every digit kept, no negative zero."""
    return "[" + ", ".join(repr(float(v) + 0.0) for v in np.asarray(values).ravel()) + "]"


def _quoted(text: str) -> str:
    # What JSON escapes in a string is what TOML escapes.
    return json.dumps(text)


def without_part(text: str) -> str:
    """Returns a cell.toml's text without its registration; everything else as it stands."""
    out, at = "", 0
    for match in _TABLE.finditer(text):
        if match.start() < at:
            continue
        out += text[at : match.start()]
        following = _ANY.search(text, match.end())
        at = len(text) if following is None else following.start()
    out = (out + text[at:]).replace(HEADING, "")
    return out.rstrip() + "\n"


def with_part(text: str, part: PartTable) -> str:
    """Returns a cell.toml's text with these tables in place of any it had."""
    return without_part(text) + "\n" + part_text(part)


def with_files(text: str, moved: Callable[[str], str]) -> str:
    """Returns a cell.toml's text with other paths of the files of its controller."""

    def all_moved(match: re.Match[str]) -> str:
        quoted = re.sub(r"\"([^\"\n]*)\"|'([^'\n]*)'", one_moved, match[2])
        return match[1] + quoted + match[3]

    def one_moved(match: re.Match[str]) -> str:
        return _quoted(moved(match[1] or match[2] or ""))

    return _FILES.sub(all_moved, text, count=1)


def with_urdf(text: str, path: str) -> str:
    """Returns a cell.toml's text with another path of its URDF file."""
    return _URDF.sub(lambda match: match[1] + _quoted(path), text, count=1)
