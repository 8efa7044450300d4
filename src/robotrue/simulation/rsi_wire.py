"""What a simulated KUKA controller writes and reads in every cycle, by the shortest way.

Each packet is printed as the one before and so is each answer; whatever is not goes the long way of
:mod:`robotrue.online.rsi`, with the same outcome.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from robotrue.online.rsi import RobPacket, read_sen, write_rob
from robotrue.online.rsi_config import RsiConfig
from robotrue.simulation.motion_grid import Six, six

_VALUE: Final = rb'="([+-]?\d+\.\d+)"'
_AXES: Final = ("X", "Y", "Z", "A", "B", "C")
_SHIFT: Final = re.compile(
    rb"<RKorr (?:"
    + rb" ".join(axis.encode() + _VALUE for axis in _AXES)
    + rb"|"
    + rb" ".join(axis.encode() + _VALUE for axis in _AXES[:3])
    + rb") />"
)


class RobWriter:
    """Writes the bytes of :func:`~robotrue.online.rsi.write_rob` for packets with a pose.

    Args:
        further: What else is sent in every packet, by tag.
    """

    def __init__(self, further: Mapping[str, float]) -> None:
        self._further = dict(further)
        # numbers that stand nowhere else, in the order they are printed in
        marks = [70001.0 + k for k in range(12)]
        pattern = RobPacket(
            ipoc=70014,
            late=70013,
            pose_mm_deg=six(marks[:6]),
            joints_deg=six(marks[6:]),
            signals=self._further,
        )
        text = write_rob(pattern).replace(b"%", b"%%")
        for mark in marks:
            text = text.replace(b"%.6f" % mark, b"%.6f")
        self._text = text.replace(b"70013", b"%d").replace(b"70014", b"%d")

    def write(self, ipoc: int, late: int, joints_deg: Six, pose_mm_deg: Six | None) -> bytes:
        """Returns a packet."""
        if pose_mm_deg is not None:
            return self._text % (*pose_mm_deg, *joints_deg, late, ipoc)
        return write_rob(
            RobPacket(
                ipoc=ipoc, late=late, joints_deg=joints_deg, pose_mm_deg=None, signals=self._further
            )
        )


class SenReader:
    """Reads the answers that :func:`~robotrue.online.rsi.read_sen` reads.

    Args:
        config: Of the controller.
    """

    def __init__(self, config: RsiConfig) -> None:
        self._config = config
        self._head = b'<Sen Type="%b">' % config.sen_type.encode()

    def read(self, data: bytes, ipoc: int) -> Mapping[str, float]:
        """Returns the values of an answer by tag.

        Raises:
            FormatError: As ``read_sen``.
        """
        tail = b"<IPOC>%d</IPOC></Sen>" % ipoc
        if data.startswith(self._head) and data.endswith(tail):
            shift = _SHIFT.fullmatch(data, len(self._head), len(data) - len(tail))
            if shift is not None:
                values = [float(v) for v in shift.groups() if v is not None]
                return {f"RKorr.{a}": v for a, v in zip(_AXES, values, strict=False)}
        return read_sen(data, self._config, ipoc).signals
