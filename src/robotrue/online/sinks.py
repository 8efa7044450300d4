"""Registry of sinks: ``csv:PATH``, ``mqtt://``, ``opcua://``, ``ws://``, and their settings.

A sink is a leaf file that is imported when its address is opened.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Final, NamedTuple, cast

from robotrue.core.provenance import MEASURED, Provenance
from robotrue.errors import ConfigurationError, MissingExtraError
from robotrue.online.estimates import EstimateBlock
from robotrue.online.link import Health, Sink
from robotrue.online.net_address import NetAddress, net_address

MOST_JOINTS: Final = 12


def _nobody() -> tuple[Health, ...]:
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkSettings:
    """Settings that a service passes to its sinks.

    Attributes:
        cell: Name of the cell, in topics, titles and object trees; a word without blanks or
            ``/ + #``.
        note: Shown wherever an estimate is shown, e.g. "simulated"; empty shows none.
        provenance: Of the streams and models: files of simulated estimates start with a mark.
        joints: Joints of the arm.
        resume: Whether an existing file is continued (after a crash) or refused.
        healths: Called once a second for the counters of the sources and sinks.
        nodesets: Folder of the OPC UA NodeSet files of the companion models; None leaves them out.
        environment: Where names, passwords and tokens are looked up.
    """

    cell: str = "cell"
    note: str = ""
    provenance: Provenance = MEASURED
    joints: int = 6
    resume: bool = False
    healths: Callable[[], Sequence[Health]] = _nobody
    nodesets: Path | None = None
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ, repr=False)

    def __post_init__(self) -> None:
        """Checks."""
        bad = sorted({c for c in self.cell if c in "/+#" or c.isspace() or not c.isprintable()})
        if bad or not self.cell:
            raise ConfigurationError(
                f"cell name {self.cell!r}, expected a word without blanks and / + #.",
                hint="name it as its machine is named: cell-3.",
            )
        if not 1 <= self.joints <= MOST_JOINTS:
            raise ConfigurationError(
                f"an arm of {self.joints} joints, expected 1 to {MOST_JOINTS}."
            )


LIVE: Final = 60.0
"""s; a sample older than this, or from later than now, is a replay and not live."""


def utc_seconds(host_time: float) -> float:
    """Returns s since 1970 in UTC when the monotonic clock was ``host_time``.

    A replay has its own clock; its samples are stamped with the present time.
    """
    age = time.monotonic() - host_time
    return time.time() - (age if 0.0 <= age <= LIVE else 0.0)


class DisplaySink:
    """Base of sinks for displays: counters, and a heartbeat.

    Args:
        address: It was opened with.
        settings: Of the service.
        beat: s between two looks at whether a block has come.
    """

    def __init__(self, address: NetAddress, settings: SinkSettings, beat: float) -> None:
        self._address, self._settings, self._beat_time = address, settings, beat
        self._health = Health(name=address.shown, connected=False)

    async def write(self, estimates: EstimateBlock) -> None:
        """Takes a block; what is shown of it comes at the rate of the address. Never waits."""
        joints, expected = estimates.joints.shape[1], self._settings.joints
        if joints not in (0, expected):
            self._health.refuse(f"estimates of an arm of {joints} joints, expected {expected}.")
        elif len(estimates):
            self._health.received += 1
            self._take(estimates)

    def _take(self, estimates: EstimateBlock) -> None:
        """Takes a block of the arm."""
        raise NotImplementedError

    def _rest(self, beats: int) -> None:
        """Shows what a stream has left that has given nothing for some beats, from 1 on."""
        raise NotImplementedError

    async def _show_health(self) -> None:
        """Shows the counters of the sources and sinks."""
        raise NotImplementedError

    async def _beat(self) -> None:
        """Shows what a stream that stopped has left, and the counters once a second."""
        count, resting, seen = 0, 0, -1
        while True:
            await asyncio.sleep(self._beat_time)
            resting = resting + 1 if seen == self._health.received else 0
            if resting:
                self._rest(resting)
            seen, count = self._health.received, count + 1
            if count % round(1.0 / self._beat_time) == 0:
                await self._show_health()


class _Server(NamedTuple):
    """Port, library and leaf file of a scheme, and the class in it."""

    port: int
    library: str
    module: str
    sink: str


_MQTT: Final = ("aiomqtt", "robotrue.online.mqtt_sink", "MqttSink")
_SERVERS: Final[Mapping[str, _Server]] = {
    "mqtt": _Server(1883, *_MQTT),
    "mqtts": _Server(8883, *_MQTT),
    "opcua": _Server(4840, "asyncua", "robotrue.online.opcua_sink", "OpcUaSink"),
    "ws": _Server(8765, "websockets", "robotrue.online.ws_sink", "WebSocketSink"),
}
EXAMPLES: Final = (
    "csv:out.csv",
    "csv+append:out.csv",
    "mqtt://broker:1883/robotrue/cell-3",
    "mqtts://broker:8883/robotrue/cell-3",
    "opcua://127.0.0.1:4840",
    "ws://127.0.0.1:8765",
)


def open_sink(address: str, settings: SinkSettings | None = None) -> Sink:
    """Returns the sink of an address, not opened yet.

    Args:
        address: As in :data:`EXAMPLES`.
        settings: Of the service.

    Raises:
        ConfigurationError: An unknown scheme, or an address that is not whole or not safe.
        MissingExtraError: The library of this sink is not installed.
    """
    settings = settings or SinkSettings()
    scheme, colon, rest = address.partition(":")
    scheme = scheme.lower()
    if colon and scheme in ("csv", "csv+append"):
        return _open_csv(rest, replace(settings, resume=settings.resume or scheme == "csv+append"))
    server = _SERVERS.get(scheme) if colon else None
    if server is None:
        raise ConfigurationError(
            f"sink {(scheme + ':' if colon else address)!r}, expected one of csv:, csv+append:, "
            f"{', '.join(s + '://' for s in _SERVERS)}.",
            hint=", ".join(EXAMPLES[:1] + EXAMPLES[2:3] + EXAMPLES[4:]),
        )
    where = net_address(address, default_port=server.port)
    if find_spec(server.library) is None:
        raise MissingExtraError(
            f"{scheme}:// needs {server.library}.", hint="pip install 'robotrue[online]'"
        )
    return cast(Sink, getattr(import_module(server.module), server.sink)(where, settings))


def _open_csv(path: str, settings: SinkSettings) -> Sink:
    path = path.removeprefix("//")
    if not path:
        raise ConfigurationError("a csv address without a path.", hint=EXAMPLES[0])
    return cast(Sink, import_module("robotrue.online.csv_streams").CsvSink(path, settings))
