"""Logged-in sessions, and the limit of password guesses."""

from __future__ import annotations

import contextlib
import functools
import hmac
import ipaddress
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Final

LIFETIME: Final = 12 * 3600.0
"""s without a request after which one logs in again."""
MOST_SESSIONS: Final = 1000
TRIES: Final = 5
"""Guesses from one address within :data:`WINDOW`."""
WINDOW: Final = 60.0
"""s."""


class Sessions:
    """Sessions by random names; in memory, so a restart logs all users out."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._until: dict[str, float] = {}
        self._at_end: dict[str, set[Callable[[], None]]] = {}

    def open(self) -> str:
        """Returns the name of a new session, 256 random bits."""
        now = self._clock()
        self._until = {k: until for k, until in self._until.items() if until > now}
        while len(self._until) >= MOST_SESSIONS:  # the one that ends first goes
            self.close(min(self._until, key=self._until.__getitem__))
        name = secrets.token_urlsafe(32)
        self._until[name] = now + LIFETIME
        return name

    def holds(self, name: str) -> bool:
        """Returns whether a session is open, and keeps it open from now."""
        now = self._clock()
        if self._until.get(name, 0.0) <= now:
            self._until.pop(name, None)
            return False
        self._until[name] = now + LIFETIME
        return True

    def close(self, name: str) -> None:
        """Ends a session and everything opened with it; unknown names are ignored."""
        self._until.pop(name, None)
        for end in self._at_end.pop(name, set()):
            end()

    @contextlib.contextmanager
    def at_end(self, name: str, end: Callable[[], None]) -> Iterator[None]:
        """Calls ``end`` if the session is closed within the block."""
        self._at_end.setdefault(name, set()).add(end)
        try:
            yield
        finally:
            waiting = self._at_end.get(name, set())
            waiting.discard(end)
            if not waiting:
                self._at_end.pop(name, None)


class Tries:
    """Guesses of the last minute, by address; those of one address never count for another."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._guesses: OrderedDict[str, list[float]] = OrderedDict()  # the latest guess last

    def wait(self, address: str) -> float:
        """Returns the seconds until this address may guess again; 0 is now."""
        now = self._clock()
        while self._guesses:
            who, times = next(iter(self._guesses.items()))
            if times[-1] > now - WINDOW:
                break
            del self._guesses[who]
        recent = [at for at in self._guesses.get(address, ()) if at > now - WINDOW]
        return recent[-TRIES] + WINDOW - now if len(recent) >= TRIES else 0.0

    def count(self, address: str) -> None:
        """Counts a guess; called before the guess is compared, with nothing awaited between."""
        times = self._guesses.setdefault(address, [])
        times.append(self._clock())
        del times[:-TRIES]
        self._guesses.move_to_end(address)

    def uncount(self, address: str) -> None:
        """Removes the latest attempt of an address: it was correct."""
        times = self._guesses.get(address, [])
        del times[-1:]
        if not times:
            self._guesses.pop(address, None)


@functools.lru_cache(maxsize=4096)
def client_group(host: str) -> str:
    """Returns the address, or for IPv6 the /64 network: one machine can use all of a network."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(ipaddress.ip_network((address, 64), strict=False))


def same_secret(given: str, wanted: str) -> bool:
    """Returns whether two secrets are equal, in constant time; empty ones are not."""
    return bool(wanted) and hmac.compare_digest(given.encode(), wanted.encode())
