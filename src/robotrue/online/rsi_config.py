"""KUKA RSI's EthernetConfig.xml: which values the controller sends and takes, and their names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.online.xml_text import parse_xml

_KINDS: Final = ("BOOL", "STRING", "LONG", "DOUBLE")
_TAG: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)?")
_CHANNELS: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class RsiElement:
    """One value of a packet.

    Attributes:
        tag: As the packets name it, without ``DEF_``: ``RKorr.X``, ``AIPos``, ``DiO``.
        kind: BOOL, STRING, LONG or DOUBLE.
        index: Channel of the ETHERNET object, from 1; None for what RSI fills in itself.
        hold: Whether the controller keeps the last value when an answer is late (HOLDON); where
            it does not, the value falls to zero. None for what is sent.
    """

    tag: str
    kind: str
    index: int | None
    hold: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RsiConfig:
    """Configuration shared by both ends of an RSI link.

    Attributes:
        host: Address of the computer that answers.
        port: Its UDP port.
        sen_type: Type of our ``<Sen>``; another one is dropped by the controller without a word.
        only_send: The controller takes no answers.
        send: From the controller.
        receive: To the controller.
    """

    host: str
    port: int
    sen_type: str
    only_send: bool
    send: tuple[RsiElement, ...]
    receive: tuple[RsiElement, ...]

    def receives(self, tag: str) -> RsiElement | None:
        """Returns the element that the controller takes under a tag, if it takes it."""
        found = next((e for e in self.receive if e.tag == tag), None)
        if found is not None or not tag.startswith("Tech."):
            return found
        # DEF_Tech.T2 means Tech.T21 .. Tech.T210
        number = re.fullmatch(r"Tech\.([TC][1-6])(?:[1-9]|10)", tag)
        group = f"Tech.{number[1]}" if number else ""
        return next((e for e in self.receive if e.tag == group), None)


def read_rsi_config(path: str | Path) -> RsiConfig:
    """Returns the configuration of a file.

    Raises:
        FormatError: Unreadable, or something both ends must agree on is missing or given twice.
    """
    return parse_rsi_config(read_bytes(path), path)


def parse_rsi_config(data: bytes, source: str | Path | None = None) -> RsiConfig:
    """Returns the configuration that the bytes of an EthernetConfig.xml hold.

    Raises:
        FormatError: As :func:`read_rsi_config`.
    """
    root = parse_xml(data, "EthernetConfig", source)
    if root.tag != "ROOT":
        raise FormatError(f"root element <{root.tag}>, expected <ROOT>.", source=source)
    port = _text(root, "PORT", source)
    if not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise FormatError(f"PORT {port!r}, expected 1 to 65535.", source=source)
    only_send = _text(root, "ONLYSEND", source).upper()
    if only_send not in ("TRUE", "FALSE"):
        raise FormatError(f"ONLYSEND {only_send!r}, expected TRUE or FALSE.", source=source)
    return RsiConfig(
        host=_text(root, "IP_NUMBER", source),
        port=int(port),
        sen_type=_text(root, "SENTYPE", source),
        only_send=only_send == "TRUE",
        send=_elements(root, "SEND", source),
        receive=_elements(root, "RECEIVE", source),
    )


def _text(root: Element, name: str, source: str | Path | None) -> str:
    found = root.findall(f"CONFIG/{name}")
    text = (found[0].text or "").strip() if len(found) == 1 else ""
    if not text:
        raise FormatError(
            f"CONFIG has {len(found)} elements {name} with a value, expected one.",
            source=source,
            hint="take the file from the controller's SensorInterface folder.",
        )
    return text


def _elements(root: Element, side: str, source: str | Path | None) -> tuple[RsiElement, ...]:
    found = tuple(_element(e, side, source) for e in root.findall(f"{side}/ELEMENTS/ELEMENT"))
    for what, keys in (
        ("tag", [e.tag for e in found]),
        ("INDX", [str(e.index) for e in found if e.index is not None]),
    ):
        twice = sorted({key for key in keys if keys.count(key) > 1})
        if twice:
            raise FormatError(f"{side}: {what} {', '.join(twice)} occurs twice.", source=source)
    return found


def _element(element: Element, side: str, source: str | Path | None) -> RsiElement:
    name, kind = element.get("TAG", ""), element.get("TYPE", "").upper()
    place, hold = element.get("INDX", "").upper(), element.get("HOLDON")
    tag = name.removeprefix("DEF_")
    if not _TAG.fullmatch(tag) or kind not in _KINDS:
        raise FormatError(
            f"{side}: TAG {name!r} TYPE {kind!r}, expected a name and one of {', '.join(_KINDS)}.",
            source=source,
        )
    internal = place == "INTERNAL"
    if not internal and not (place.isascii() and place.isdigit() and 1 <= int(place) <= _CHANNELS):
        raise FormatError(
            f"{side}: INDX {place!r} of {name}, expected INTERNAL or 1 to {_CHANNELS}.",
            source=source,
        )
    if hold not in (None, "0", "1"):
        raise FormatError(f"{side}: HOLDON {hold!r} of {name}, expected 0 or 1.", source=source)
    return RsiElement(
        tag=tag,
        kind=kind,
        index=None if internal else int(place),
        hold=hold == "1" if side == "RECEIVE" else None,
    )


def usual_rsi_config(host: str, port: int, *, hold: bool = True) -> RsiConfig:
    """Returns what links mostly use: pose, joints and late count sent, Cartesian corrections taken.

    Args:
        host: Address of the computer that answers.
        port: Its UDP port.
        hold: HOLDON of the corrections: True for ``RSI_ON(#ABSOLUTE)``, where a missed answer
            leaves the offset as it is; False for ``RSI_ON(#RELATIVE)``, where it adds nothing.
    """
    sent = (("RIst", "DOUBLE"), ("AIPos", "DOUBLE"), ("Delay", "LONG"))
    return RsiConfig(
        host=host,
        port=port,
        sen_type="ImFree",
        only_send=False,
        send=tuple(RsiElement(tag=tag, kind=kind, index=None, hold=None) for tag, kind in sent),
        receive=tuple(
            RsiElement(tag=f"RKorr.{axis}", kind="DOUBLE", index=i + 1, hold=hold)
            for i, axis in enumerate("XYZABC")
        ),
    )
