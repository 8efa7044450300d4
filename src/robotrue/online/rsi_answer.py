"""``<Sen>`` answers to a KUKA controller, with the IPOC of the packet they answer.

Those that only shift have all prepared beforehand that does not change. Packets are written and
answers read here for simulated controllers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from robotrue.core.rotations import abc_from_matrix, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError
from robotrue.online.robot_correction import Correction, CorrectionMode, no_correction
from robotrue.online.rsi import JOINTS, POSE, RobPacket, read_values
from robotrue.online.rsi_config import RsiConfig
from robotrue.online.xml_text import parse_xml

_STRAIGHT: Final = [0.0, 0.0, 0.0]
_SHIFT: Final = ("RKorr.X", "RKorr.Y", "RKorr.Z")


class SenWriter:
    """Writes the bytes of :func:`write_sen`, five times as fast for a shift.

    Args:
        config: Which elements the controller takes.
        mode: What RSI_ON of the running program says.

    Raises:
        ConfigurationError: The link takes no answers.
    """

    def __init__(self, config: RsiConfig, mode: CorrectionMode) -> None:
        self._config, self._mode = config, mode
        self._head = self._tail = b""
        whole = write_sen(config, 0, no_correction(mode), mode)
        zeros = b' X="0.000000" Y="0.000000" Z="0.000000"'
        plain = all((e := config.receives(tag)) and e.kind == "DOUBLE" for tag in _SHIFT)
        if plain and whole.count(zeros) == 1 and whole.endswith(b"<IPOC>0</IPOC></Sen>"):
            self._head, _, rest = whole.partition(zeros)
            self._tail = rest.removesuffix(b"0</IPOC></Sen>")

    def write(self, ipoc: int, correction: Correction) -> bytes:
        """Returns the answer to the packet of an IPOC.

        Raises:
            ConfigurationError: The controller does not take this direction.
            ModelMismatchError: A correction for the other mode.
        """
        plain = correction.mode is self._mode and correction.turn.tolist() == _STRAIGHT
        if not self._head or not plain:
            return write_sen(self._config, ipoc, correction, self._mode)
        # without the sign of a zero
        x, y, z = (v / MM + 0.0 for v in correction.shift.tolist())
        values = b' X="%.6f" Y="%.6f" Z="%.6f"' % (x, y, z)
        return b"%b%b%b%d</IPOC></Sen>" % (self._head, values, self._tail, ipoc)


def write_sen(config: RsiConfig, ipoc: int, correction: Correction, mode: CorrectionMode) -> bytes:
    """Returns the answer to the packet of an IPOC.

    Args:
        config: Which elements the controller takes.
        ipoc: That of the packet answered, unchanged.
        correction: Written as RKorr, X Y Z in mm and A B C in deg, to 1e-6 of them.
        mode: What RSI_ON of the running program says.

    Raises:
        ConfigurationError: The link takes no answers, or not this direction.
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
    values = dict(zip((f"RKorr.{name}" for name in POSE), numbers.tolist(), strict=True))
    for tag, number in values.items():
        if config.receives(tag) is None and abs(number) >= 5e-7:
            raise ConfigurationError(
                f"the controller takes no {tag}, and {number:.6f} is to be sent.",
                hint=f'<ELEMENT TAG="{tag}" .../> under RECEIVE, or correct without it.',
            )
    values = {tag: number for tag, number in values.items() if config.receives(tag) is not None}
    whole = {
        tag for tag in values if (e := config.receives(tag)) is not None and e.kind != "DOUBLE"
    }
    return _document("Sen", config.sen_type, values, ipoc, whole)


def write_rob(packet: RobPacket) -> bytes:
    """Returns a packet as a controller sends it, for simulators and tests."""
    values: dict[str, float] = {}
    for tag, names, numbers in (
        ("RIst", POSE, packet.pose_mm_deg),
        ("AIPos", JOINTS, packet.joints_deg),
    ):
        if numbers is not None:
            values |= {f"{tag}.{n}": v for n, v in zip(names, numbers, strict=True)}
    if packet.late is not None:
        values["Delay.D"] = packet.late
    return _document("Rob", "KUKA", values | dict(packet.signals), packet.ipoc, {"Delay.D"})


def read_sen(data: bytes, config: RsiConfig, ipoc: int) -> dict[str, float]:
    """Returns the values of an answer as a controller reads it: RKorr.X in mm, RKorr.A in deg.

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
    answered, values = read_values(root)
    if answered != ipoc:
        raise FormatError(f"RSI answer to IPOC {answered}, expected {ipoc}.")
    return values


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
