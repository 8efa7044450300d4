"""Addresses of the kind ``scheme://user:password@host:port/path?options``, taken apart safely.

Options are ``name=value`` pairs, each known, each read with its unit.
"""

from __future__ import annotations

import ipaddress
import math
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from robotrue.errors import ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class NetAddress:
    """An address of a network, taken apart.

    Attributes:
        scheme: Before ``://``.
        host: Name or number.
        port: 0 for a server requests a free one from the system.
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

    def read_options(self, known: Mapping[str, str]) -> AddressOptions:
        """Returns the options; ``known`` maps each permitted name to its meaning.

        Raises:
            ConfigurationError: Another option.
        """
        return AddressOptions(self.shown, self.options, known)

    @property
    def loopback(self) -> bool:
        """True if the host can only mean this computer."""
        return is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """Returns whether a host can only be this computer."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def parse_peer(text: str) -> tuple[str, int]:
    """Returns number and port of ``HOST`` or ``HOST:PORT``; port 0 where none is stated.

    Raises:
        ConfigurationError: A host that is not known, or an invalid port.
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


def read_own_address(
    address: str, port: int, options: Mapping[str, str]
) -> tuple[NetAddress, AddressOptions]:
    """Returns an address to listen at, and its options; without a host it is all of this computer.

    Raises:
        ConfigurationError: An address or option that cannot be read.
    """
    scheme, _, rest = address.partition("://")
    if rest.startswith(":") or not rest.split("?")[0]:
        address = f"{scheme}://0.0.0.0{rest}"
    return read_device_address(address, port, options)


def read_device_address(
    address: str, port: int, options: Mapping[str, str]
) -> tuple[NetAddress, AddressOptions]:
    """Returns the address of a device, and its options.

    Raises:
        ConfigurationError: An address or option that cannot be read, or a path in it.
    """
    where = net_address(address, default_port=port)
    if where.path:
        raise ConfigurationError(
            f"{where.shown}: a path in the address of a {where.scheme} source.",
            hint=f"{where.scheme}://{where.host}:{where.port}",
        )
    return where, where.read_options(options)


class AddressOptions:
    """Options after ``?``, refused where they are not known.

    Args:
        shown: The address as messages name it.
        options: Values by name, as written.
        known: Allowed names and their meaning.

    Raises:
        ConfigurationError: An option that is not known.
    """

    def __init__(self, shown: str, options: Mapping[str, str], known: Mapping[str, str]) -> None:
        self._shown = shown
        self._options = dict(options)
        self._known = known
        if unknown := sorted(set(options) - set(known)):
            raise ConfigurationError(
                f"option {', '.join(unknown)} is unknown, expected "
                + ("; ".join(f"{name}= ({what})" for name, what in known.items()) or "none")
                + ".",
                source=shown,
            )

    @staticmethod
    def of_path(address: str, known: Mapping[str, str]) -> tuple[str, AddressOptions]:
        """Returns the path of ``scheme://PATH?options``, unchanged, and its options.

        Raises:
            ConfigurationError: No path, invalid options, one twice, or one not known.
        """
        scheme, _, rest = address.partition("://")
        path, _, query = rest.partition("?")
        try:
            pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
        except ValueError:
            pairs = []
        if not path or len(dict(pairs)) < len(pairs) or bool(query) != bool(pairs):
            raise ConfigurationError(
                "no path, or options that cannot be read.",
                source=address,
                hint=f"{scheme}://PATH?name=value&name=value",
            )
        return path, AddressOptions(f"{scheme}://{path}", dict(pairs), known)

    def has(self, name: str) -> bool:
        """Returns whether an option is stated."""
        return name in self._options

    def text(self, name: str) -> str | None:
        """Returns a value unchanged, None if it is not stated.

        Raises:
            ConfigurationError: It is stated and empty.
        """
        value = self._options.get(name)
        if value == "":
            raise self._wrong(name, "")
        return value

    def word(self, name: str, words: Sequence[str]) -> str | None:
        """Returns one of some words, None if it is not stated.

        Raises:
            ConfigurationError: Another word.
        """
        value = self._options.get(name)
        if value is not None and value not in words:
            raise self._wrong(name, value)
        return value

    def number(
        self,
        name: str,
        unit: str,
        *,
        default: float = math.nan,
        low: float = -math.inf,
        high: float = math.inf,
    ) -> float:
        """Returns a number, with its unit or without, or the default.

        Raises:
            ConfigurationError: No finite number from ``low`` to ``high``, or another unit.
        """
        text = self._options.get(name)
        if text is None:
            return default
        bare = text.strip()
        if unit and bare.endswith(unit):
            bare = bare[: -len(unit)].strip()
        try:
            value = float(bare)
        except ValueError:
            raise self._wrong(name, text) from None
        if not (math.isfinite(value) and low <= value <= high):
            raise self._wrong(name, text)
        return value

    def whole(self, name: str, unit: str, *, default: int) -> int:
        """Returns a whole number from 0, with its unit or without, or the default.

        Raises:
            ConfigurationError: No whole number from 0, or another unit.
        """
        value = self.number(name, unit, default=default)
        if value != int(value) or value < 0.0:
            raise self._wrong(name, self._options[name])
        return int(value)

    def _wrong(self, name: str, value: str) -> ConfigurationError:
        return ConfigurationError(
            f"{name}={value}, expected {self._known[name]}.", source=self._shown
        )
