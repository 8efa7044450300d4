"""The robot of a cell from a file: a DH table (TOML or CSV), a URDF, a calibration of a UR arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from robotrue.core.files import read_bytes, read_toml
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.sheet_file import WORKBOOKS, read_sheet
from robotrue.robot.presets import preset, preset_names
from robotrue.robot.ur_calibration import joint_gaps, read_joint_frames

URDF: Final = (".urdf", ".xml")
UR_CALIBRATION: Final = (".yaml", ".yml")
TABLES: Final = (".csv", ".tsv", ".txt", *WORKBOOKS)
DH: Final = ("theta_deg", "alpha_deg", "d_mm", "a_mm")
LIMITS: Final = ("low_deg", "high_deg")
SIGN: Final = "axes_sign"
OFFSET: Final = "axes_offset_deg"
EXAMPLE: Final = (
    'convention = "dh"\ndh = [{theta_deg = 0, alpha_deg = -90, d_mm = 500, a_mm = 300}, ...]'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmFile:
    """Content of an arm's file.

    Attributes:
        table: The keys of ``[robot]``.
        files: Content of the files that the table names.
    """

    table: Mapping[str, object]
    files: Mapping[str, bytes] = field(default_factory=dict)


def read_arm(path: Path, *, convention: str, maker: str) -> ArmFile:
    """Reads the file of an arm; the cell checks whether the arm is possible.

    Args:
        path: TOML with the keys of ``[robot]``; a table of the columns ``theta_deg, alpha_deg,
            d_mm, a_mm`` and perhaps ``low_deg, high_deg, axes_sign, axes_offset_deg``, a row per
            joint; a URDF; or the factory calibration (YAML) of an arm of Universal Robots.
        convention: Of such a table, ``dh`` or ``mdh``.
        maker: For the controller's convention of the axes; empty: as the file states, else not
            known.

    Raises:
        ConfigurationError: Another kind of file.
        FormatError: It cannot be read.
    """
    kind = path.suffix.lower()
    counted: dict[str, object] = {"maker": maker} if maker else {}
    if kind in URDF:
        return ArmFile(table={"urdf": path.name, **counted}, files={path.name: read_bytes(path)})
    if kind in UR_CALIBRATION:
        data = read_bytes(path)
        arm = {"preset": _nearest_ur(data, path), "ur_calibration": path.name}
        return ArmFile(table={**arm, **counted}, files={path.name: data})
    if kind == ".toml":
        tables, _ = read_toml(path, example=EXAMPLE)
        stated = tables.get("robot", tables)
        if not isinstance(stated, dict) or "dh" not in stated:
            raise ConfigurationError(
                "no DH table: neither [robot] nor the file itself has the key dh.",
                source=path,
                hint=EXAMPLE,
            )
        return ArmFile(table={**stated, **counted})
    if kind in TABLES:
        return ArmFile(table={**_read_rows(path), "convention": convention, **counted})
    raise ConfigurationError(
        f"a file {path.name!r} of an arm, expected .toml, .csv, .urdf, .xml or .yaml.",
        hint=f"a table with the columns {', '.join(DH)}.",
    )


def _nearest_ur(data: bytes, path: Path) -> str:
    """The preset of Universal Robots whose joints are nearest; the cell checks how near."""
    frames = read_joint_frames(data, path)
    arms = [robot for robot in map(preset, preset_names()) if robot.maker == "ur"]
    return min(arms, key=lambda robot: joint_gaps(robot, frames)[:, 0].max()).name


def _read_rows(path: Path) -> dict[str, object]:
    sheet = read_sheet(path)
    missing = [name for name in DH if not sheet.has(name)]
    if missing:
        raise sheet.lacking_columns(missing, f"columns {', '.join(DH)}; one row a joint.")
    rows = sheet.numbers(DH).tolist()
    stated: dict[str, object] = {"dh": [dict(zip(DH, row, strict=True)) for row in rows]}
    if all(map(sheet.has, LIMITS)):
        stated["limits_deg"] = sheet.numbers(LIMITS).tolist()
    if sheet.has(SIGN):
        stated[SIGN] = [int(sign) for sign in sheet.numbers([SIGN])[:, 0]]
    if sheet.has(OFFSET):
        stated[OFFSET] = sheet.numbers([OFFSET])[:, 0].tolist()
    return stated
