"""The keys of cell.toml, their types and their defaults, in the file's own units.

Only the readers of cell.toml import this file; pydantic is slow to load.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidatorFunctionWrapHandler, WrapValidator


def _number_or_nan(value: object, check: ValidatorFunctionWrapHandler) -> object:
    return value if value != value else check(value)  # NaN alone differs from itself


Number = Annotated[float, Field(allow_inf_nan=False)]
Length = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Above0 = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Above0OrNan = Annotated[Above0, WrapValidator(_number_or_nan)]
Angle180 = Annotated[float, Field(gt=0.0, le=180.0, allow_inf_nan=False)]
Three = Annotated[list[Number], Field(min_length=3, max_length=3)]
Four = Annotated[list[Number], Field(min_length=4, max_length=4)]
Two = Annotated[list[Number], Field(min_length=2, max_length=2)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class DhRow(_Table):
    """One row of a DH table."""

    theta_deg: Number
    alpha_deg: Number
    d_mm: Number
    a_mm: Number
    beta_deg: Number = 0.0


class RobotTable(_Table):
    """``[robot]``: a preset, a URDF file, or a DH table; the lists have one entry per joint."""

    preset: str | None = None
    ur_calibration: str | None = None
    urdf: str | None = None
    convention: Literal["dh", "mdh"] | None = None
    dh: Annotated[list[DhRow], Field(min_length=1)] | None = None
    maker: Literal["kuka", "abb", "fanuc", "yaskawa", "ur", "staubli"] | None = None
    axes_sign: list[Literal[1, -1]] | None = None
    axes_offset_deg: list[Number] | None = None
    limits_deg: list[Two] | None = None
    total_mass_kg: Above0 | None = None
    mass_kg: list[Length] | None = None
    centre_of_mass_mm: list[Three] | None = None
    joint_map: list[list[Number]] | None = None
    stiffness_Nm_per_rad: list[Above0OrNan] | None = None
    gravity_m_per_s2: Three | None = None
    link_radius_mm: list[Above0] | None = None


class PoseTable(_Table):
    """``[tool]`` and ``[base]``."""

    xyz_mm: Three = [0.0, 0.0, 0.0]
    abc_deg: Three = [0.0, 0.0, 0.0]


class PayloadTable(_Table):
    """``[payload]``."""

    mass_kg: Length = 0.0
    centre_of_mass_mm: Three = [0.0, 0.0, 0.0]


class TargetTable(_Table):
    """``[target]``."""

    xyz_mm: Three
    sigma_mm: Above0 = 10.0
    axis: Three | None = None
    acceptance_deg: Angle180 | None = None


class TrackerTable(_Table):
    """``[tracker]``."""

    frame: Literal["base", "unknown"] = "base"
    xyz_mm: Three | None = None
    place_mm: Three | None = None
    name: str = ""
    sigma_um: Length | None = None
    sigma_um_per_m: Length | None = None


class ObstacleTable(_Table):
    """``[[obstacle]]``: one body that the arm must not touch and the tracker cannot see through."""

    name: str = ""
    box_mm: Annotated[list[Three], Field(min_length=2, max_length=2)] | None = None
    sphere_mm: Annotated[list[Number], Field(min_length=4, max_length=4)] | None = None
    below_mm: Annotated[list[Three], Field(min_length=2, max_length=2)] | None = None


class IdentityTable(_Table):
    """``[registration.model]``: the description of the arm that touched the part."""

    kind: Literal["nominal", "calibrated"]
    robot: str
    sha256: str
    file: str = ""


class RegistrationTable(_Table):
    """``[registration]``: where the ``[[part]]`` tables come from."""

    method: str
    points_file: str = ""
    points_sha256: str = ""
    simulated: bool = False
    instrument: str = ""
    model: IdentityTable


class PartFrameTable(_Table):
    """``[[part]]``: a part, or one side of it, where touching found it."""

    name: str
    xyz_mm: Three
    abc_deg: Three
    covariance_m_rad: Annotated[
        list[Annotated[list[Number], Field(min_length=6, max_length=6)]],
        Field(min_length=6, max_length=6),
    ]
    touches: Annotated[int, Field(ge=0)]
    outliers: list[str] = []
    rms_mm: Length
    verdict: Literal["GO", "NO-GO"]


class RepeatabilityTable(_Table):
    """``[repeatability]``."""

    mm: Length = 0.06


class NamedFrameTable(_Table):
    """``[[controller.base]]`` and ``[[controller.tool]]``: one entry of the controller's tables."""

    number: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    name: str | None = None
    xyz_mm: Three = [0.0, 0.0, 0.0]
    abc_deg: Three | None = None
    wpr_deg: Three | None = None
    quaternion: Four | None = None


class ExternalTable(_Table):
    """``[[controller.external]]``: one axis that carries the robot or work frames."""

    axis: Annotated[int, Field(ge=1, le=6)]
    name: str = ""
    along: Three | None = None
    about: Three | None = None
    through_mm: Three | None = None
    at_mm: Number | None = None
    at_deg: Number | None = None
    carries: list[str] = []
    pulses_per_mm: Number | None = None
    pulses_per_degree: Number | None = None


class ControllerTable(_Table):
    """``[controller]``: what programs name and the controller holds."""

    files: list[str] = []
    pulses_per_degree: Annotated[list[Number], Field(min_length=6, max_length=6)] | None = None
    external_axes_at_rest: bool = False
    fixed_tool: Literal["tool_in_part", "part_in_tool"] | None = None
    angles: Literal["rpy", "kuka"] | None = None
    cutter: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    spin_deg: Number | None = None
    start_deg: Annotated[list[Number], Field(min_length=6, max_length=6)] | None = None
    harmless_routines: list[str] = []
    units_without_point: Literal["mm", "increment"] | None = None
    base: list[NamedFrameTable] = []
    tool: list[NamedFrameTable] = []
    external: list[ExternalTable] = []


class CellFile(_Table):
    """The whole file."""

    schema_: Annotated[Literal[1], Field(alias="schema")]
    robot: RobotTable
    tool: PoseTable | None = None
    payload: PayloadTable = PayloadTable()
    target: TargetTable | None = None
    tracker: TrackerTable = TrackerTable()
    repeatability: RepeatabilityTable = RepeatabilityTable()
    base: PoseTable = PoseTable()
    obstacle: list[ObstacleTable] = []
    controller: ControllerTable = ControllerTable()
    registration: RegistrationTable | None = None
    part: list[PartFrameTable] = []
