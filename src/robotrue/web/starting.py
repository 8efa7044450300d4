"""A start that is soon over: nothing is loaded that a server has no use for."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, cast

CLIENTS: Final = ("aiohttp", "requests", "tornado")
"""What the WebSocket library takes in if it is installed, a third of all that would be loaded: two
HTTP clients, and another server."""


@contextmanager
def lightly() -> Iterator[None]:
    """Imports within are done without :data:`CLIENTS`, and without a look for garbage.

    Modules make hundreds of thousands of objects that stay; the collector would go through all of
    them again and again. Those that are there at the end it never looks at again.
    """
    hidden = [name for name in CLIENTS if name not in sys.modules]
    modules = cast(dict[str, Any], sys.modules)
    collecting = gc.isenabled()
    gc.disable()
    modules.update(dict.fromkeys(hidden))  # None: an import of it fails at once
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]
        gc.freeze()
        if collecting:
            gc.enable()
