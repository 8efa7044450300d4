"""Compiles kernels and keeps the machine code where the installation allows it."""

from __future__ import annotations

import contextlib
import dis
import logging
import sys
from collections.abc import Callable
from types import CodeType, ModuleType
from typing import Final, TypeVar, cast

import numpy as np
from numba import njit
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.dispatcher import Dispatcher

from robotrue.core.files import sha256

F = TypeVar("F", bound=Callable[..., object])

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


def compile_kernel(flags: frozenset[str], *, inline: bool = False) -> Callable[[F], F]:
    """Returns a decorator that compiles a function to machine code at its first call.

    Args:
        flags: Liberties with floating-point arithmetic, one of the sets above.
        inline: Its code is inlined into the functions that call it.

    The code is cached, see :func:`cache_kernel`.
    """

    def decorate(function: F) -> F:
        compiler = njit(
            fastmath=set(flags),
            nogil=True,
            error_model="numpy",
            inline="always" if inline else "never",
        )
        return cache_kernel(cast(F, compiler(function)))

    return decorate


def cache_kernel(kernel: F) -> F:
    """Returns a function of ``numba.njit`` that caches its machine code on the disk.

    The code lies next to the source, or in the user's cache folder where the installation is
    read-only, or in ``NUMBA_CACHE_DIR``; where none can be written it is compiled again in each
    process. It is used as long as everything it was made from is the same: its own instructions,
    those of all kernels it calls, in any file, their options, and the values of the constants they
    use. A changed kernel replaces the stored one.
    """
    with contextlib.suppress(RuntimeError):  # no place to keep it
        kernel._cache = _KernelCache(cast(Dispatcher, kernel))  # type: ignore[attr-defined]
    return kernel


class _KernelFiles(CompileResultCacheImpl):
    """Files named without the line, so that a kernel that moves in its file leaves no stale one."""

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        name = fullname.replace("<", "").replace(">", "")
        return f"{name}.py{sys.version_info[0]}{sys.version_info[1]}{abiflags}"


class _KernelCache(FunctionCache):
    """A cache stamped with a hash of the kernel's sources.

    Numba's own stamp is the kernel's file, which does not cover its parts from other files. The
    stamp is taken from what is loaded, not from the files, for these may be newer; and when the
    kernel is first called, for only then is every module complete.
    """

    _impl_class = _KernelFiles

    def __init__(self, kernel: Dispatcher) -> None:
        super().__init__(kernel.py_func)  # type: ignore[no-untyped-call]
        self._kernel = kernel

    def load_overload(self, sig: object, target_context: object) -> object:
        self._cache_file._source_stamp = _stamp(self._kernel)
        return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]

    def save_overload(self, sig: object, data: object) -> None:
        self._cache_file._source_stamp = _stamp(self._kernel)
        super().save_overload(sig, data)  # type: ignore[no-untyped-call]


def _stamp(kernel: Dispatcher) -> str:
    """SHA-256 of all that goes into the machine code of a kernel."""
    parts: list[str] = []
    seen: set[Dispatcher] = {kernel}
    waiting = [kernel]
    while waiting:
        one = waiting.pop()
        function = one.py_func
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        names = _names(function.__code__)
        used = {n: v for n, v in function.__globals__.items() if n in names}
        parts += [function.__module__, function.__qualname__, _describe_value(function.__code__)]
        parts.append(repr(sorted((k, _describe_value(v)) for k, v in one.targetoptions.items())))
        for name, value in [*sorted(used.items()), *(("", v) for v in cells)]:
            if isinstance(value, Dispatcher):
                parts.append(f"{name} = {value.py_func.__module__}.{value.py_func.__qualname__}")
                waiting += [] if value in seen else [value]
                seen.add(value)
            else:
                parts.append(f"{name} = {_describe_value(value)}")
        parts.append(_describe_value(function.__defaults__))
    return sha256("\0".join(parts).encode("utf-8", "backslashreplace"))


def _names(code: CodeType) -> set[str]:
    """Global names that a function, or one inside it, uses; not the names of attributes."""
    inside = [_names(const) for const in code.co_consts if isinstance(const, CodeType)]
    own = {each.argval for each in dis.get_instructions(code) if each.opname == "LOAD_GLOBAL"}
    return own.union(*inside)


def _describe_value(value: object) -> str:
    """Everything of a value that machine code may hold. What has no stable text never fits."""
    if isinstance(value, CodeType):
        return repr(
            [value.co_code, value.co_names, value.co_varnames, value.co_freevars, value.co_cellvars]
        ) + _describe_value(value.co_consts)
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, np.ndarray):
        return f"{value.dtype.descr} {value.strides} {value.shape} {value.tobytes()!r}"
    if isinstance(value, set | frozenset):
        return repr(sorted(_describe_value(each) for each in value))
    if isinstance(value, tuple):
        return f"({', '.join(_describe_value(each) for each in value)})"
    return f"{type(value)} {value!r}"


class _Told(event.Listener):
    """Says why the first call takes its time; kernels found in the cache raise no event."""

    def on_start(self, event: event.Event) -> None:
        if not _TOLD and event.data["dispatcher"].py_func.__module__.startswith("robotrue."):
            _TOLD.append(True)
            logging.getLogger("robotrue").info(COMPILING)

    def on_end(self, event: event.Event) -> None:
        pass


_TOLD: Final[list[bool]] = []
event.register("numba:compile", _Told())  # type: ignore[no-untyped-call]
