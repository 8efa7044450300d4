"""Packets of a KUKA controller as a block.

What an answer waits for is done packet by packet; what is made of the packets afterwards is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.online.blocks import FARTHEST, MOST_TURNS, Flag, JointBlock, check_joints, check_poses
from robotrue.online.rsi import RobPacket

SeenPacket: TypeAlias = tuple[RobPacket, float, Flag]
"""A packet with joints, s on the host's clock when it came, and what its count says."""
_UNKNOWN: Final = (math.nan,) * 6
_TURNS: Final = 0.9 * MOST_TURNS / DEG
_FAR: Final = 0.9 * FARTHEST / MM


def packet_flags(packet: RobPacket) -> Flag:
    """Returns what is wrong with the values of a packet.

    Raises:
        FormatError: The packet has no joints.
    """
    joints, pose = packet.joints_deg, packet.pose_mm_deg
    # sums: below the limit all are, and none is NaN
    if joints is not None and sum(map(abs, joints)) < _TURNS:
        if pose is None:
            return Flag.NONE
        if sum(map(abs, pose[:3])) < _FAR and sum(map(abs, pose[3:])) < math.inf:
            return Flag.NONE
    if joints is None:
        raise FormatError(
            "RSI packet without AIPos: no joints.",
            hint='<ELEMENT TAG="DEF_AIPos" TYPE="DOUBLE" INDX="INTERNAL"/> under SEND.',
        )
    return Flag(int(rob_block([(packet, 0.0, Flag.NONE)]).flags[0]))


def rob_block(seen: Sequence[SeenPacket]) -> JointBlock:
    """Returns the block of packets with joints; poses are in the frame of RSI_ON."""
    packets = [packet for packet, _, _ in seen]
    flags = np.array([int(flag) for _, _, flag in seen], dtype=np.int64)
    joints = np.array([packet.joints_deg for packet in packets]) * DEG
    printed = np.array([packet.pose_mm_deg or _UNKNOWN for packet in packets])
    finite = np.isfinite(printed).all(axis=1)
    whole = bool(finite.all())
    if not whole:
        sent = np.array([packet.pose_mm_deg is not None for packet in packets])
        flags = flags | np.where(sent & ~finite, int(Flag.NOT_FINITE), 0)
        printed[~finite] = np.nan
    poses = pose_from_xyz_abc(printed[:, :3] * MM, printed[:, 3:] * DEG)
    if not whole:
        poses[~finite] = np.nan
    joints, flags = check_joints(joints, flags)
    poses, flags = check_poses(poses, flags)
    ipoc = np.array([packet.ipoc for packet in packets], dtype=np.int64)
    return JointBlock(
        controller_time=np.asarray(ipoc * 1e-3),
        host_time=np.array([time for _, time, _ in seen]),
        joints=joints,
        T_frame_tool=poses,
        sequence=ipoc,
        flags=flags,
    )
