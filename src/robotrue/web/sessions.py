"""Who is logged in, and how often a wrong password may be tried."""

from __future__ import annotations

import hmac
import secrets
import time
from collections import deque
from collections.abc import Callable
from typing import Final

LIFETIME: Final = 12 * 3600.0
"""s without a request after which one logs in again."""
MOST_SESSIONS: Final = 1000
TRIES: Final = 5
"""Wrong passwords from one address within :data:`WINDOW`."""
TRIES_OF_ALL: Final = 50
WINDOW: Final = 60.0
"""s."""


class Sessions:
    """Sessions by their random names; kept in memory, so a restart logs everybody out."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._until: dict[str, float] = {}

    def open(self) -> str:
        """Returns the name of a new session, 256 random bits."""
        now = self._clock()
        self._until = {k: until for k, until in self._until.items() if until > now}
        while len(self._until) >= MOST_SESSIONS:  # the one that ends first goes
            del self._until[min(self._until, key=self._until.__getitem__)]
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
        """Ends a session; one that is not open stays so."""
        self._until.pop(name, None)


class Tries:
    """Wrong passwords of the last minute, by address and in all."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: deque[tuple[float, str]] = deque(maxlen=10 * TRIES_OF_ALL)

    def wait(self, address: str) -> float:
        """Returns the seconds until this address may try again; 0 is now."""
        now = self._clock()
        while self._wrong and self._wrong[0][0] <= now - WINDOW:
            self._wrong.popleft()
        own = [at for at, who in self._wrong if who == address]
        if len(own) >= TRIES:
            return own[-TRIES] + WINDOW - now
        if len(self._wrong) >= TRIES_OF_ALL:
            return self._wrong[-TRIES_OF_ALL][0] + WINDOW - now
        return 0.0

    def wrong(self, address: str) -> None:
        """Notes a wrong password."""
        self._wrong.append((self._clock(), address))


def same_secret(given: str, wanted: str) -> bool:
    """Returns whether two secrets are equal, in a time that tells nothing; empty ones are not."""
    return bool(wanted) and hmac.compare_digest(given.encode(), wanted.encode())
