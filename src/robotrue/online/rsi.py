"""KUKA RSI: ``<Rob>`` packets of the controller, and ``<Sen>`` answers with the same IPOC.

The controller owns the clock. Every 4 ms (IPO_FAST) or 12 ms it sends a packet with its time in
ms, IPOC, and drops an answer with another one. RSI_ON in the KRL program says whether corrections
add up (#RELATIVE) or not (#ABSOLUTE); no packet tells, so it is stated here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final
from xml.etree.ElementTree import Element
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from robotrue.core.rotations import abc_from_matrix, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import RsiConfig
from robotrue.online.sequence import SequenceState
from robotrue.online.xml_text import parse_xml

Six = tuple[float, float, float, float, float, float]
_JOINTS: Final = ("A1", "A2", "A3", "A4", "A5", "A6")
_POSE: Final = ("X", "Y", "Z", "A", "B", "C")
_NUMBER: Final = re.compile(r"[+-]?(\d++\.?+\d*+|\.\d++)([eE][+-]?\d+)?")
_NOT_A_NUMBER: Final = re.compile(r"[+-]?(nan|inf(inity)?|1\.#\w+)", re.IGNORECASE)
_IPOC: Final = re.compile(rb"<IPOC>(\d{1,18})</IPOC>")
_VALUE: Final = rb'="([+-]?\d++\.?+\d*+(?:[eE][+-]?\d+)?)"'
_FAST_JOINTS: Final = re.compile(
    rb"<AIPos " + rb" ".join(n.encode() + _VALUE for n in _JOINTS) + rb" ?/>"
)
_FAST_POSE: Final = re.compile(
    rb"<RIst " + rb" ".join(n.encode() + _VALUE for n in _POSE) + rb" ?/>"
)
_FAST_DELAY: Final = re.compile(rb'<Delay D="(\d{1,9})" ?/>')


@dataclass(frozen=True, slots=True, kw_only=True)
class RobPacket:
    """One packet of the controller, in its own units.

    Attributes:
        ipoc: ms on the controller's clock; what the answer must carry.
        late: Answers the controller has counted as late, or None where it does not say.
        joints_deg: A1..A6 as measured (AIPos), or None where they are not sent.
        pose_mm_deg: X, Y, Z, A, B, C as measured (RIst), or None where they are not sent.
        signals: Everything else with a number, ``Tag`` or ``Tag.Attribute``.
    """

    ipoc: int
    late: int | None
    joints_deg: Six | None
    pose_mm_deg: Six | None
    signals: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class SenAnswer:
    """One answer to the controller, as a controller reads it.

    Attributes:
        sen_type: Must be that of the configuration.
        ipoc: Must be that of the packet answered.
        signals: Values, ``Tag`` or ``Tag.Attribute`` (RKorr.X in mm, RKorr.A in deg).
    """

    sen_type: str
    ipoc: int
    signals: Mapping[str, float]


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
        return _without_signals(read_rob(data))
    ipoc, joints = _IPOC.search(data), _FAST_JOINTS.search(data)
    pose, delay = _FAST_POSE.search(data), _FAST_DELAY.search(data)
    for name, match in ((b"<AIPos", joints), (b"<RIst", pose), (b"<Delay", delay)):
        if data.count(name) != (match is not None):
            return _without_signals(read_rob(data))
    if ipoc is None:
        return _without_signals(read_rob(data))
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
        config: Given, everything it says is sent must be there.

    Raises:
        FormatError: Not a ``<Rob>`` of XML, no IPOC or two, an element twice, a value that is no
            number, or one missing. A printed NaN is a number here, and marked in the sample.
    """
    root = parse_xml(data, "RSI packet")
    if root.tag != "Rob":
        raise FormatError(
            f"RSI packet <{root.tag}>, expected <Rob>.", hint="the port of another service?"
        )
    ipoc, values = _values(root)
    if config is not None:
        groups = {name.partition(".")[0] for name in values}
        numeric = [e.tag for e in config.send if e.kind != "STRING" and e.tag != "IPOC"]
        missing = [tag for tag in numeric if tag not in values and not _has_group(tag, groups)]
        if missing:
            raise FormatError(
                f"RSI packet without {', '.join(missing)}.",
                hint="give the EthernetConfig.xml that the controller runs.",
            )
    joints = _take_six(values, "AIPos", _JOINTS)
    pose = _take_six(values, "RIst", _POSE)
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


def write_sen(
    config: RsiConfig,
    ipoc: int,
    correction: Correction,
    mode: CorrectionMode,
    signals: Mapping[str, float] | None = None,
) -> bytes:
    """Returns the answer to the packet of an IPOC.

    Args:
        config: Which elements the controller takes.
        ipoc: That of the packet answered, unchanged.
        correction: Written as RKorr, X Y Z in mm and A B C in deg, to 1e-6 of them.
        mode: What RSI_ON of the running program says.
        signals: Further values by tag (``DiO``, ``Tech.T21``).

    Raises:
        ConfigurationError: The link takes no answers, not this element, or not this direction.
        ModelMismatchError: A correction for the other mode.
    """
    if config.only_send:
        raise ConfigurationError(
            "ONLYSEND is TRUE: the controller takes no answers.", hint="set it to FALSE."
        )
    if correction.mode is not mode:
        raise ModelMismatchError(
            f"a correction meant as {correction.mode.value} for a controller that takes it as "
            f"{mode.value}.",
            hint="RSI_ON(#RELATIVE) adds it up in every cycle, RSI_ON(#ABSOLUTE) does not.",
        )
    abc = correction.turn
    if abc.any():
        abc = abc_from_matrix(matrix_from_rotation_vector(abc))
    numbers = np.concatenate([correction.shift / MM, abc / DEG]) + 0.0
    values = dict(zip((f"RKorr.{name}" for name in _POSE), numbers.tolist(), strict=True))
    for tag, number in values.items():
        if config.receives(tag) is None and abs(number) >= 5e-7:
            raise ConfigurationError(
                f"the controller takes no {tag}, and {number:.6f} is to be sent.",
                hint=f'<ELEMENT TAG="{tag}" .../> under RECEIVE, or correct without it.',
            )
    values = {tag: number for tag, number in values.items() if config.receives(tag) is not None}
    for tag, number in (signals or {}).items():
        if config.receives(tag) is None or tag in values or not math.isfinite(number):
            raise ConfigurationError(
                f"{tag} = {number} cannot be sent; the controller takes "
                f"{', '.join(e.tag for e in config.receive) or 'nothing'}."
            )
        values[tag] = number
    whole = {
        tag for tag in values if (e := config.receives(tag)) is not None and e.kind != "DOUBLE"
    }
    return _document("Sen", config.sen_type, values, ipoc, whole)


def write_rob(packet: RobPacket) -> bytes:
    """Returns a packet as a controller sends it, for simulators and tests."""
    values: dict[str, float] = {}
    for tag, names, numbers in (
        ("RIst", _POSE, packet.pose_mm_deg),
        ("AIPos", _JOINTS, packet.joints_deg),
    ):
        if numbers is not None:
            values |= {f"{tag}.{n}": v for n, v in zip(names, numbers, strict=True)}
    if packet.late is not None:
        values["Delay.D"] = packet.late
    return _document("Rob", "KUKA", values | dict(packet.signals), packet.ipoc, {"Delay.D"})


def read_sen(data: bytes, config: RsiConfig, ipoc: int) -> SenAnswer:
    """Returns an answer as a controller reads it.

    Raises:
        FormatError: Not a ``<Sen>``, another type, or the IPOC of another packet.
    """
    root = parse_xml(data, "RSI answer")
    sen_type = root.get("Type", "")
    if root.tag != "Sen" or sen_type != config.sen_type:
        raise FormatError(
            f"RSI answer <{root.tag} Type={sen_type!r}>, expected <Sen Type={config.sen_type!r}>.",
            hint="SENTYPE of EthernetConfig.xml.",
        )
    answered, values = _values(root)
    if answered != ipoc:
        raise FormatError(f"RSI answer to IPOC {answered}, expected {ipoc}.")
    return SenAnswer(sen_type=sen_type, ipoc=answered, signals=values)


def _document(
    root: str, kind: str, values: Mapping[str, float], ipoc: int, whole: set[str]
) -> bytes:
    parts = [f"<{root} Type={quoteattr(kind)}>"]
    groups: dict[str, list[str]] = {}
    for tag, number in values.items():
        group, _, name = tag.partition(".")
        text = str(int(number)) if tag in whole else f"{number:.6f}"
        groups.setdefault(group, []).append(f' {name}="{text}"' if name else escape(text))
    for group, texts in groups.items():
        attributes = texts[0].startswith(" ")
        body = "".join(texts)
        parts.append(f"<{group}{body} />" if attributes else f"<{group}>{body}</{group}>")
    parts.append(f"<IPOC>{ipoc}</IPOC></{root}>")
    return "".join(parts).encode("ascii", "xmlcharrefreplace")


def _values(root: Element) -> tuple[int, dict[str, float]]:
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
    """Whether an element that stands for several values (AIPos, Tech.C1) has come."""
    return ("." not in tag or tag.startswith("Tech.")) and tag.partition(".")[0] in groups


def _without_signals(packet: RobPacket) -> RobPacket:
    return RobPacket(
        ipoc=packet.ipoc,
        late=packet.late,
        joints_deg=packet.joints_deg,
        pose_mm_deg=packet.pose_mm_deg,
    )
