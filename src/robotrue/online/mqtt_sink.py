"""Estimates to an MQTT broker, for supervision: drop to latest while it is away, never in the way.

Topics below ``<prefix>`` (``robotrue/<cell>`` unless the address names another):

* ``estimate``, QoS 0: JSON object with ``schema``, ``cell``, ``note``, ``utc_s`` (of the last row),
  ``rows`` and one list for each column: ``host_s``, ``sequence``, those of
  :func:`~robotrue.online.estimates.number_columns`, ``doubt``; ``doubt_words`` names the
  values that occur. null is not known.
* ``health``, QoS 0, once a second: ``links``, the counters of the sources and sinks.
* ``status``, QoS 1, retained: ``online``; ``offline`` when the service ends, and as its last will.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import ssl
from collections.abc import Coroutine, Sequence
from dataclasses import replace
from typing import Final

import aiomqtt
import numpy as np

from robotrue.errors import ConfigurationError
from robotrue.online.estimates import EstimateBlock, doubt_words, number_columns, numbers
from robotrue.online.link import Health, health_document
from robotrue.online.net_address import NetAddress
from robotrue.online.queues import LatestQueue
from robotrue.online.sinks import DisplaySink, SinkSettings, utc_seconds

USER_VARIABLE: Final = "ROBOTRUE_MQTT_USER"
PASSWORD_VARIABLE: Final = "ROBOTRUE_MQTT_PASSWORD"  # noqa: S105 (the name of a variable)
AUTHORITY_VARIABLE: Final = "ROBOTRUE_MQTT_CA"
SCHEMA: Final = "robotrue.estimate/1"
_PER_SECOND: Final = 20.0
_MOST_ROWS: Final = 1000
_MOST_MESSAGES: Final = 60
"""Messages kept while the broker is away: three seconds at the usual rate."""
_TIMEOUT: Final = 5.0
_FIRST_WAIT: Final = 0.5
_LONGEST_WAIT: Final = 30.0
_LOGGER: Final = logging.getLogger("robotrue.online.mqtt")

_Message = tuple[EstimateBlock, ...]
"""Blocks of one message; none of them for the counters."""


class MqttSink(DisplaySink):
    """A client of a broker that comes back by itself."""

    def __init__(self, address: NetAddress, settings: SinkSettings) -> None:
        """Takes ``mqtt://user:password@host:port/prefix?rate=20``, or ``mqtts://`` for TLS.

        User, password and the file of the authority that signed the broker's certificate may come
        from ``ROBOTRUE_MQTT_USER``, ``_PASSWORD`` and ``_CA`` instead.

        Raises:
            ConfigurationError: A prefix no topic can have, an invalid rate, or a certificate that
                cannot be read.
        """
        super().__init__(address, settings, beat=0.2)
        options = address.read_options({"rate": "messages per second, 0.1 to 100"})
        self._prefix = address.path or f"robotrue/{settings.cell}"
        if bad := sorted(set(self._prefix) & set("+#\0")):
            raise ConfigurationError(f"{address.shown}: {bad} in a topic, expected none.")
        self._span = 1.0 / options.number("rate", "Hz", default=_PER_SECOND, low=0.1, high=100.0)
        self._tls = _tls(address, settings)
        self._waiting: LatestQueue[_Message] = LatestQueue(_MOST_MESSAGES)
        self._blocks: list[EstimateBlock] = []
        self._rows = 0
        self._tasks: list[asyncio.Task[None]] = []
        self._joined = 0

    async def open(self) -> None:
        """Begins to connect; a broker that does not answer is tried again, ever more rarely."""
        _LOGGER.setLevel(logging.CRITICAL)
        self._tasks = [asyncio.create_task(self._keep()), asyncio.create_task(self._beat())]

    def _take(self, estimates: EstimateBlock) -> None:
        """Takes a block for the next message."""
        self._blocks.append(estimates)
        self._rows += len(estimates)
        span = estimates.host_time[-1] - self._blocks[0].host_time[0]
        if self._rows >= _MOST_ROWS or not 0.0 <= span < self._span:
            self._close_message()

    def _close_message(self) -> None:
        if self._blocks:
            self._waiting.put(tuple(self._blocks))
            self._blocks, self._rows = [], 0

    def _rest(self, beats: int) -> None:
        self._close_message()

    async def _show_health(self) -> None:
        if self._health.connected:
            self._waiting.put(())

    async def _keep(self) -> None:
        """Stays connected until the queue is closed and empty."""
        wait = _FIRST_WAIT
        while True:
            try:
                async with self._client() as client:
                    await self._say(client, "status", "online", lasting=True)
                    self._health.connected, wait = True, _FIRST_WAIT
                    self._joined += 1
                    await _wait_for_first(self._send(client), _until_gone(client))
                    await self._say(client, "status", "offline", lasting=True)
                    return
            except (aiomqtt.MqttError, OSError, ValueError) as cause:
                self._health.last_fault = f"{cause}" or type(cause).__name__
            finally:
                self._health.connected = False
            await asyncio.sleep(wait)
            wait = min(2.0 * wait, _LONGEST_WAIT)

    async def _send(self, client: aiomqtt.Client) -> None:
        """Sends messages until there are no more to come. One that fails to go is lost."""
        while (blocks := await self._waiting.take()) is not None:
            if not blocks:
                links = [health_document(h) for h in self._settings.healths()]
                await self._say(client, "health", json.dumps({"links": links}, allow_nan=False))
                continue
            try:
                await self._say(client, "estimate", estimate_message(blocks, self._settings))
            except BaseException:
                self._health.refused += len(blocks)
                raise

    def _client(self) -> aiomqtt.Client:
        env = self._settings.environment
        return aiomqtt.Client(
            self._address.host,
            self._address.port,
            username=self._address.user or env.get(USER_VARIABLE) or None,
            password=self._address.password or env.get(PASSWORD_VARIABLE) or None,
            will=aiomqtt.Will(f"{self._prefix}/status", "offline", qos=1, retain=True),
            tls_context=self._tls,
            timeout=_TIMEOUT,
            keepalive=10,
            logger=_LOGGER,
        )

    async def _say(
        self, client: aiomqtt.Client, topic: str, text: str, *, lasting: bool = False
    ) -> None:
        await client.publish(
            f"{self._prefix}/{topic}", text, qos=1 if lasting else 0, retain=lasting
        )

    async def close(self) -> None:
        """Sends queued blocks if the broker is reachable, publishes "offline", disconnects."""
        self._close_message()
        self._waiting.close()
        if not self._tasks:
            return
        keeper, beats = self._tasks
        beats.cancel()
        if self._health.connected:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(asyncio.shield(keeper), _TIMEOUT)
        keeper.cancel()
        await asyncio.gather(keeper, beats, return_exceptions=True)
        self._tasks = []

    def health(self) -> Health:
        """Returns the counters; dropped counts messages, no secret is in any of it."""
        return replace(
            self._health, dropped=self._waiting.dropped, reconnects=max(0, self._joined - 1)
        )


async def _until_gone(client: aiomqtt.Client) -> None:
    """Reads messages, though none are sent: the only way to notice at once that the broker is gone.

    Raises:
        MqttError: The broker is gone.
    """
    async for _ in client.messages:
        pass


async def _wait_for_first(*work: Coroutine[object, object, None]) -> None:
    """Waits until one is done, ends the others and raises what the one raised."""
    tasks = [asyncio.ensure_future(w) for w in work]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        found = await asyncio.gather(*tasks, return_exceptions=True)
    for result in found:
        if isinstance(result, Exception):
            raise result


def estimate_message(blocks: Sequence[EstimateBlock], settings: SinkSettings) -> str:
    """Returns the JSON text of one message.

    Raises:
        ShapeError: A block of an arm with another number of joints.
    """
    values = np.concatenate([numbers(b, settings.joints) for b in blocks])
    doubt = np.concatenate([b.doubt for b in blocks]).tolist()
    known = np.isfinite(values)
    columns = {
        name: [v if k else None for v, k in zip(column, there, strict=True)]
        for name, column, there in zip(
            number_columns(settings.joints),
            np.round(values, 4).T.tolist(),
            known.T.tolist(),
            strict=True,
        )
    }
    document = {
        "schema": SCHEMA,
        "cell": settings.cell,
        "note": settings.note,
        "utc_s": round(utc_seconds(float(blocks[-1].host_time[-1])), 6),
        "rows": len(doubt),
        "host_s": np.concatenate([b.host_time for b in blocks]).round(9).tolist(),
        "sequence": np.concatenate([b.sequence for b in blocks]).tolist(),
        **columns,
        "doubt": doubt,
        "doubt_words": {str(d): doubt_words(d) for d in sorted(set(doubt))},
    }
    return json.dumps(document, separators=(",", ":"), allow_nan=False)


def _tls(address: NetAddress, settings: SinkSettings) -> ssl.SSLContext | None:
    if address.scheme != "mqtts":
        return None
    path = settings.environment.get(AUTHORITY_VARIABLE) or None
    try:
        return ssl.create_default_context(cafile=path)
    except OSError as cause:
        raise ConfigurationError(
            f"{address.shown}: the certificates cannot be read: {cause.strerror}.",
            source=path,
            hint=f"{AUTHORITY_VARIABLE} names a PEM file.",
        ) from cause
