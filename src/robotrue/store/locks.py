"""Locks on files that a killed process lets go by itself."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Final

POSIX: Final = find_spec("fcntl") is not None
"""Elsewhere nothing is locked, and nothing that depends on a lock is cleaned up."""


@contextlib.contextmanager
def hold_shared(path: Path) -> Iterator[None]:
    """Holds a shared lock; waits while another process holds it exclusively."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        _lock(handle, alone=False, wait=True)
        yield
    finally:
        os.close(handle)


@contextlib.contextmanager
def hold_alone(path: Path, *, wait: bool) -> Iterator[bool]:
    """Holds a lock alone; gives False, and holds nothing, where others do and it does not wait."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        yield _lock(handle, alone=True, wait=wait)
    finally:
        os.close(handle)


def is_abandoned(path: Path) -> bool:
    """Returns true if a lock file exists and its process has died."""
    if not POSIX or not path.is_file():
        return False
    with hold_alone(path, wait=False) as mine:
        return mine


def _lock(handle: int, *, alone: bool, wait: bool) -> bool:
    if not POSIX:
        return not alone or wait
    fcntl = import_module("fcntl")
    try:
        kind = fcntl.LOCK_EX if alone else fcntl.LOCK_SH
        fcntl.flock(handle, kind if wait else kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
