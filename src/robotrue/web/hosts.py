"""Which ``Host`` and ``Origin`` a request may carry.

A page of another site that makes its own name point at this machine (DNS rebinding) would be a
page of the same origin to the browser; only the name in ``Host`` gives it away. An address in
digits cannot be made to point elsewhere, so those are let through; of names only those stated.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Iterable

from robotrue.web.serve_settings import ServeSettings


def known_names(settings: ServeSettings) -> frozenset[str]:
    """Returns the host names the workbench answers to, in lower case."""
    names = {"localhost", *settings.names}
    if not settings.loopback:
        names |= {settings.host, socket.gethostname(), socket.getfqdn()}
    return frozenset(name.lower() for name in names)


def host_is_known(host: str, names: Iterable[str], *, loopback: bool) -> bool:
    """Returns whether a ``Host`` header names this server.

    Args:
        host: The header, ``name``, ``name:port`` or ``[v6]:port``.
        names: From :func:`known_names`.
        loopback: Whether the server listens to this machine alone; then so must the address be.
    """
    name = _without_port(host.strip().lower())
    if name in names:
        return True
    try:
        address = ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return address.is_loopback or not loopback


def origin_is_own(origin: str, host: str, *, secure: bool) -> bool:
    """Returns whether an ``Origin`` header is the server the request went to."""
    return origin.lower() == f"{'https' if secure else 'http'}://{host.strip().lower()}"


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]
