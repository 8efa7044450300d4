"""Packets of a KUKA controller one by one: what a block must hold, row by row."""

from __future__ import annotations

import numpy as np
from single_samples import JointSample, unknown_pose

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.online.blocks import Flag
from robotrue.online.rsi import RobPacket


def joint_sample(packet: RobPacket, host_time: float, flags: Flag = Flag.NONE) -> JointSample:
    """Returns the sample of a packet; its pose is in the frame of RSI_ON.

    Raises:
        FormatError: The packet has no joints.
    """
    if packet.joints_deg is None:
        raise FormatError(
            "RSI packet without AIPos: no joints.",
            hint='<ELEMENT TAG="DEF_AIPos" TYPE="DOUBLE" INDX="INTERNAL"/> under SEND.',
        )
    pose = unknown_pose()
    if packet.pose_mm_deg is not None:
        numbers = np.array(packet.pose_mm_deg)
        if np.isfinite(numbers).all():
            pose = pose_from_xyz_abc(numbers[:3] * MM, numbers[3:] * DEG)
        else:
            flags |= Flag.NOT_FINITE
    return JointSample(
        controller_time=packet.ipoc * 1e-3,
        host_time=host_time,
        joints=np.array(packet.joints_deg) * DEG,
        T_frame_tool=pose,
        sequence=packet.ipoc,
        flags=flags,
    )
