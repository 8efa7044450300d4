"""Compiles kernels and keeps the machine code where the installation allows it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

from numba import njit
from numba.core import event

F = TypeVar("F", bound=Callable[..., Any])

EXACT: Final = frozenset({"contract"})
"""Fused multiply-add only: sums keep their order, NaN keeps its meaning."""
PLAIN: Final[frozenset[str]] = frozenset()
"""As written: for numbers that are read and printed."""
SUMS: Final = frozenset({"contract", "reassoc", "nsz"})
"""Sums may also be reordered, so that they run in vector registers."""
COMPILING: Final = (
    "compiling numeric kernels for this computer: up to a minute of one core, the first time only"
)
"""Logged once per process, level INFO, when a kernel is not found in the cache."""


def compiled(
    flags: frozenset[str], *, borrows: bool = False, inline: bool = False
) -> Callable[[F], F]:
    """Returns a decorator that compiles a function to machine code at its first call.

    Args:
        flags: Liberties with floating-point arithmetic, one of the sets above.
        borrows: The function makes no array of its own; references to those it is given are then
            not counted, which saves two locked instructions per array and call.
        inline: Its code is put into the functions that call it.

    The code is cached next to the source, or in the user's cache folder where the installation is
    read-only; where neither can be written it is compiled anew in each process. A cached kernel
    is renewed when its own file changes, but not when a file does that it takes kernels from:
    after editing ``core.sines``, ``arm_lanes``, ``branches``, ``krl_tokens`` or
    ``number_kernels`` clear ``__pycache__``.
    """

    def decorate(function: F) -> F:
        options: dict[str, Any] = {
            "fastmath": set(flags),
            "nogil": True,
            "error_model": "numpy",
            "inline": "always" if inline else "never",
            "_nrt": not borrows,
        }
        try:
            return cast(F, njit(cache=True, **options)(function))
        except RuntimeError:  # no place to cache to
            return cast(F, njit(**options)(function))

    return decorate


class _Told(event.Listener):
    """Says why the first call takes its time; kernels found in the cache raise no event."""

    def on_start(self, event: Any) -> None:
        if not _TOLD and event.data["dispatcher"].py_func.__module__.startswith("robotrue."):
            _TOLD.append(True)
            logging.getLogger("robotrue").info(COMPILING)

    def on_end(self, event: Any) -> None:
        pass


_TOLD: Final[list[bool]] = []
event.register("numba:compile", _Told())  # type: ignore[no-untyped-call]
