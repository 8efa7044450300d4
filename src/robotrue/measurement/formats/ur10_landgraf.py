"""UR10 with a T-Mac (Landgraf et al., CASE 2021): full pose in a tracker frame not stated."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from robotrue.measurement.formats.mapping import ColumnMapping

SERIES_A: Final = ColumnMapping(
    name="ur10-landgraf",
    joints=(
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ),
    joints_unit="rad",
    position=("measurement_x", "measurement_y", "measurement_z"),
    rotation=("measurement_rx", "measurement_ry", "measurement_rz"),
    rotation_form="rx_ry_rz",
    temperature=("measurement_temperature",),
    frame="tracker",
    decimal=",",
)
SERIES_B: Final = replace(
    SERIES_A,
    name="ur10-landgraf-std",
    position_std=("measurement_std_x", "measurement_std_y", "measurement_std_z"),
    rotation_std=("measurement_std_rx", "measurement_std_ry", "measurement_std_rz"),
)
