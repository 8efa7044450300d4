"""Column mapping of a file: the whole difference between one instrument and another.

A mapping is a TOML file of the fields of :class:`ColumnMapping`: the user's own, or one of the
known layouts in the folder ``layouts``, which are named by their files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, TypeAlias, get_args

from robotrue.core.document_decoder import decode
from robotrue.core.extensions import extension_files
from robotrue.core.files import read_toml
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.joined_sheet import JointList, build_joint_list
from robotrue.measurement.formats.sheet import HEADER_LINES
from robotrue.measurement.measurement_set import MeasurementFrame

AngleUnit: TypeAlias = Literal["deg", "rad"]
LengthUnit: TypeAlias = Literal["mm", "m", "um", "inch"]
RepeatRule: TypeAlias = Literal["rows", "mean"]
"""Rule for several shots of one pose: a row each, or one row of their mean."""
AxisSense: TypeAlias = Literal["model", "controller"]
"""Whether columns of joints hold those of the robot model, or the axes the controller shows."""
RotationForm: TypeAlias = Literal[
    "rz_ry_rx", "wpr", "rpy", "abc", "rx_ry_rz", "oat", "rotation_vector", "wxyz", "xyzw"
]
"""How three (or four) printed numbers make a matrix.

``rz_ry_rx``: columns rx, ry, rz and R = Rz(rz) Ry(ry) Rx(rx); the same are ``wpr`` (Fanuc's W, P,
R) and ``rpy`` (roll, pitch, yaw); ``abc``: KUKA's columns A, B, C and R = Rz(A) Ry(B) Rx(C);
``rx_ry_rz``: columns rx, ry, rz and R = Rx(rx) Ry(ry) Rz(rz) (intrinsic XYZ: Leica T-Mac, Staubli);
``oat``: Kawasaki's O, A, T and R = Rz(O) Ry(A) Rz(T); ``rotation_vector``: Universal Robots;
``wxyz``, ``xyzw``: unit quaternions, scalar first (ABB) or last (Leica, ROS).
"""

ANGLE: Final[Mapping[str, float]] = {"deg": DEG, "rad": 1.0}
LENGTH: Final[Mapping[str, float]] = {"mm": MM, "m": 1.0, "um": UM, "inch": 25.4 * MM}
GROUPS: Final = (
    "joints",
    "position",
    "position_minus",
    "rotation",
    "position_std",
    "position_correlation",
    "rotation_std",
    "force",
    "moment",
    "approach",
    "temperature",
    "joint_temperature",
    "time",
    "timestamp",
    "external",
    "payload_mass",
    "payload_com",
    "target",
    "station",
    "set_name",
    "point_name",
)
"""Fields of a mapping that name columns."""
ONE_COLUMN: Final = (
    "temperature",
    "time",
    "timestamp",
    "payload_mass",
    "target",
    "station",
    "set_name",
    "point_name",
)
"""Those that name one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMapping:
    """Columns with their units and signs. Names are compared without case.

    ``position = sign * (columns - columns of position_minus) + offset``, then the unit;
    ``joints = sign * columns + offset`` likewise.

    Attributes:
        name: Name of the layout.
        joints: One column per joint.
        position: x, y, z of the measured point.
        position_minus: Columns subtracted from them: a file with target and "target minus actual"
            gives the actual point as ``position`` = target, ``position_minus`` = difference.
        rotation: Measured orientation.
        position_std: Standard deviations of x, y, z (one sigma).
        position_correlation: Covariances xy, xz, yz in the square of the length unit.
        rotation_std: Standard deviations of the three printed angles (one sigma).
        force: fx, fy, fz in N on the tool, base axes.
        moment: mx, my, mz in N m at the tool point, base axes.
        approach: Sign of the last motion of each joint: -1, 0, 1.
        temperature: One column, deg C of the arm as a whole.
        joint_temperature: One column per joint, deg C.
        time: One column, s on any clock.
        timestamp: One column, date and time of day (ISO 8601), in place of ``time``.
        external: Up to six columns, external axes E1 and on; their names end in the unit: ``_mm``,
            or ``_deg`` of rotary ones. An empty name: no such column.
        payload_mass: One column, kg at the flange.
        payload_com: x, y, z of its centre of mass in the flange frame.
        target: One column, number of the reflector.
        station: One column, number of the instrument set-up.
        set_name: One column, name of the set (campaign, block) a row belongs to.
        point_name: One column, name of the measured point.
        monuments: Names of points on the floor, re-shot during the run to show how the frame of the
            instrument moves; ``*`` matches any letters. Such rows need no joints.
        repeats: ``"mean"``: shots of one pose become one row, their mean.
        joints_unit: Unit of ``joints``.
        axes: ``"controller"``: the columns of ``joints`` hold the axes the controller shows, whose
            convention the robot states; ``joints_sign`` and ``joints_offset`` are then empty.
        joints_sign: +1 or -1 per joint; empty is +1.
        joints_offset: Per joint, in the file's unit; empty is 0.
        position_unit: Unit of ``position``, its deviations and ``payload_com``.
        position_sign: +1 or -1 per axis.
        position_offset: In the file's unit.
        rotation_unit: Unit of ``rotation`` and ``rotation_std``.
        rotation_form: Convention of the numbers.
        rotation_inverse: The file has the inverse: the frame as seen from the target (conjugate
            quaternions).
        factors: By group: its columns are multiplied by it, first (U95 to sigma: 0.5).
        frame: Frame of position and rotation if the caller states none.
        constants: Columns missing from the file, with one value for all rows.
        optional: Groups that may be absent as a whole.
        ignore: Columns to ignore although their names resemble known columns.
        ignore_other: Whether unknown columns are ignored; otherwise they are an error.
        delimiter: Between cells, None detects it; ``" "`` is any run of blanks.
        decimal: ``"."`` or ``","``, None detects it.
        encoding: None detects it.
        skip_lines: Lines before the header.
        header: False names the columns "1", "2", ...
        header_lines: Lines of the header; their words above each other make one name.
        worksheet: Sheet of a workbook; None is the only one with values.
        joint_list: Second file that holds the joints; ``joints`` may then be empty: they are found
            by their names there.
    """

    name: str
    joints: tuple[str, ...]
    position: tuple[str, ...]
    position_minus: tuple[str, ...] = ()
    rotation: tuple[str, ...] = ()
    position_std: tuple[str, ...] = ()
    position_correlation: tuple[str, ...] = ()
    rotation_std: tuple[str, ...] = ()
    force: tuple[str, ...] = ()
    moment: tuple[str, ...] = ()
    approach: tuple[str, ...] = ()
    temperature: tuple[str, ...] = ()
    joint_temperature: tuple[str, ...] = ()
    time: tuple[str, ...] = ()
    timestamp: tuple[str, ...] = ()
    external: tuple[str, ...] = ()
    payload_mass: tuple[str, ...] = ()
    payload_com: tuple[str, ...] = ()
    target: tuple[str, ...] = ()
    station: tuple[str, ...] = ()
    set_name: tuple[str, ...] = ()
    point_name: tuple[str, ...] = ()
    monuments: tuple[str, ...] = ()
    repeats: RepeatRule = "rows"
    joints_unit: AngleUnit = "deg"
    axes: AxisSense = "model"
    joints_sign: tuple[float, ...] = ()
    joints_offset: tuple[float, ...] = ()
    position_unit: LengthUnit = "mm"
    position_sign: tuple[float, ...] = (1.0, 1.0, 1.0)
    position_offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    rotation_unit: AngleUnit = "deg"
    rotation_form: RotationForm = "rz_ry_rx"
    rotation_inverse: bool = False
    factors: Mapping[str, float] = field(default_factory=dict)
    frame: MeasurementFrame = "base"
    constants: Mapping[str, float] = field(default_factory=dict)
    optional: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    ignore_other: bool = True
    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    skip_lines: int = 0
    header: bool = True
    header_lines: int = HEADER_LINES
    worksheet: str | None = None
    joint_list: JointList | None = None

    def __post_init__(self) -> None:
        """Checks how many columns each group names, and every unit.

        Raises:
            ConfigurationError: A group of the wrong length, an unknown unit or group name.
        """
        object.__setattr__(self, "constants", MappingProxyType(dict(self.constants)))
        object.__setattr__(self, "factors", MappingProxyType(dict(self.factors)))
        dof = len(self.joints)
        if dof == 0 and self.joint_list is None:
            raise ConfigurationError(f"mapping {self.name!r} names no joint columns.")
        for group in GROUPS:
            have, count = len(getattr(self, group)), self.count(group)
            if have not in (0, count):
                raise ConfigurationError(
                    f"mapping {self.name!r}: {group} names {have} columns, expected {count}."
                )
        for group, count in (("joints_sign", dof), ("joints_offset", dof)):
            if len(getattr(self, group)) not in (0, count):
                raise ConfigurationError(f"mapping {self.name!r}: {group} needs {count} values.")
        for group in ("position_sign", "position_offset"):
            if len(getattr(self, group)) != 3:
                raise ConfigurationError(f"mapping {self.name!r}: {group} needs 3 values.")
        if self.axes == "controller" and (self.joints_sign or self.joints_offset):
            raise ConfigurationError(
                f"mapping {self.name!r}: joints_sign or joints_offset beside axes = "
                '"controller", which is the robot\'s own relation.',
                hint="state one of the two.",
            )
        self._check_words()

    def _check_words(self) -> None:
        for name, words in (
            ("joints_unit", get_args(AngleUnit)),
            ("axes", get_args(AxisSense)),
            ("repeats", get_args(RepeatRule)),
            ("rotation_unit", get_args(AngleUnit)),
            ("position_unit", get_args(LengthUnit)),
            ("rotation_form", get_args(RotationForm)),
            ("frame", get_args(MeasurementFrame)),
            ("decimal", (None, ".", ",")),
        ):
            if getattr(self, name) not in words:
                raise ConfigurationError(
                    f"mapping {self.name!r}: {name} is {getattr(self, name)!r}, "
                    f"allowed: {', '.join(str(w) for w in words if w)}."
                )
        for group in self.optional:
            if group not in GROUPS:
                raise ConfigurationError(f"mapping {self.name!r}: no group {group!r} to leave out.")
        if self.monuments and not self.point_name:
            raise ConfigurationError(
                f"mapping {self.name!r}: monuments {', '.join(self.monuments)} and no point_name.",
                hint='state the column of the names: point_name = "Name".',
            )
        for group, factor in self.factors.items():
            if group not in GROUPS or not isinstance(factor, int | float) or not factor:
                raise ConfigurationError(
                    f"mapping {self.name!r}: factor {factor!r} of {group!r}, expected a number "
                    f"for one of {', '.join(GROUPS)}."
                )

    def count(self, group: str) -> int:
        """Returns the number of columns of a group."""
        if group in ("joints", "approach", "joint_temperature"):
            return len(self.joints)
        if group in ONE_COLUMN:
            return 1
        if group == "external":
            return len(self.external)
        return 4 if group == "rotation" and self.rotation_form in ("wxyz", "xyzw") else 3

    def columns(self, *, required_only: bool = False) -> tuple[str, ...]:
        """Returns the names of the columns in the mapping, without the constant ones."""
        return tuple(
            name
            for group in GROUPS
            if not (required_only and group in self.optional)
            for name in getattr(self, group)
            if name and name not in self.constants
        )


def read_mapping(path: Path) -> ColumnMapping:
    """Returns a column mapping written as TOML: the fields of ``ColumnMapping``, nothing else.

    Raises:
        ConfigurationError: Not TOML, an unknown field or a value it cannot take.
        FormatError: The file cannot be read.
    """
    stated, _ = read_toml(path, example="the guide on importing a tracker file")
    return build_mapping({"name": path.stem} | stated, path)


def build_mapping(stated: Mapping[str, object], source: Path | None = None) -> ColumnMapping:
    """Returns a column mapping from its fields by name, as TOML or JSON has them.

    Raises:
        ConfigurationError: An unknown field or a value it cannot take.
    """
    known = sorted(field.name for field in fields(ColumnMapping))
    unknown = sorted(set(stated) - set(known))
    if unknown:
        raise ConfigurationError(
            f"unknown key {unknown[0]!r} in a column mapping; known are {', '.join(known)}.",
            source=source,
        )
    stated = {key: value for key, value in stated.items() if key != "joint_list"} | (
        {"joint_list": build_joint_list(stated["joint_list"], source)}
        if stated.get("joint_list") is not None
        else {}
    )
    if "joint_list" in stated:
        stated = {"joints": ()} | stated
    values: dict[str, object] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()
    }
    for group in (*GROUPS, "optional", "ignore", "monuments"):  # one column needs no list
        if isinstance(values.get(group), str):
            values[group] = (values[group],)
    return decode(ColumnMapping, values, key="mapping", error=ConfigurationError, source=source)


@cache
def read_layouts() -> Mapping[str, ColumnMapping]:
    """Returns the known layouts by name; the one with more required columns comes first.

    It is the more certain match. A package outside adds the layouts of its instruments by an entry
    point of the group ``robotrue.instruments`` that names the folder of its mappings, a ``Path``.
    The canonical layout depends on the number of joints and is not among them.
    """
    own = sorted(Path(__file__).with_name("layouts").glob("*.toml"))
    files = [*own, *extension_files("robotrue.instruments")]
    layouts = sorted(map(read_mapping, files), key=lambda layout: -len(layout.columns()))
    return MappingProxyType({layout.name: layout for layout in layouts})


_JOINT: Final = re.compile(
    r"(?:j|a|q|axis|joint|theta)[ _]*([1-9])(?:[ _]*\[?(deg|rad|°)\]?)?", re.IGNORECASE
)
_AXIS: Final = re.compile(r"(?:.*[ _])?([xyz])(?:[ _]*\[?(mm|m|um|µm)\]?)?", re.IGNORECASE)


def guess_columns(header: Sequence[str]) -> tuple[dict[int, str], dict[str, str]]:
    """Returns the column of each joint by its number from 1, and that of x, y, z by its letter."""
    joints: dict[int, str] = {}
    axes: dict[str, str] = {}
    for name in header:
        if joint := _JOINT.fullmatch(name.strip()):
            joints.setdefault(int(joint[1]), name)
        elif axis := _AXIS.fullmatch(name.strip()):
            axes.setdefault(axis[1].lower(), name)
    return joints, axes


def guess_units(header: Sequence[str]) -> dict[str, str]:
    """Returns ``joints_unit``, ``position_unit`` and ``axes`` of a mapping, as far as names go."""
    joints, axes = guess_columns(header)
    units: dict[str, str] = {}
    for name in joints.values():
        match = _JOINT.fullmatch(name.strip())
        if match and match[2]:
            units["joints_unit"] = "rad" if match[2].lower() == "rad" else "deg"
        if name.strip()[:1] in "Aa":  # A1 to A6: as a pendant shows them
            units["axes"] = "controller"
    for name in axes.values():
        match = _AXIS.fullmatch(name.strip())
        if match and match[2]:
            units["position_unit"] = match[2].lower().replace("µ", "u")
    return units
