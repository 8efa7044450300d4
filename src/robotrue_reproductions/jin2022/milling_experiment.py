"""The virtual milling experiment: what a user would measure of a pass, and what is true.

Passes of :mod:`robotrue.simulation.milling_arm` are cut with the force of
:mod:`~robotrue_reproductions.jin2022.milling_pass`. The truth is the displacement of the tool
across the feed with the modes of each pose and joints that soften under load. The user has what the
paper's user has: joints, a dynamometer, a laser against a straight-edge (cut less dry run), and a
frequency response hammered at one pose, from an accelerometer, so constant below 4 Hz. No
regeneration: with measured force, displacement follows from it whatever made it.

Everything here is SIMULATED. The size of the errors is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import scipy.fft

from robotrue.core.arrays import Array, IntArray
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, UM
from robotrue.dynamics.frf import ComplexArray
from robotrue.dynamics.oscillators import join_oscillators
from robotrue.dynamics.pose_modes import PoseModes, pose_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.dynamics.windows import WindowSet, concatenate_windows, peaks_per_turn
from robotrue.simulation.milling_arm import FEED, RATE, TURN, MillingArm, milling_arm, pass_joints
from robotrue_reproductions.jin2022.milling_pass import (
    SHIFTS,
    WINDOWS,
    Tooling,
    pass_force,
    read_force,
    tooling,
    window_edges,
)

LASER: Final = 0.3 * UM
"""Of each sample."""
REPEATABILITY: Final = 1.2 * UM
"""Of the difference between cut and dry run, slow and fast part together."""
REPEATABILITY_FAST: Final = 0.4 * UM
"""The part that changes from window to window. Assumed."""
REPEATABILITY_LENGTH: Final = 0.025
"""m of path, correlation length of the slow part, five windows. Assumed."""
JOINT_NOISE: Final = 3e-4 * DEG
BLIND: Final = 4.0
"""Hz; below, the accelerometer's response is taken as constant."""
HAMMER_NOISE: Final = 0.02
"""Part of the response, of each line and part."""
HAMMER_STEP: Final = 0.5
HAMMER_TOP: Final = 4000.0
REFRESHES: Final = 4
"""Times that the true modes are renewed in a window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MillingExperiment:
    """Passes of one seed.

    Attributes:
        seed: Of everything drawn.
        arm: Truth and belief.
        tools: Cutter and dynamometer.
        windows: What the user has of all passes; pass 1 is the printed one.
        static: (n,) m, true static part of the error, mean force times compliance.
        zero: (n, 3) N, what the dynamometer reads in each window beyond the force times its gain.
        along: (n,) m, middle of each window along its pass.
        hammer_frequency: (m,) Hz.
        hammer: (m, 3) m/N, y over x, y, z as hammered at the middle of pass 1.
    """

    seed: int
    arm: MillingArm
    tools: Tooling
    windows: WindowSet
    static: Array
    zero: Array
    along: Array
    hammer_frequency: Array
    hammer: ComplexArray


class _Pass(NamedTuple):
    """Windows of a pass and what is true of them."""

    windows: WindowSet
    static: Array
    zero: Array
    along: Array


def milling_experiment(seed: int, passes: Sequence[int] = range(len(SHIFTS))) -> MillingExperiment:
    """Returns a virtual experiment, the same for a seed on every machine.

    Args:
        seed: Draws arm, tools, and every pass.
        passes: Which of the six passes are cut; 0 is the printed one.
    """
    arm, tools = milling_arm(seed), tooling(seed)
    frequency, hammer = strike_hammer(arm, seed)
    parts = [_pass(arm, tools, frequency, hammer, seed, k) for k in passes]
    return MillingExperiment(
        seed=seed,
        arm=arm,
        tools=tools,
        windows=concatenate_windows([part.windows for part in parts]),
        static=np.concatenate([part.static for part in parts]),
        zero=np.concatenate([part.zero for part in parts]),
        along=np.concatenate([part.along for part in parts]),
        hammer_frequency=frequency,
        hammer=hammer,
    )


def with_noise(windows: WindowSet, size: float, seed: int) -> WindowSet:
    """Returns windows with white noise (m) on the measured error; the paper's need 2.5 um."""
    noise = size * np.random.default_rng([seed, 104]).standard_normal(len(windows))
    return replace(windows, measured=windows.measured + noise)


def _pass(
    arm: MillingArm,
    tools: Tooling,
    frequency: Array,
    hammer: ComplexArray,
    seed: int,
    which: int,
) -> _Pass:
    rng = np.random.default_rng([seed, 110 + which])
    edges = window_edges()
    marks = np.rint(edges / FEED * RATE).astype(np.int64)
    joints = pass_joints(_place_refreshes(edges), SHIFTS[which])
    force = pass_force(tools, int(marks[-1]), rng)
    truth, static = displace_tool(arm, joints, force, _part_windows(marks))
    read = read_force(tools, force, rng)
    seen = -truth + LASER * rng.standard_normal(len(truth))
    middle = 0.5 * (edges[1:] + edges[:-1])
    repeated = draw_repeatability(middle, rng)
    mean = pass_joints(middle, SHIFTS[which]) + JOINT_NOISE * rng.standard_normal((WINDOWS, 6))
    rows = []
    for k, (a, b) in enumerate(pairwise(marks.tolist())):
        measured = peaks_per_turn(seen[a:b], TURN).mean() + repeated[k]
        bent = _predict_displacement(frequency, hammer, read[a:b])
        predicted = peaks_per_turn(-bent, TURN).mean()
        peak = peaks_per_turn(np.abs(read[a:b, 1]), TURN).mean()
        zero = read[a:b].mean(axis=0) - tools.gain * force[a:b].mean(axis=0)
        rows.append([*read[a:b].mean(axis=0), peak, predicted, measured, *zero])
    table = np.array(rows)
    windows = WindowSet(
        passes=(f"{which + 1}",) * WINDOWS,
        joints=mean,
        force=table[:, :3],
        force_peak=table[:, 3],
        force_mean=table[:, 1],
        predicted=table[:, 4],
        measured=table[:, 5],
        source=f"virtual milling experiment, seed {seed} (simulated)",
        provenance=Provenance(simulated=True, instrument="virtual milling experiment"),
    )
    return _Pass(windows, static.reshape(-1, REFRESHES).mean(axis=1), table[:, 6:], middle)


def _place_refreshes(edges: Array) -> Array:
    """Places (n,) m at which the true modes are renewed: the middle of each part of a window."""
    part = (np.arange(REFRESHES) + 0.5) / REFRESHES
    return np.asarray((edges[:-1, None] + part * np.diff(edges)[:, None]).ravel())


def displace_tool(
    arm: MillingArm, joints: Array, force: Array, cuts: IntArray
) -> tuple[Array, Array]:
    """Returns the true displacement y (n,) m, and the static part of the error (k,) m.

    Args:
        arm: That mills.
        joints: (k, 6) rad, of each stretch of the force.
        force: (n, 3) N on the tool, base axes; settled in its first stretch.
        cuts: (k + 1,) samples where the stretches begin and end.
    """
    out = np.empty(len(force))
    static = np.zeros(len(joints))
    stream, before = None, None
    for k, (a, b) in enumerate(pairwise(cuts.tolist())):
        mean = force[a:b].mean(axis=0)
        modes = _modes(arm, joints[k], mean)
        both = join_oscillators([modes.oscillators(), arm.tool])
        if stream is None or before is None:
            stream = ModalFilter(both, RATE)
            stream.settle(mean)
        else:
            stream.change(both, _carry(modes, before, len(arm.tool)))
        out[a:b] = stream.push(force[a:b])[:, 1]
        static[k] = -(both.static[1] @ mean)
        before = modes
    return out, static


def _part_windows(marks: IntArray) -> IntArray:
    """Samples at which the true modes are renewed, ``REFRESHES`` times in each window."""
    parts = [
        np.rint(np.linspace(a, b, REFRESHES + 1)).astype(np.int64)[:-1]
        for a, b in pairwise(marks.tolist())
    ]
    return np.concatenate([*parts, marks[-1:]])


def _modes(arm: MillingArm, joints: Array, force: Array) -> PoseModes:
    _, jacobian = arm.arm.mass_and_jacobian(joints)
    return pose_modes(arm.soften(jacobian[:3].T @ force), joints)


def _carry(after: PoseModes, before: PoseModes, tool: int) -> Array:
    out = np.eye(len(after.joints) + tool)
    n = len(after.joints)
    out[:n, :n] = after.carry(before)
    return out


def strike_hammer(arm: MillingArm, seed: int) -> tuple[Array, ComplexArray]:
    """Returns lines (m,) Hz and response (m, 3) m/N of y to x, y, z at mid-path.

    No load, noise on every line.
    """
    rng = np.random.default_rng([seed, 103])
    edges = window_edges()
    modes = pose_modes(arm.arm, pass_joints(np.array([0.5 * edges[-1]]))[0])
    frequency = np.arange(BLIND, HAMMER_TOP + HAMMER_STEP, HAMMER_STEP)
    true = join_oscillators([modes.oscillators(), arm.tool]).response(frequency)[:, 1]
    noise = rng.standard_normal((2, *true.shape))
    return frequency, np.asarray(true * (1.0 + HAMMER_NOISE * (noise[0] + 1j * noise[1])))


def _predict_displacement(frequency: Array, hammer: ComplexArray, force: Array) -> Array:
    """Displacement y (n,) m of a window by eq. 1 as printed: F^-1[G F], circular."""
    spectrum = scipy.fft.rfft(force, axis=0)
    lines = scipy.fft.rfftfreq(len(force), 1.0 / RATE)
    lowest = hammer[0].real
    bent = np.zeros(len(lines), dtype=np.complex128)
    for j in range(3):
        response = np.interp(lines, frequency, hammer[:, j], right=0.0)
        response[lines < BLIND] = lowest[j]
        bent += response * spectrum[:, j]
    return np.asarray(scipy.fft.irfft(bent, n=len(force)))


def draw_repeatability(along: Array, rng: np.random.Generator) -> Array:
    """Returns a random curve (n,) m over a pass: squared exponentials and white noise."""
    distance = (along[:, None] - along[None, :]) / REPEATABILITY_LENGTH
    value, vector = np.linalg.eigh(np.exp(-0.5 * distance**2))
    root = (vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T  # the same on every machine
    slow = np.sqrt(REPEATABILITY**2 - REPEATABILITY_FAST**2)
    drawn = rng.standard_normal((2, len(along)))
    return np.asarray(slow * (root @ drawn[0]) + REPEATABILITY_FAST * drawn[1])
