"""The peers of the heavy arm: each installed into its own environment, run on one data file.

An environment is made with ``venv`` and ``pip install NAME==VERSION`` from the default index when
it is not there; delete ``benchmarks/envs`` to start from nothing. Whatever fails becomes a row that
says so.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
VERSIONS = {"pybotics": "3.1.2", "robotkinecal": "0.1.0", "figaroh": "1.0.2"}
ROUTES = (
    ("pybotics", "", "24 modified-DH + world + tool, 3-vector residual"),
    ("robotkinecal", "", "product of exponentials, points"),
    ("figaroh", "structural", "documented default"),
    ("figaroh", "non-geometric", "include_non_geometric: true, as documented"),
    ("figaroh", "by-hand", "the six k_ put back by hand"),
)
INSTALL_SECONDS, RUN_SECONDS = 900.0, 300.0
FACTS = """
import importlib.metadata as m, platform
v = {d.metadata["Name"].lower(): d.version for d in m.distributions()}
print("python " + platform.python_version() + ", " + ", ".join(
    k + " " + v[k] for k in (NAME, "numpy", "scipy", "pin", "roboticstoolbox-python") if k in v
) + ", " + str(len(v)) + " packages")
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerResult:
    """What one peer made of the case.

    Attributes:
        position: (n, 3) m, predicted points of the test poses.
        wall: Best wall time of the fit, s.
        cpu: Best processor time of the fit, s.
        note: What the peer says of its fit.
    """

    position: np.ndarray
    wall: float
    cpu: float
    note: str


def python_of(name: str) -> Path:
    """Returns the interpreter of a peer's environment."""
    return HERE / "envs" / name / "bin" / "python"


def install(name: str, *, allowed: bool = True) -> str | None:
    """Returns None when the peer's environment stands, else the reason why not."""
    folder = HERE / "envs" / name
    if (folder / "ready").exists():
        return None
    if not allowed:
        return "not installed yet, and --quick installs nothing"
    shutil.rmtree(folder, ignore_errors=True)  # what an interrupted installation left
    pip = [str(python_of(name)), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    for command in (
        [sys.executable, "-m", "venv", str(folder)],
        [*pip, f"{name}=={VERSIONS[name]}", "scipy"],
    ):
        reason = _failure(command, INSTALL_SECONDS)
        if reason is not None:
            return f"not installed: {reason}"
    (folder / "ready").touch()
    return None


def facts(name: str) -> str:
    """Returns versions inside a peer's environment in one line."""
    program = FACTS.replace("NAME", repr(name))
    done = subprocess.run(
        [str(python_of(name)), "-c", program], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "versions unknown"


def run(name: str, route: str, data: dict[str, object]) -> PeerResult | str:
    """Returns what the peer made of the data, or the reason why there is nothing."""
    script = HERE / f"heavy_arm_{name}.py"
    with tempfile.TemporaryDirectory() as folder:
        given, out = Path(folder) / "case.npz", Path(folder) / "out.npz"
        np.savez(given, **data)
        command = [str(python_of(name)), str(script), str(given), str(out)]
        reason = _failure([*command, route] if route else command, RUN_SECONDS)
        if reason is not None:
            return f"not run: {reason}"
        with np.load(out) as result:
            return PeerResult(
                position=result["position"],
                wall=float(result["wall"].min()),
                cpu=float(result["cpu"].min()),
                note=str(result["note"]) if "note" in result else "",
            )


def _failure(command: list[str], seconds: float) -> str | None:
    """Runs a command; returns the last line of its complaint, or None."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=seconds)
    except subprocess.TimeoutExpired:
        return f"no answer within {seconds:.0f} s"
    except OSError as cause:
        return str(cause)
    if done.returncode == 0:
        return None
    return (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
