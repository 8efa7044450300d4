"""Addresses of the kind ``scheme://user:password@host:port/path?options``, taken apart safely."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from robotrue.errors import ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class NetAddress:
    """An address of a network, taken apart.

    Attributes:
        scheme: Before ``://``.
        host: Name or number.
        port: 0 for a server asks the system for a free one.
        path: After the port, without its first and last ``/``.
        user: Before ``@``, or empty.
        password: After the colon of the user, or empty; never printed.
        options: After ``?``.
    """

    scheme: str
    host: str
    port: int
    path: str
    user: str
    password: str
    options: dict[str, str]

    @property
    def shown(self) -> str:
        """The address as it may be printed and logged: no user, no password, no options."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}" + (f"/{self.path}" if self.path else "")

    def __repr__(self) -> str:
        """Returns what may be logged."""
        return f"NetAddress({self.shown})"

    def only(self, *allowed: str) -> NetAddress:
        """Returns the address itself.

        Raises:
            ConfigurationError: It has an option that is not among ``allowed``.
        """
        if unknown := sorted(set(self.options) - set(allowed)):
            raise ConfigurationError(
                f"{self.shown}: option {', '.join(unknown)}, expected "
                f"{', '.join(allowed) or 'none'}."
            )
        return self

    def number(self, name: str, usual: float, *, low: float, high: float) -> float:
        """Returns an option that is a number, ``usual`` where it is not given.

        Raises:
            ConfigurationError: It is no number from ``low`` to ``high``.
        """
        text = self.options.get(name, "")
        try:
            value = float(text) if text else usual
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise ConfigurationError(
                f"{self.shown}: {name} {text!r}, expected {low:g} to {high:g}.",
                hint=f"?{name}={usual:g}",
            )
        return value

    @property
    def loopback(self) -> bool:
        """Whether only programs on this computer can be meant by the host."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


def parse_peer(text: str) -> tuple[str, int]:
    """Returns number and port of ``HOST`` or ``HOST:PORT``; port 0 where none is stated.

    Raises:
        ConfigurationError: A host that is not known, or a port that is none.
    """
    host, colon, port = text.partition(":")
    try:
        number = socket.gethostbyname(host) if host else ""
    except (OSError, UnicodeError):
        number = ""
    given = int(port) if port.isdecimal() else -1
    if not number or number == "0.0.0.0" or (colon and not 0 < given < 65536):  # noqa: S104
        raise ConfigurationError(
            f"peer {text!r}, expected the address of the controller, with its port or without.",
            hint="--peer 192.168.1.10",
        )
    return number, max(given, 0)


def net_address(address: str, *, default_port: int) -> NetAddress:
    """Returns the parts of ``scheme://user:password@host:port/path?options``.

    Raises:
        ConfigurationError: No host, a port that is no port, or an option twice. The message
            never repeats the address: it may hold a password.
    """
    scheme = address.partition(":")[0].lower()
    try:
        parts = urlsplit(address)
        port = parts.port
        options = parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
    except ValueError:
        raise ConfigurationError(
            f"a {scheme} address that cannot be read.", hint=f"{scheme}://127.0.0.1:{default_port}"
        ) from None  # the cause may quote a password
    if "://" not in address or not parts.hostname or parts.fragment:
        raise ConfigurationError(
            f"a {scheme} address without a host.", hint=f"{scheme}://127.0.0.1:{default_port}"
        )
    if len(dict(options)) < len(options):
        raise ConfigurationError(f"a {scheme} address with an option twice.")
    return NetAddress(
        scheme=scheme,
        host=parts.hostname,
        port=default_port if port is None else port,
        path=unquote(parts.path.strip("/")),
        user=_unquote(parts, "username"),
        password=_unquote(parts, "password"),
        options=dict(options),
    )


def _unquote(parts: SplitResult, name: str) -> str:
    return unquote(getattr(parts, name) or "")
