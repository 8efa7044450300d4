"""Alarms of a live stream: stretches in which the error of an axis is beyond its limit."""

from __future__ import annotations

import math
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final, TypeAlias, TypedDict

AXES: Final = ("x", "y", "z")
QUIET: Final = 2.0
"""s within the limit after which an alarm is over; until then it is the same one."""
SIGMAS: Final = 2.0
"""Of the reported band, 95 %."""
Limits: TypeAlias = tuple[float, float, float]
"""um along x, y and z of the base; 0 is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One stretch beyond the limit.

    Attributes:
        key: The same from its beginning to its end.
        axis: x, y or z of the base.
        begun: When.
        value_um: The largest error in it, with its sign.
        band_um: Two standard deviations there.
        limit_um: It was beyond this.
        duration_s: From the first sample beyond the limit to the last one.
        over: Whether it has ended.
    """

    key: str
    axis: str
    begun: datetime
    value_um: float
    band_um: float
    limit_um: float
    duration_s: float
    over: bool

    @property
    def document(self) -> dict[str, object]:
        """Returns JSON values."""
        return {
            "key": self.key,
            "axis": self.axis,
            "begun": self.begun.isoformat(timespec="milliseconds"),
            "value_um": round(self.value_um, 3),
            "band_um": round(self.band_um, 3),
            "limit_um": self.limit_um,
            "duration_s": round(self.duration_s, 3),
            "over": self.over,
        }


class LiveBin(TypedDict):
    """A bin of the live page: its time, and by axis lowest and highest error and its sd, um."""

    t_s: float
    low: list[float | None]
    high: list[float | None]
    sd_um: list[float | None]


class AlarmWatch:
    """The alarms of one stream, bin by bin.

    Args:
        limits: Per axis.
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._open: dict[str, tuple[Alarm, float, float]] = {}

    @property
    def open(self) -> tuple[Alarm, ...]:
        """Alarms that have not ended."""
        return tuple(each for each, _, _ in self._open.values())

    def take(self, bins: Sequence[LiveBin], at: datetime) -> list[Alarm]:
        """Returns the alarms that start or end in some bins of a stream.

        Args:
            bins: As from :mod:`robotrue.online.live_page`, in the order of time.
            at: Arrival of the last of them.
        """
        out: list[Alarm] = []
        last = float(bins[-1]["t_s"]) if bins else 0.0
        for each in bins:
            time = float(each["t_s"])
            for k, axis in enumerate(AXES):
                if (ended := self._end_axis(axis, time)) is not None:
                    out.append(ended)
                found = _largest(each, k)
                if found is None or not 0.0 < self.limits[k] < abs(found[0]):
                    continue
                if axis not in self._open:
                    begun = self._begin(k, found, time, at - timedelta(seconds=last - time))
                    out.append(begun)
                self._went_on(axis, found, time)
        return out

    def end(self) -> list[Alarm]:
        """Returns all alarms that are open as ended: the stream is gone, or the limits change."""
        ended = [replace(each, over=True) for each in self.open]
        self._open.clear()
        return ended

    def _begin(self, k: int, found: tuple[float, float], time: float, at: datetime) -> Alarm:
        alarm = Alarm(
            key=uuid.uuid4().hex,
            axis=AXES[k],
            begun=at,
            value_um=found[0],
            band_um=found[1],
            limit_um=self.limits[k],
            duration_s=0.0,
            over=False,
        )
        self._open[AXES[k]] = alarm, time, time
        return alarm

    def _went_on(self, axis: str, found: tuple[float, float], time: float) -> None:
        alarm, first, _ = self._open[axis]
        if abs(found[0]) > abs(alarm.value_um):
            alarm = replace(alarm, value_um=found[0], band_um=found[1])
        self._open[axis] = replace(alarm, duration_s=time - first), first, time

    def _end_axis(self, axis: str, time: float) -> Alarm | None:
        alarm, _, last = self._open.get(axis, (None, 0.0, 0.0))
        if alarm is None or 0.0 <= time - last < QUIET:  # a clock that went back ends it, too
            return None
        del self._open[axis]
        return replace(alarm, over=True)


def _largest(found: LiveBin, k: int) -> tuple[float, float] | None:
    """The largest error of an axis in a bin and two standard deviations, um; None: not known."""
    ends = [float(v) for v in (found["low"][k], found["high"][k]) if v is not None]
    if not ends or not all(map(math.isfinite, ends)):
        return None
    sd = found["sd_um"][k]
    return max(ends, key=abs), SIGMAS * float(sd) if sd is not None else math.nan
