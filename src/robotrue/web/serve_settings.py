"""Settings of the workbench's server: address, users, and limits of files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from robotrue.app.serve_defaults import HOST, PORT
from robotrue.errors import ConfigurationError
from robotrue.online.net_address import is_loopback, net_address

MB: Final = 1024 * 1024
SHORTEST_PASSWORD: Final = 8
SHORTEST_TOKEN: Final = 16
SENSE_PORT: Final = 8765
"""Of ``robotrue sense --out ws://host``."""


def service_address(text: str) -> str:
    """Returns the address of a sensing service as ``ws://host:port``.

    Raises:
        ConfigurationError: It is none.
    """
    where = net_address(text.strip(), default_port=SENSE_PORT)
    where.read_options({})
    if where.scheme != "ws" or where.user or where.path:
        raise ConfigurationError(
            f"{where.scheme}:// is no address of robotrue sense --out ws://..., expected "
            "ws://host:port.",
            hint=f"ws://127.0.0.1:{SENSE_PORT}",
        )
    return where.shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Resources that one client may use before it is refused or dropped.

    Attributes:
        head_bytes: Of one request head.
        head_seconds: From the first byte of a head, or from the connection, until it is whole.
        body_seconds: Between two pieces of a body, and for the whole of a small one.
        body_rate: Bytes per second that a longer body must come with on average.
        per_address: Open connections of one address.
        connections: Open connections of all.
    """

    head_bytes: int = 64 * 1024
    head_seconds: float = 10.0
    body_seconds: float = 10.0
    body_rate: float = 16.0 * 1024
    per_address: int = 128
    connections: int = 1024

    def at_most(self, connections: int) -> Limits:
        """Returns limits for no more connections than given, half of them for one address."""
        total = min(self.connections, connections)
        return replace(self, connections=total, per_address=min(self.per_address, total // 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class ServeSettings:
    """Options of ``robotrue serve``.

    Attributes:
        workspace: Folder (or address) of the workspace.
        host: Address listened on; ``127.0.0.1`` is this machine alone.
        port: TCP port; 0 takes a free one.
        password: What people log in with; empty requires none.
        token: What programs send as ``Authorization: Bearer``; empty lets none in.
        names: Further host names the workbench is reached by.
        certificate: TLS certificate (PEM), or None for plain HTTP.
        key: Its private key.
        sense: Addresses of sensing services that are connected to besides those of this computer,
            and are sent the token of ``ROBOTRUE_WS_TOKEN``.
        upload_limit: Bytes of one uploaded file.
        upload_total: Bytes of all uploads of which nothing was made yet; 0: four times the limit
            of one.
        kinds: Of jobs that are done here, ``module:function`` by name; empty leaves them to others.
        limits: Of requests and connections.
    """

    workspace: Path
    host: str = HOST
    port: int = PORT
    password: str = ""
    token: str = ""
    names: tuple[str, ...] = ()
    certificate: Path | None = None
    key: Path | None = None
    sense: tuple[str, ...] = ()
    upload_limit: int = 1024 * MB
    upload_total: int = 0
    kinds: Mapping[str, str] = field(default_factory=dict)
    limits: Limits = Limits()

    def __post_init__(self) -> None:
        """Refuses what would let anybody in.

        Raises:
            ConfigurationError: Another address without a secret, a secret too short to be one, an
                invalid port, half of a certificate, a total of uploads smaller than one, or no
                sensing service.
        """
        if not 0 <= self.port <= 65535:
            raise ConfigurationError(f"port {self.port}, expected 0 to 65535.", hint="--port 8080")
        if not self.loopback and not self.guarded:
            raise ConfigurationError(
                f"{self.host} can be reached from other machines, and neither a password nor a "
                "token is set.",
                hint="export BENCH_PASSWORD=...; robotrue serve --password-env BENCH_PASSWORD",
            )
        for name, secret, least in (
            ("password", self.password, SHORTEST_PASSWORD),
            ("token", self.token, SHORTEST_TOKEN),
        ):
            if secret and len(secret) < least:
                raise ConfigurationError(
                    f"the {name} has {len(secret)} characters, expected at least {least}.",
                    hint='python3 -c "import secrets; print(secrets.token_urlsafe(24))"',
                )
        if (self.certificate is None) != (self.key is None):
            raise ConfigurationError(
                "a certificate needs its key, and a key its certificate.",
                hint="--tls-cert cell.pem --tls-key cell.key",
            )
        if not self.upload_total:
            object.__setattr__(self, "upload_total", 4 * self.upload_limit)
        if self.upload_total < self.upload_limit:
            raise ConfigurationError(
                f"all uploads may take {self.upload_total / MB:g} MB, less than one alone "
                f"({self.upload_limit / MB:g} MB).",
                hint="a larger --upload-total-mb.",
            )
        object.__setattr__(self, "sense", tuple(map(service_address, self.sense)))

    @property
    def loopback(self) -> bool:
        """True if only this machine can reach the address."""
        return is_loopback(self.host)

    @property
    def guarded(self) -> bool:
        """True if users must log in."""
        return bool(self.password or self.token)

    @property
    def secure(self) -> bool:
        """True if the connection is encrypted."""
        return self.certificate is not None
