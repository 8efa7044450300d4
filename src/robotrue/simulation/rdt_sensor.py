"""An ATI force sensor to practise with: records of counts over UDP, its page of scale over HTTP.

Simulated throughout. As the real one it sends only on request, to the latest client, and numbers
its records from one with every request.
"""

from __future__ import annotations

import asyncio
import math
import socket
import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.device_defaults import RDT_PORT
from robotrue.online.rdt import (
    RECORD,
    SATURATED,
    RdtCommand,
    RdtDevice,
    RdtScale,
    Records,
    checked_rate,
    read_request,
)
from robotrue.simulation.device_defaults import LOCAL_HOST, RATE_HZ
from robotrue.simulation.online_faults import Fault, FaultKind, FaultyWire, clock_leap, showing
from robotrue.simulation.online_scenario import OnlineScenario

FAULTS: Final = tuple(k for k in FaultKind if k is not FaultKind.NAN)
"""What the sensor can show; counts are always numbers."""
INTERNAL: Final = 7000.0
"""Measurements per second within the sensor."""
_TICK: Final = 2e-3
"""s between two looks at what is due."""
_LATE: Final = 28e-3
"""s behind its time from which a record counts as late: more than the real one ever needs."""
_AHEAD: Final = 128
"""Records that are worked out at once: one costs as much as a hundred."""
_ON_GRID: Final = 1e-3
"""Of the time between two records."""
_MOST_DUE: Final = 4096
"""Records made at once; after a longer pause of this computer the others are left out."""
_UNWELL: Final = 1 << 31 | 1 << 1


@dataclass(frozen=True, slots=True, kw_only=True)
class RdtSensorSettings:
    """Settings of the simulated sensor.

    Attributes:
        host: Its own address.
        port: UDP; 0 takes a free one.
        page_port: TCP port of its ``netftapi2.xml``; 0 takes a free one, None serves none.
        device: Family.
        rate: Records per second.
        drift: Part by which its clock runs fast.
        counts_per_newton: Scale of forces.
        counts_per_newton_metre: Scale of torques.
        force_noise: N, standard deviation of each record.
        torque_noise: N m, likewise.
        seed: Of the noise.
        faults: What goes wrong.
    """

    host: str = LOCAL_HOST
    port: int = RDT_PORT
    page_port: int | None = None
    device: RdtDevice = RdtDevice.NET
    rate: float = RATE_HZ
    drift: float = 40e-6
    counts_per_newton: float = 1e6
    counts_per_newton_metre: float = 1e6
    force_noise: float = 0.1
    torque_noise: float = 0.005
    seed: int = 0
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        """Checks."""
        checked_rate(self.rate)
        scales = self.counts_per_newton, self.counts_per_newton_metre
        if not (min(scales) >= 1.0 and max(scales) <= 1e7 and abs(self.drift) < 1e-2):
            raise ConfigurationError(
                f"{scales[0]:g} counts per N, {scales[1]:g} per N m, drift {self.drift:g}; "
                "expected 1 to 1e7 counts and less than a hundredth."
            )

    @property
    def scale(self) -> RdtScale:
        """Scale of the counts."""
        return RdtScale(
            newton=1.0 / self.counts_per_newton, newton_metre=1.0 / self.counts_per_newton_metre
        )


@dataclass(slots=True, kw_only=True)
class RdtSensorReport:
    """Counters of a run.

    Attributes:
        sent: Datagrams.
        withheld: Records a fault kept back for good.
        late: Records sent too late, because this computer was.
        requests: Taken.
        refused: Datagrams that were no requests.
    """

    sent: int = 0
    withheld: int = 0
    late: int = 0
    requests: int = 0
    refused: int = 0


def netftapi_page(settings: RdtSensorSettings) -> bytes:
    """Returns the sensor's page ``netftapi2.xml``."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<netft>\n'
        "<prodname>Simulated force sensor (robotrue simulate rdt)</prodname>\n"
        f"<cfgcpf>{settings.counts_per_newton:.0f}</cfgcpf>\n"
        f"<cfgcpt>{settings.counts_per_newton_metre:.0f}</cfgcpt>\n"
        "<cfgfu>2</cfgfu>\n<scfgfu>N</scfgfu>\n<cfgtu>3</cfgtu>\n<scfgtu>N-m</scfgtu>\n"
        f"<comrdtrate>{settings.rate:g}</comrdtrate>\n</netft>\n"
    ).encode()


class RdtSensor:
    """The sensor with its sockets; ``port`` and ``page_port`` are known once it is open."""

    def __init__(self, settings: RdtSensorSettings, scenario: OnlineScenario) -> None:
        """Opens its UDP socket.

        Raises:
            ConfigurationError: The port is taken.
        """
        self.settings = settings
        self.report = RdtSensorReport()
        self.page_port: int | None = None
        self._scenario = scenario
        self._ahead = _Ahead(settings, scenario)
        self._client: tuple[str, int] | None = None
        self._left = math.inf
        self._number = self._measured = 0
        self._stood = 0
        self._bias = np.zeros(6)
        self._counts = np.repeat([settings.counts_per_newton, settings.counts_per_newton_metre], 3)
        self._wire = FaultyWire(settings.faults)
        self._leap = 0.0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((settings.host, settings.port))
        except OSError as cause:
            self._socket.close()
            raise ConfigurationError(
                f"UDP port {settings.port} of {settings.host} cannot be opened: {cause.strerror}.",
                hint="another port.",
            ) from cause
        self.port: int = self._socket.getsockname()[1]

    async def run(self, *, stop: asyncio.Event | None = None) -> RdtSensorReport:
        """Runs until ``stop`` is set or the task is cancelled; returns the report."""
        page = await self._serve_page()
        begun = made = time.monotonic()
        try:
            while not (stop is not None and stop.is_set()):
                self._take_requests(time.monotonic() - begun)
                now = time.monotonic()
                count = math.floor((now - made) * self.settings.rate * (1.0 + self.settings.drift))
                if count > 0:
                    step = 1.0 / (self.settings.rate * (1.0 + self.settings.drift))
                    times = made + step * np.arange(1, count + 1)
                    made = float(times[-1])
                    self._send_due(np.asarray(times[-_MOST_DUE:]), begun, now)
                await asyncio.sleep(_TICK)
        finally:
            self._socket.close()
            if page is not None:
                page.close()
        return self.report

    def _send_due(self, times: Array, begun: float, now: float) -> None:
        if self._client is None:
            self._measured += len(times)
            return
        take = int(min(len(times), self._left))
        self._left -= take
        records = self._records(times[:take], begun)
        data, size = records.tobytes(), RECORD.itemsize
        packets = [data[k : k + size] for k in range(0, len(data), size)]
        late = int((now - times[:take] > _LATE).sum())
        self.report.late += late
        self._deliver(packets, now - begun)
        if self._left <= 0:
            self._client = None

    def _records(self, times: Array, begun: float) -> Records:
        """The records of moments (n,) s, numbered on."""
        n, settings = len(times), self.settings
        since = float(times[-1] - begun) if n else 0.0
        wrench = self._ahead.wrench(times) - self._bias + self._ahead.noise(n)
        records = np.zeros(n, dtype=RECORD)
        counts = np.rint(wrench * self._counts)
        records["counts"] = np.minimum(np.maximum(counts, -(2.0**31)), 2.0**31 - 1.0)
        leap = clock_leap(settings.faults, since)
        self._number += round((leap - self._leap) * settings.rate)
        self._leap = leap
        records["rdt"] = (self._number + 1 + np.arange(n)) % 2**32
        self._number += n
        per_record = max(1, round(INTERNAL / settings.rate))
        records["ft"] = (self._measured + per_record * (1 + np.arange(n))) % 2**32
        self._measured += per_record * n
        if showing(settings.faults, FaultKind.HANG, since):
            self._stood = self._stood or int(records["ft"][0])
            records["ft"] = self._stood
            records["counts"] = records["counts"][0]
        else:
            self._stood = 0
        if showing(settings.faults, FaultKind.STATUS, since):
            records["status"] = _UNWELL
        if showing(settings.faults, FaultKind.SATURATION, since):
            records["status"] |= _UNWELL & 1 << 31 | SATURATED[settings.device.value]
            records["counts"][:, 2] = 2**31 - 1
        return records

    def _deliver(self, packets: list[bytes], since: float) -> None:
        """Sends packets as the fault of the moment lets them go."""
        packets = self._wire.transmit(packets, since)
        self.report.withheld = self._wire.withheld
        sent = 0
        for packet in packets:
            try:
                self._socket.sendto(packet, self._client or ("", 0))
                sent += 1
            except OSError:  # no client any more, or the system's buffer is full
                break
        self.report.sent += sent

    def _take_requests(self, since: float) -> None:
        silent = showing(self.settings.faults, FaultKind.SILENCE, since)
        if silent:
            self._client = None
        while True:
            try:
                data, address = self._socket.recvfrom(64)
            except BlockingIOError:
                return
            except OSError:
                continue  # a port that was sent to has gone
            if silent:
                continue
            try:
                command, count = read_request(data)
            except FormatError:
                self.report.refused += 1
                continue
            self.report.requests += 1
            self._obey(command, count, address)

    def _obey(self, command: RdtCommand, count: int, address: tuple[str, int]) -> None:
        if command in (RdtCommand.START, RdtCommand.START_BUFFERED):
            self._client, self._left, self._number = address, count or math.inf, 0
        elif command is RdtCommand.STOP:
            self._client = None
        elif command is RdtCommand.BIAS:
            self._bias = self._scenario.sensor_wrench(np.array([time.monotonic()]))[0]

    async def _serve_page(self) -> asyncio.Server | None:
        if self.settings.page_port is None:
            return None
        body = netftapi_page(self.settings)

        async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            try:
                async with asyncio.timeout(2.0):
                    asked = await reader.readuntil(b"\r\n\r\n")
                found = asked.split(b" ", 2)[1:2] == [b"/netftapi2.xml"]
                status = b"200 OK" if found else b"404 Not Found"
                text = body if found else b""
                head = b"Content-Type: text/xml\r\nContent-Length: %d\r\nConnection: close"
                writer.write(b"HTTP/1.1 " + status + b"\r\n" + head % len(text) + b"\r\n\r\n")
                writer.write(text)
                await writer.drain()
            except (OSError, TimeoutError, EOFError, asyncio.LimitOverrunError):
                pass  # the client has gone, or speaks no HTTP
            finally:
                writer.close()

        server = await asyncio.start_server(answer, self.settings.host, self.settings.page_port)
        self.page_port = server.sockets[0].getsockname()[1]
        return server


class _Ahead:
    """Force and noise of the next records, computed ahead of time."""

    def __init__(self, settings: RdtSensorSettings, scenario: OnlineScenario) -> None:
        self._scenario = scenario
        self._step = 1.0 / (settings.rate * (1.0 + settings.drift))
        self._random = np.random.default_rng([settings.seed, 301])
        self._scatter = np.repeat([settings.force_noise, settings.torque_noise], 3)
        self._felt, self._first = np.zeros((0, 6)), 0.0
        self._noise = np.zeros((0, 6))

    def wrench(self, times: Array) -> Array:
        """Returns what is felt (n, 6) at consecutive moments (n,) s."""
        n = len(times)
        if not n:
            return np.zeros((0, 6))
        place = (float(times[0]) - self._first) / self._step
        row = round(place)
        if not (0 <= row <= len(self._felt) - n and abs(place - row) < _ON_GRID):
            self._first, row = float(times[0]), 0
            ahead = self._first + self._step * np.arange(max(n, _AHEAD), dtype=np.float64)
            self._felt = self._scenario.sensor_wrench(ahead)
        return self._felt[row : row + n]

    def noise(self, n: int) -> Array:
        """Returns the noise (n, 6) of the next records, independent of block sizes."""
        if n > len(self._noise):
            more = self._random.standard_normal((max(n, _AHEAD), 6)) * self._scatter
            self._noise = np.concatenate([self._noise, more])
        taken, self._noise = self._noise[:n], self._noise[n:]
        return taken
