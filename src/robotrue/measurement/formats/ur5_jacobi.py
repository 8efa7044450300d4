"""UR5 with a reflector (Jacobi): target and target minus actual, in the robot base."""

from __future__ import annotations

from typing import Final

from robotrue.measurement.formats.mapping import ColumnMapping

UR5: Final = ColumnMapping(
    name="ur5-jacobi",
    joints=("joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6"),
    position=("x_t", "y_t", "z_t"),
    position_minus=("x_dif", "y_dif", "z_dif"),
)
