"""KUKA RSI: ``<Rob>`` packets of the controller, read one by one and made into blocks.

The controller owns the clock. Every 4 ms (IPO_FAST) or 12 ms it sends a packet with its time in ms,
IPOC, and drops an answer with another one. RSI_ON in the KRL program sets whether corrections add
up (#RELATIVE) or not (#ABSOLUTE); no packet contains it, so it is stated here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.blocks import FARTHEST, MOST_TURNS, Flag, JointBlock, check_joints, check_poses
from robotrue.online.rsi_config import RsiConfig
from robotrue.online.sequence import SequenceState
from robotrue.online.xml_text import parse_xml

Six = tuple[float, float, float, float, float, float]
JOINTS: Final = ("A1", "A2", "A3", "A4", "A5", "A6")
POSE: Final = ("X", "Y", "Z", "A", "B", "C")
_NUMBER: Final = re.compile(r"[+-]?(\d++\.?+\d*+|\.\d++)([eE][+-]?\d+)?")
_NOT_A_NUMBER: Final = re.compile(r"[+-]?(nan|inf(inity)?|1\.#\w+)", re.IGNORECASE)
_UNKNOWN: Final = (math.nan,) * 6
_TURNS: Final = 0.9 * MOST_TURNS / DEG
_FAR: Final = 0.9 * FARTHEST / MM
_IPOC: Final = re.compile(rb"<IPOC>(\d{1,18})</IPOC>")
_VALUE: Final = rb'="([+-]?\d++\.?+\d*+(?:[eE][+-]?\d+)?)"'
_FAST_JOINTS: Final = re.compile(
    rb"<AIPos " + rb" ".join(n.encode() + _VALUE for n in JOINTS) + rb" ?/>"
)
_FAST_POSE: Final = re.compile(
    rb"<RIst " + rb" ".join(n.encode() + _VALUE for n in POSE) + rb" ?/>"
)
_FAST_DELAY: Final = re.compile(rb'<Delay D="(\d{1,9})" ?/>')


@dataclass(frozen=True, slots=True, kw_only=True)
class RobPacket:
    """One packet of the controller, in its own units.

    Attributes:
        ipoc: ms on the controller's clock; what the answer must carry.
        late: Answers the controller has counted as late, or None where it is not stated.
        joints_deg: A1..A6 as measured (AIPos), or None where they are not sent.
        pose_mm_deg: X, Y, Z, A, B, C as measured (RIst), or None where they are not sent.
        signals: Everything else with a number, ``Tag`` or ``Tag.Attribute``.
    """

    ipoc: int
    late: int | None
    joints_deg: Six | None
    pose_mm_deg: Six | None
    signals: Mapping[str, float] = field(default_factory=dict)


SeenPacket = tuple[RobPacket, float, Flag]
"""A packet with joints, s on the host's clock when it came, and the flags of its count."""


def rsi_sequence(cycle_ms: int) -> SequenceState:
    """Returns the state that watches the IPOC of a link of 4 or 12 ms cycles.

    Raises:
        ConfigurationError: Another cycle.
    """
    if cycle_ms not in (4, 12):
        raise ConfigurationError(
            f"RSI cycle of {cycle_ms} ms, expected 4 (IPO_FAST) or 12 (IPO).",
            hint="the sensor mode of RSI_ON in the KRL program.",
        )
    return SequenceState(step=cycle_ms, late_after=1.5e-3 * cycle_ms)


def read_ipoc(data: bytes) -> int:
    """Returns the IPOC alone: all that an answer prepared beforehand needs.

    Raises:
        FormatError: None, or more than one.
    """
    found = _IPOC.findall(data)
    if len(found) != 1 or not data.startswith(b"<Rob") or not data.rstrip().endswith(b"</Rob>"):
        return read_rob(data).ipoc
    return int(found[0])


def read_late(data: bytes) -> int | None:
    """Returns the Delay of a packet alone, or None where it has none.

    Raises:
        FormatError: As ``read_rob``.
    """
    found = _FAST_DELAY.findall(data)
    if len(found) == 1 and data.count(b"<Delay") == 1 and b"<!" not in data:
        return int(found[0])
    return read_rob(data).late


def read_rob_fast(data: bytes) -> RobPacket:
    """Returns IPOC, late count, joints and pose as :func:`read_rob` does, without the signals.

    Controllers print every packet alike; one that is printed otherwise is read by ``read_rob``.

    Raises:
        FormatError: As ``read_rob``.
    """
    plain = (
        data.startswith(b'<Rob Type="KUKA">')
        and data.rstrip().endswith(b"</Rob>")
        and b"<!" not in data
        and data.count(b"<Rob") == 1
    )
    if not plain or data.count(b"<IPOC>") != 1:
        return replace(read_rob(data), signals={})
    ipoc, joints = _IPOC.search(data), _FAST_JOINTS.search(data)
    pose, delay = _FAST_POSE.search(data), _FAST_DELAY.search(data)
    for name, match in ((b"<AIPos", joints), (b"<RIst", pose), (b"<Delay", delay)):
        if data.count(name) != (match is not None):
            return replace(read_rob(data), signals={})
    if ipoc is None:
        return replace(read_rob(data), signals={})
    return RobPacket(
        ipoc=int(ipoc[1]),
        late=None if delay is None else int(delay[1]),
        joints_deg=None if joints is None else _six([float(v) for v in joints.groups()]),
        pose_mm_deg=None if pose is None else _six([float(v) for v in pose.groups()]),
    )


def read_rob(data: bytes, config: RsiConfig | None = None) -> RobPacket:
    """Returns a packet of the controller, checked.

    Args:
        data: One datagram.
        config: If given, everything it declares as sent must be present.

    Raises:
        FormatError: Not a ``<Rob>`` of XML, no IPOC or two, an element twice, a value that is no
            number, or one missing. A printed NaN is a number here, and marked in the sample.
    """
    root = parse_xml(data, "RSI packet")
    if root.tag != "Rob":
        raise FormatError(
            f"RSI packet <{root.tag}>, expected <Rob>.", hint="the port of another service?"
        )
    ipoc, values = read_values(root)
    if config is not None:
        groups = {name.partition(".")[0] for name in values}
        numeric = [e.tag for e in config.send if e.kind != "STRING" and e.tag != "IPOC"]
        missing = [tag for tag in numeric if tag not in values and not _has_group(tag, groups)]
        if missing:
            raise FormatError(
                f"RSI packet without {', '.join(missing)}.",
                hint="give the EthernetConfig.xml that the controller runs.",
            )
    joints = _take_six(values, "AIPos", JOINTS)
    pose = _take_six(values, "RIst", POSE)
    late = values.pop("Delay.D", None)
    if late is not None and not (0 <= late < 1e9 and late == int(late)):
        raise FormatError(f"Delay D={late:g}, expected a count.")
    return RobPacket(
        ipoc=ipoc,
        late=None if late is None else int(late),
        joints_deg=joints,
        pose_mm_deg=pose,
        signals=values,
    )


def read_values(root: Element) -> tuple[int, dict[str, float]]:
    """Returns the IPOC of a packet or answer, and every number by ``Tag`` or ``Tag.Attribute``.

    Raises:
        FormatError: No IPOC or two, a value twice, or one that is no number.
    """
    ipoc: int | None = None
    values: dict[str, float] = {}
    for element in root:
        tag, text = element.tag, (element.text or "").strip()
        if tag == "IPOC":
            if ipoc is not None or not re.fullmatch(r"[0-9]{1,18}", text):
                raise FormatError(f"IPOC {text!r}, expected one whole number of ms.")
            ipoc = int(text)
            continue
        for name, printed in element.attrib.items():
            _put(values, f"{tag}.{name}", _number(printed, f"{tag}.{name}"))
        # text that is no number is a message (EStr) or a state, not a value
        if text and not element.attrib and _is_number(text):
            _put(values, tag, _number(text, tag))
    if ipoc is None:
        raise FormatError("RSI packet without IPOC.", hint="send it whole, as it was made.")
    return ipoc, values


def _put(values: dict[str, float], name: str, number: float) -> None:
    if name in values:
        raise FormatError(f"RSI packet with {name} twice.")
    values[name] = number


def _is_number(text: str) -> bool:
    return bool(_NUMBER.fullmatch(text) or _NOT_A_NUMBER.fullmatch(text))


def _number(text: str, name: str) -> float:
    if _NUMBER.fullmatch(text) and text.isascii():
        return float(text)
    if _NOT_A_NUMBER.fullmatch(text):
        return math.nan
    raise FormatError(f"{name}={text!r}, expected a number.")


def _take_six(values: dict[str, float], tag: str, names: tuple[str, ...]) -> Six | None:
    found = [values.pop(f"{tag}.{name}") for name in names if f"{tag}.{name}" in values]
    if not found:
        return None
    if len(found) != 6:
        raise FormatError(f"{tag} with {len(found)} of {', '.join(names)}.")
    return _six(found)


def _six(numbers: list[float]) -> Six:
    a, b, c, d, e, f = numbers
    return a, b, c, d, e, f


def _has_group(tag: str, groups: set[str]) -> bool:
    """True if an element that holds several values (AIPos, Tech.C1) is present."""
    return ("." not in tag or tag.startswith("Tech.")) and tag.partition(".")[0] in groups


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
