"""Whoever waits for the compiler is told so: once, and only while there is something to compile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robotrue.core.compiled import COMPILING

TWO_KERNELS = """
import logging
import numpy as np
from robotrue.core.sines import arc_tangents, sines
logging.basicConfig(format="%(message)s", level=logging.INFO)
rows = np.zeros(12)
sines(rows[:2], 2, rows[2:])
arc_tangents(rows, 0, 2, 2, 8)
"""


def said(cache: Path) -> str:
    """What a process that calls two kernels logs."""
    around = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", TWO_KERNELS]
    done = subprocess.run(command, env=around, capture_output=True, text=True, check=True)  # noqa: S603
    return done.stderr


def test_compiling_is_said_once_and_not_of_what_is_kept(tmp_path: Path) -> None:
    assert said(tmp_path).splitlines() == [COMPILING]
    assert said(tmp_path) == ""


INNER = """
from robotrue.core.compiled import PLAIN, compile_kernel

SCALE = 2.0

@compile_kernel(PLAIN)
def inner(x):
    return x + 1.0
"""
OUTER = """
from inner import SCALE, inner
from robotrue.core.compiled import PLAIN, compile_kernel

@compile_kernel(PLAIN)
def outer(x):
    return between(x) * SCALE

@compile_kernel(PLAIN)
def between(x):
    return inner(x)
"""


def ran(folder: Path, code: str = "from outer import outer; print(outer(3.0))") -> tuple[str, str]:
    """What a new process prints and logs that calls the outer of two kernels."""
    log = "import logging; logging.basicConfig(format='%(message)s', level=logging.INFO)\n"
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    around = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "kept"), "PYTHONPATH": path,
              "PYTHONDONTWRITEBYTECODE": "1"}  # fmt: skip
    command = [sys.executable, "-c", log + code]
    done = subprocess.run(command, env=around, capture_output=True, text=True, check=True)  # noqa: S603
    return done.stdout.strip(), done.stderr


def kept_files(folder: Path) -> list[str]:
    """Names of all files of machine code."""
    return sorted(path.name for path in (folder / "kept").rglob("*.nb?"))


def test_an_edited_kernel_is_the_one_that_runs(tmp_path: Path) -> None:
    inner, outer = tmp_path / "inner.py", tmp_path / "outer.py"
    inner.write_text(INNER)
    outer.write_text(OUTER)
    assert ran(tmp_path)[0] == "8.0"
    files = kept_files(tmp_path)
    inner.write_text("\n" + INNER.replace("x + 1.0", "x + 2.0"))
    assert ran(tmp_path)[0] == "10.0"
    inner.write_text(INNER.replace("SCALE = 2.0", "SCALE = 3.0"))
    outer.write_text("\n\n" + OUTER)
    assert ran(tmp_path)[0] == "12.0"
    assert kept_files(tmp_path) == files


STAMPS = """
import importlib, pathlib
import robotrue
from numba.core.dispatcher import Dispatcher
from robotrue.core.compiled import _stamp
src = pathlib.Path(robotrue.__file__).parents[1]
for path in sorted(src.glob("robotrue/**/*.py")):
    if "@compile_kernel(" in (text := path.read_text()) or "@cache_kernel" in text:
        name = ".".join(path.relative_to(src).with_suffix("").parts)
        for key, value in sorted(vars(importlib.import_module(name)).items()):
            if isinstance(value, Dispatcher) and value.py_func.__module__ == name:
                print(name, key, type(value._cache).__name__, _stamp(value))
"""


def test_every_kernel_is_kept_by_what_it_is_made_of(monkeypatch: pytest.MonkeyPatch) -> None:
    def stamps(seed: str) -> list[str]:
        monkeypatch.setenv("PYTHONHASHSEED", seed)
        command = [sys.executable, "-c", STAMPS]
        done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
        return done.stdout.splitlines()

    first = stamps("1")
    assert len(first) > 90  # all of them, in every room
    assert all(line.split()[2] == "_KernelCache" for line in first)
    assert stamps("2") == first
