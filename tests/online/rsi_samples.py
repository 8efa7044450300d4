"""Packets of a KUKA controller one by one: what a block must hold, row by row."""

from __future__ import annotations

from xml.sax.saxutils import escape

import numpy as np
from single_samples import JointSample, unknown_pose

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.online.blocks import Flag
from robotrue.online.rsi import RobPacket
from robotrue.online.rsi_config import RsiConfig


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


def write_rsi_config(config: RsiConfig) -> bytes:
    """Returns the EthernetConfig.xml of a configuration, for the controller's own folder."""
    only_send = str(config.only_send).upper()
    lines = ["<ROOT>", "  <CONFIG>"]
    for name, value in (
        ("IP_NUMBER", config.host),
        ("PORT", str(config.port)),
        ("SENTYPE", config.sen_type),
        ("ONLYSEND", only_send),
    ):
        lines.append(f"    <{name}>{escape(value)}</{name}>")
    lines.append("  </CONFIG>")
    for side, elements in (("SEND", config.send), ("RECEIVE", config.receive)):
        lines += [f"  <{side}>", "    <ELEMENTS>"]
        for e in elements:
            tag, place = (f"DEF_{e.tag}", "INTERNAL") if e.index is None else (e.tag, e.index)
            hold = "" if e.hold is None else f' HOLDON="{int(e.hold)}"'
            lines.append(f'      <ELEMENT TAG="{tag}" TYPE="{e.kind}" INDX="{place}"{hold} />')
        lines += ["    </ELEMENTS>", f"  </{side}>"]
    return ("\n".join(lines) + "\n</ROOT>\n").encode()
