"""A cell as the text of a cell.toml, for cells that come out of a model file and have none."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.cell.cell import DEFAULT_TARGET_SIGMA, Cell
from robotrue.cell.controller_text import controller_text
from robotrue.cell.toml_text import number, numbers
from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION
from robotrue.robot.identity import nominal_identity
from robotrue.robot.makers import MAKERS
from robotrue.robot.model import Configuration, RobotModel
from robotrue.robot.presets import preset, preset_names

HEADING: Final = "# Written by robotrue from the cell kept in a model file.\n"


def cell_text(cell: Cell) -> str:
    """Returns the cell as TOML; equal cells give equal text, every number with all digits.

    Obstacles, the reflector's axis and the tracker's rough place are for planning and are not kept
    in model files; they are left out.

    Raises:
        ConfigurationError: An arm that no cell.toml can describe: coupled joints.
    """
    lines = [HEADING + "schema = 1", "", *_robot(cell)]
    lines += ["", "[tool]", *_pose(cell.robot.T_flange_tool)]
    lines += [
        "",
        "[payload]",
        f"mass_kg = {number(cell.payload.mass[0])}",
        f"centre_of_mass_mm = {numbers(cell.payload.com[0] / MM)}",
        "",
        "[repeatability]",
        f"mm = {number(cell.repeatability / MM)}",
    ]
    if cell.target_sigma != DEFAULT_TARGET_SIGMA or not np.array_equal(
        cell.T_flange_target, cell.robot.T_flange_tool
    ):
        lines += [
            "",
            "[target]",
            f"xyz_mm = {numbers(cell.T_flange_target[:3, 3] / MM)}",
            f"sigma_mm = {number(cell.target_sigma / MM)}",
        ]
    if not np.array_equal(cell.T_base_frame, np.eye(4)) and cell.part is None:
        lines += ["", "[base]", *_pose(cell.T_base_frame)]
    lines += ["", *_tracker(cell)]
    if cell.says_of_controller:
        lines += controller_text(cell.controller)
    return "\n".join(lines) + "\n"


def _pose(T: Array) -> list[str]:
    return [
        f"xyz_mm = {numbers(T[:3, 3] / MM)}",
        f"abc_deg = {numbers(abc_from_matrix(T[:3, :3]) / DEG)}",
    ]


def _robot(cell: Cell) -> list[str]:
    robot = cell.robot
    base = _like_preset(robot)
    lines = ["[robot]"]
    if base is not None:
        lines.append(f'preset = "{base.name}"')
    else:
        lines += _dh(robot)
    for key, values, known, unit in (
        ("limits_deg", robot.limits, None if base is None else base.limits, DEG),
        ("mass_kg", robot.link_mass, None if base is None else base.link_mass, 1.0),
        ("centre_of_mass_mm", robot.link_com, None if base is None else base.link_com, MM),
    ):
        if known is None or not np.array_equal(values, known):
            rows = ", ".join(
                numbers(row / unit) if values.ndim > 1 else number(row / unit) for row in values
            )
            lines.append(f"{key} = [{rows}]")
    if base is None or not np.array_equal(robot.gravity, base.gravity):
        lines.append(f"gravity_m_per_s2 = {numbers(robot.gravity)}")
    if np.isfinite(cell.compliance_prior).all():
        lines.append(f"stiffness_Nm_per_rad = {numbers(1.0 / cell.compliance_prior)}")
    return lines


def _like_preset(robot: RobotModel) -> RobotModel | None:
    """Returns the preset with this arm's geometry, maker and count of joints."""
    if robot.name not in preset_names():
        return None
    found = preset(robot.name)
    same = nominal_identity(found).same(nominal_identity(robot)) and found.maker == robot.maker
    return found if same and _counting(found) == _counting(robot) else None


def _counting(robot: RobotModel) -> tuple[list[float], list[float]]:
    own = robot.controller or Configuration(sign=np.ones(robot.dof), offset=np.zeros(robot.dof))
    return own.sign.tolist(), own.offset.tolist()


def _dh(robot: RobotModel) -> list[str]:
    if not np.array_equal(robot.joint_map, np.eye(robot.dof)):
        raise ConfigurationError(
            f"{robot.name} has coupled joints, which cell.toml cannot say.",
            hint="register with the cell.toml of this robot instead of the model file's cell.",
        )
    rows = [
        f"  {{theta_deg = {number(t / DEG)}, alpha_deg = {number(al / DEG)}, "
        f"d_mm = {number(d / MM)}, a_mm = {number(a / MM)}}},"
        for t, al, d, a in zip(robot.theta, robot.alpha, robot.d, robot.a, strict=True)
    ]
    lines = [f'convention = "{robot.convention}"', "dh = [", *rows, "]"]
    named = robot.maker in MAKERS
    if named:
        lines.append(f'maker = "{robot.maker}"')
    sign, offset = _counting(robot)
    if named or (sign, offset) != ([1.0] * robot.dof, [0.0] * robot.dof):
        lines.append(f"axes_sign = [{', '.join(str(int(each)) for each in sign)}]")
        lines.append(f"axes_offset_deg = {numbers(np.array(offset) / DEG)}")
    return lines


def _tracker(cell: Cell) -> list[str]:
    lines = ["[tracker]", f'frame = "{"base" if cell.frame == "base" else "unknown"}"']
    if cell.tracker_position is not None and (
        cell.frame == "base" or np.any(cell.tracker_position != 0.0)
    ):
        lines.append(f"xyz_mm = {numbers(cell.tracker_position / MM)}")
    if cell.tracker != DEFAULT_SPECIFICATION:
        sigma = (cell.tracker.range_bound, cell.tracker.range_bound_per_m)
        lines += [
            f"sigma_um = {number(sigma[0] / cell.tracker.divisor / UM)}",
            f"sigma_um_per_m = {number(sigma[1] / cell.tracker.divisor / UM)}",
        ]
    return lines
