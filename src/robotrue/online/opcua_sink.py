"""Estimates as an OPC UA server for supervision: the tree of :mod:`robotrue.online.opcua_nodes`.

With a folder of NodeSet files the joints are also nodes of a robot of the Robotics companion model.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import logging
import math
import socket
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from asyncua import Node, Server, ua
from asyncua.crypto.permission_rules import User, UserRole

from robotrue.errors import ConfigurationError
from robotrue.online import opcua_nodes as nodes
from robotrue.online.estimates import Envelopes, EstimateBin, EstimateBlock, doubt_words
from robotrue.online.link import Health, health_document
from robotrue.online.net_address import NetAddress
from robotrue.online.queues import LatestQueue
from robotrue.online.sinks import DisplaySink, SinkSettings, utc_seconds

USER_VARIABLE: Final = "ROBOTRUE_OPCUA_USER"
PASSWORD_VARIABLE: Final = "ROBOTRUE_OPCUA_PASSWORD"  # noqa: S105 (the name of a variable)
CERTIFICATE_VARIABLE: Final = "ROBOTRUE_OPCUA_CERTIFICATE"
KEY_VARIABLE: Final = "ROBOTRUE_OPCUA_KEY"  # (PEM or DER, as the certificate)
_PER_SECOND: Final = 10.0
_STALE_BEATS: Final = 10


class OpcUaSink(DisplaySink):
    """A server that shows the latest estimate, its band, its warnings and every link's counters."""

    def __init__(self, address: NetAddress, settings: SinkSettings) -> None:
        """Takes ``opcua://host:port?rate=10``; user and password from the address or environment.

        With ``ROBOTRUE_OPCUA_CERTIFICATE`` and ``_KEY`` only signed and encrypted channels
        (Basic256Sha256) are offered.

        Raises:
            ConfigurationError: An invalid rate, or other computers could look without a password.
        """
        super().__init__(address, settings, beat=0.2)
        options = address.read_options({"rate": "updates per second, 1 to 50"})
        env = settings.environment
        self._user = address.user or env.get(USER_VARIABLE, "")
        self._password = address.password or env.get(PASSWORD_VARIABLE, "")
        if bool(self._user) != bool(self._password) or not (self._user or address.loopback):
            raise ConfigurationError(
                f"{address.shown} with {'a' if self._user else 'no'} user and "
                f"{'a' if self._password else 'no'} password, expected both"
                + ("." if address.loopback else ": other computers can reach it."),
                hint=f"set {USER_VARIABLE} and {PASSWORD_VARIABLE}, or opcua://127.0.0.1.",
            )
        rate = options.number("rate", "Hz", default=_PER_SECOND, low=1.0, high=50.0)
        self._envelopes = Envelopes(per_second=rate, joints=settings.joints)
        self._waiting: LatestQueue[EstimateBin | None] = LatestQueue(8)
        self._server: Server | None = None
        self._numbers: list[tuple[nodes.Reading, Node]] = []
        self._positions: list[Node] = []
        self._marks: dict[str, Node] = {}
        self._links: dict[str, dict[str, Node]] = {}
        self._health_folder: Node = None
        self._tasks: list[asyncio.Task[None]] = []

    async def open(self) -> None:
        """Builds the tree and begins to listen.

        Raises:
            ConfigurationError: The port is taken, a NodeSet file or a certificate is missing.
            FormatError: A NodeSet file cannot be imported.
        """
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # a client that goes is no error
        server = None
        try:
            with socket.create_server((self._address.host, self._address.port)):
                pass  # reported now, not after the seconds that the tree takes
            server = await self._build_server()
            await server.start()
        except OSError as cause:
            if server is not None:
                with contextlib.suppress(Exception):
                    await server.stop()
            raise ConfigurationError(
                f"cannot listen at {self._address.shown}: {cause.strerror}.",
                hint="another port, or the process that holds this one.",
            ) from cause
        self._server = server
        self._tasks = [asyncio.create_task(self._show()), asyncio.create_task(self._beat())]

    async def _build_server(self) -> Server:
        server = Server(user_manager=_Users(self._user, self._password) if self._user else None)
        await self._secure(server)
        await server.init()
        host = f"[{self._address.host}]" if ":" in self._address.host else self._address.host
        server.set_endpoint(f"opc.tcp://{host}:{self._address.port}/")
        server.set_server_name(f"robotrue {self._settings.cell}")
        server.set_identity_tokens(
            [ua.UserNameIdentityToken] if self._user else [ua.AnonymousIdentityToken]
        )
        if self._settings.nodesets is not None:
            await nodes.import_models(server, Path(self._settings.nodesets))
            index = await server.register_namespace(nodes.URI)
            self._positions = await nodes.add_robot(
                server, index, self._settings.cell, self._settings.joints
            )
        index = await server.register_namespace(nodes.URI)
        await self._grow(server.nodes.objects, index)
        return server

    async def _secure(self, server: Server) -> None:
        env: Mapping[str, str] = self._settings.environment
        certificate, key = env.get(CERTIFICATE_VARIABLE, ""), env.get(KEY_VARIABLE, "")
        if not certificate and not key:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
            return
        try:
            await server.load_certificate(certificate)
            await server.load_private_key(key)
        except Exception as cause:  # whatever the library finds wrong with them
            raise ConfigurationError(
                f"certificate or key of {self._address.shown} cannot be read "
                f"({type(cause).__name__}).",
                hint=f"{CERTIFICATE_VARIABLE} and {KEY_VARIABLE} name files, PEM or DER.",
            ) from cause
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])

    async def _grow(self, objects: Node, index: int) -> None:
        cell = await objects.add_object(index, self._settings.cell)
        marks = {
            "Note": self._settings.note,
            "Valid": False,
            "Doubt": ua.Variant(0, ua.VariantType.UInt32),
            "DoubtText": "",
            "Sequence": 0,
        }
        for name, value in marks.items():
            self._marks[name] = await cell.add_variable(index, name, value)
        folders: dict[str, Node] = {}
        for reading in nodes.readings(self._settings.joints):
            if reading.folder not in folders:
                folders[reading.folder] = await cell.add_object(index, reading.folder)
            node = await nodes.add_reading(
                folders[reading.folder], index, reading.name, reading.unit
            )
            self._numbers.append((reading, node))
        self._health_folder = await cell.add_object(index, "Health")
        await self._show_health()

    def _take(self, estimates: EstimateBlock) -> None:
        for estimate_bin in self._envelopes.add(estimates):
            self._waiting.put(estimate_bin)

    def _rest(self, beats: int) -> None:
        """Shows what a stream that stopped has left, then that nothing comes."""
        for estimate_bin in self._envelopes.flush():
            self._waiting.put(estimate_bin)
        if beats == _STALE_BEATS:
            self._waiting.put(None)

    async def _show(self) -> None:
        """Writes bins to the nodes; None marks the end of the stream."""
        while True:
            each = await self._waiting.take()
            if each is None:
                await self._show_nothing()
            else:
                await self._show_bin(each)

    async def _show_bin(self, b: EstimateBin) -> None:
        at = datetime.fromtimestamp(utc_seconds(b.host_time), UTC)
        for reading, node in self._numbers:
            value = nodes.reading_value(reading, b)
            known = math.isfinite(value)
            whole = b.invalid == 0 or reading.folder == "Joints"
            await self._put(node, value, nodes.status_name(b.doubt, known=known, whole=whole), at)
            if reading.folder == "Joints" and self._positions:
                position = self._positions[reading.column - 15]
                await self._put(position, value, "Good" if known else "BadNoData", at)
        marks = self._marks
        await self._put(marks["Valid"], bool(math.isfinite(b.last[0])), "Good", at)
        await self._put(marks["Doubt"], ua.Variant(b.doubt, ua.VariantType.UInt32), "Good", at)
        await self._put(marks["DoubtText"], doubt_words(b.doubt), "Good", at)
        await self._put(marks["Sequence"], b.sequence, "Good", at)

    async def _show_nothing(self) -> None:
        now = datetime.now(UTC)
        numbers = [node for _, node in self._numbers] + self._positions
        for node in numbers:
            await self._put(node, float("nan"), "BadNoCommunication", now)
        await self._put(self._marks["Valid"], False, "Good", now)
        await self._put(self._marks["DoubtText"], "no estimates arrive", "Good", now)

    async def _put(self, node: Node, value: object, status: str, at: datetime) -> None:
        await node.write_value(
            ua.DataValue(
                value if isinstance(value, ua.Variant) else ua.Variant(value),
                ua.StatusCode(ua.UInt32(getattr(ua.StatusCodes, status))),
                SourceTimestamp=at,
            )
        )

    async def _show_health(self) -> None:
        now = datetime.now(UTC)
        for health in self._settings.healths():
            values = health_document(health)
            if health.name not in self._links:
                self._links[health.name] = await self._new_link(health.name)
            for key, node in self._links[health.name].items():
                value = values[key]
                status = "BadNoData" if value is None else "Good"
                await self._put(node, math.nan if value is None else value, status, now)

    async def _new_link(self, name: str) -> dict[str, Node]:
        folder = self._health_folder
        index = folder.nodeid.NamespaceIndex
        link = await folder.add_object(index, name)
        counters = {"connected": await link.add_variable(index, "Connected", False)}
        for key in nodes.COUNTERS:
            counters[key] = await link.add_variable(index, key.capitalize(), 0)
        for key, name in (
            ("turnaround_p50_ms", "TurnaroundP50"),
            ("turnaround_p99_ms", "TurnaroundP99"),
        ):
            counters[key] = await nodes.add_reading(link, index, name, "ms")
        counters["last_fault"] = await link.add_variable(index, "LastFault", "")
        return counters

    async def close(self) -> None:
        """Lets the clients go and frees the port."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._tasks = []
        if self._server is not None:
            server, self._server = self._server, None
            await server.stop()

    def health(self) -> Health:
        """Returns the counters; connected while the server runs, dropped counts updates."""
        for task in self._tasks:
            if task.done() and not task.cancelled() and task.exception() is not None:
                self._health.last_fault = f"{type(task.exception()).__name__}: {task.exception()}"
        return replace(
            self._health, connected=self._server is not None, dropped=self._waiting.dropped
        )


class _Users:
    """Accepts one user, with read access."""

    def __init__(self, user: str, password: str) -> None:
        self._user, self._password = user.encode(), password.encode()

    def get_user(
        self,
        iserver: Server,
        username: str | None = None,
        password: str | None = None,
        certificate: object = None,
    ) -> User | None:
        """Returns the user, or None for anybody else."""
        right = hmac.compare_digest((username or "").encode(), self._user)
        right &= hmac.compare_digest((password or "").encode(), self._password)
        return User(role=UserRole.User, name=username) if right else None
