"""Access check for live data: origins, host names and tokens, before any data is sent."""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from urllib.parse import parse_qs, urlsplit

from robotrue.errors import ConfigurationError
from robotrue.online.net_address import NetAddress

TOKEN_VARIABLE: Final = "ROBOTRUE_WS_TOKEN"  # noqa: S105 (the name of a variable)
SHORTEST_TOKEN: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Door:
    """Credentials that a request must carry.

    A page of some other site in the same browser can reach this computer's own addresses; its
    origin gives it away, or the host name it was sent to if that name was bent to point here.

    Attributes:
        token: To be shown by every viewer; empty requires none.
        names: Host names this server goes by; None where any name is valid, which requires the
            token.
        origins: Other pages that may connect, ``https://host:port``.
    """

    token: str
    names: frozenset[str] | None
    origins: frozenset[str]

    def __repr__(self) -> str:
        """Returns what may be logged."""
        return f"Door(token={'set' if self.token else 'none'}, names={self.names})"

    def refusal(self, path: str, host: str | None, origin: str | None, bearer: str) -> str:
        """Returns why a request is refused, or an empty text.

        Args:
            path: Requested path, with its query.
            host: ``Host`` header, or None.
            origin: ``Origin`` header, or None: no browser.
            bearer: ``Authorization`` header, or empty.
        """
        if self.names is not None and _name(host) not in self.names:
            return f"host {(host or '')[:80]!r} is not this server"
        if origin is not None and origin not in self.origins:
            parts = urlsplit(origin)
            if parts.scheme not in ("http", "https") or parts.netloc != host:
                return f"origin {origin[:80]!r} has no access"
        if self.token and not self._is_authorised(path, bearer):
            return "no token, or a wrong one"
        return ""

    def _is_authorised(self, path: str, bearer: str) -> bool:
        shown = parse_qs(urlsplit(path).query).get("token", [""])[0]
        if bearer.startswith("Bearer "):
            shown = bearer.removeprefix("Bearer ")
        return hmac.compare_digest(shown.encode(), self.token.encode())


def door(address: NetAddress, environment: Mapping[str, str]) -> Door:
    """Returns what the viewers of a server at ``address`` must bring.

    Raises:
        ConfigurationError: It can be reached from other computers and there is no token, or a
            token is too short, or an origin is none.
    """
    token = environment.get(TOKEN_VARIABLE, "") or address.options.get("token", "")
    if not token and not address.loopback:
        raise ConfigurationError(
            f"{address.shown} can be reached from other computers, expected a token of "
            f"{SHORTEST_TOKEN} characters or more.",
            hint=f"set {TOKEN_VARIABLE}, or ws://127.0.0.1 for this computer alone.",
        )
    if token and len(token) < SHORTEST_TOKEN:
        raise ConfigurationError(
            f"a token of {len(token)} characters for {address.shown}, expected "
            f"{SHORTEST_TOKEN} or more."
        )
    origins = frozenset(o for o in address.options.get("origin", "").split(",") if o)
    if bad := sorted(o for o in origins if urlsplit(o).geturl() != f"{_origin(o)}"):
        raise ConfigurationError(f"origin {bad[0]!r}, expected one like https://host:port.")
    own = frozenset({"127.0.0.1", "localhost", "[::1]"}) if address.loopback else None
    return Door(token=token, names=own, origins=origins)


def _origin(text: str) -> str:
    parts = urlsplit(text)
    return f"{parts.scheme}://{parts.netloc}" if parts.netloc else ""


def _name(host: str | None) -> str:
    """Returns a ``Host`` header without its port."""
    if not host:
        return ""
    return host[: host.rfind(":")] if host.rpartition(":")[2].isdigit() else host
