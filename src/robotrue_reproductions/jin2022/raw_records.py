"""The raw records of a simulated pass, as its user's instruments would write them. SIMULATED.

Two seconds of air, a tenth of a second of entry, the pass, and the same after it. The straight-edge
is not straight, the dry run is recorded on a separate clock, and the zero of the dynamometer drifts
along a line plus a bow, which no line through both ends removes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from scipy.io import savemat

from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG, UM
from robotrue.dynamics.formats.column_table import table_bytes
from robotrue.simulation.milling_arm import FEED, RATE, SPINDLE, MillingArm, pass_joints
from robotrue_reproductions.jin2022.milling_experiment import (
    JOINT_NOISE,
    LASER,
    REFRESHES,
    displace_tool,
    draw_repeatability,
    strike_hammer,
)
from robotrue_reproductions.jin2022.milling_pass import (
    DRIFT,
    NOISE,
    SHIFTS,
    Tooling,
    pass_force,
    window_edges,
)

AIR: Final = 2.0
ENTRY: Final = 0.1
"""s, before the pass and after it."""
BOW: Final = 0.05
"""N, standard deviation of what the zero is off its line in the middle of a pass."""
JOINT_RATE: Final = 250.0
CELL: Final = """schema = 1

[robot]
preset = "ABB IRB 6660-205/1.9"
stiffness_Nm_per_rad = [{}]

[tool]
xyz_mm = [320, 0, 160]
"""
ORIGIN: Final = Provenance(simulated=True, instrument="virtual milling experiment")


def write_cell(path: Path, arm: MillingArm) -> None:
    """Writes the cell of an arm, with the stiffnesses stated by its user."""
    stiffness = ", ".join(f"{k:.0f}" for k in arm.stiffness_belief)
    path.write_text(CELL.format(stiffness), encoding="utf-8")


def write_hammer(path: Path, arm: MillingArm, seed: int) -> None:
    """Writes the response of the hammer test, y over x, y, z, as constant below its first line."""
    frequency, response = strike_hammer(arm, seed)
    lines = np.concatenate([[0.0], frequency])
    curves = np.concatenate([response[:1].real, response])
    names, columns = ["f_Hz"], [lines]
    for pushed, curve in zip("xyz", curves.T, strict=True):
        names += [f"Gy{pushed}_re_m_per_N", f"Gy{pushed}_im_m_per_N"]
        columns += [curve.real, curve.imag]
    path.write_bytes(mark_line(ORIGIN).encode() + table_bytes(names, np.column_stack(columns)))


def write_raw_pass(
    folder: Path, arm: MillingArm, tools: Tooling, seed: int, which: int
) -> Sequence[str]:
    """Writes the records of a pass and returns the options of ``dynamics windows`` that name them.

    Args:
        folder: Where ``cell.toml`` and ``frf.csv`` are.
        arm: That mills.
        tools: Cutter and dynamometer.
        seed: Of everything drawn.
        which: Pass of :data:`robotrue.simulation.milling_arm.SHIFTS`.
    """
    rng = np.random.default_rng([seed, 210 + which])
    length = window_edges()[-1] / FEED
    force = _force_with_air(tools, round(length * RATE), rng)
    count, lead = len(force), AIR + ENTRY
    # renewed as often as in the windows of the paper
    cuts = np.rint(np.linspace(0, count, REFRESHES * round(count / RATE) + 1)).astype(np.int64)
    middle = np.asarray(0.5 * (cuts[1:] + cuts[:-1]) / RATE - lead, dtype=np.float64)
    truth, _ = displace_tool(arm, pass_joints(FEED * middle, SHIFTS[which]), force, cuts)
    time = np.arange(count) / RATE - lead
    part = (time / length)[:, None]
    drawn = DRIFT * rng.standard_normal(3), BOW * rng.standard_normal(3)
    read = force * tools.gain + NOISE * rng.standard_normal(force.shape)
    read += drawn[0] * part + drawn[1] * 4.0 * part * (1.0 - part)
    place = 0.5 * (window_edges()[1:] + window_edges()[:-1])
    repeated = np.interp(FEED * time, place, draw_repeatability(place, rng))
    seen = _straight_edge(FEED * time) - truth + LASER * rng.standard_normal(count) + repeated
    named = zip("xyz", read.T, strict=True)
    savemat(folder / "force.mat", {"rate_Hz": RATE, **{f"f{axis}_N": f for axis, f in named}})
    savemat(folder / "laser.mat", {"rate_Hz": RATE, "d_um": seen / UM})
    _write_joints(folder / "joints.mat", -lead, count / RATE, which, rng)
    dry = np.arange(-lead - 1.0, length + lead + 1.0, 1.0 / 1200.0)
    edge = _straight_edge(FEED * dry) + LASER * rng.standard_normal(len(dry))
    savemat(folder / "dry_laser.mat", {"rate_Hz": 1200.0, "d_um": edge / UM})
    _write_joints(folder / "dry_joints.mat", dry[0], dry[-1] - dry[0], which, rng)
    return [
        str(folder / "force.mat"), "--cell", str(folder / "cell.toml"),
        "--joints", str(folder / "joints.mat"), "--frf", str(folder / "frf.csv"),
        "--spindle-rpm", f"{60.0 * SPINDLE:g}", "--laser", str(folder / "laser.mat"),
        "--dry-laser", str(folder / "dry_laser.mat"),
        "--dry-joints", str(folder / "dry_joints.mat"), "--name", str(which + 1),
    ]  # fmt: skip


def _force_with_air(tools: Tooling, samples: int, rng: np.random.Generator) -> Array:
    """Force on the tool (n, 3) N, from the air into the cut and out again."""
    entry = round(ENTRY * RATE)
    share = np.minimum(np.arange(1, samples + 2 * entry + 1) / entry, 1.0)
    cut = pass_force(tools, samples + 2 * entry, rng) * np.minimum(share, share[::-1])[:, None]
    air = np.zeros((round(AIR * RATE), 3))
    return np.concatenate([air, cut, air])


def _straight_edge(place: Array) -> Array:
    """What the laser reads of the straight-edge (n,) m at places along the pass."""
    return np.asarray(40 * UM + 60e-6 * place + 3 * UM * np.sin(20.0 * place))


def _write_joints(
    path: Path, first: float, seconds: float, which: int, rng: np.random.Generator
) -> None:
    """Joints as the model counts, from a place (s of the feed) on; times count from zero."""
    time = np.arange(0.0, seconds, 1.0 / JOINT_RATE)
    joints = pass_joints(FEED * (first + time), SHIFTS[which])
    joints = joints + JOINT_NOISE * rng.standard_normal(joints.shape)
    named = {f"j{k + 1}_deg": q / DEG for k, q in enumerate(joints.T)}
    savemat(path, {"t_s": time, **named})
