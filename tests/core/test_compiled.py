"""Whoever waits for the compiler is told so: once, and only while there is something to compile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

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
