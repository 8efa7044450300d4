"""Streaming filters and pose to modes, each beside a peer, in processor time of one thread.

    python benchmarks/dynamics.py [--quick]

Throughput: 13 modes, three axes in and out, blocks of 1 to 1,024 samples; peers: the same modes as
second-order sections in scipy (lfilter with its state) and the block convolution of SciPy with two
seconds of impulse response. Best of several runs. Accuracy: milling force of the virtual experiment
(simulated) through an amplifier of 5 kHz, exact response from its Fourier series at 64 times the
sampling rate; first-order hold (ours), zero-order hold, Tustin, and the FFT of the samples, which
errs by what sampling lost and nothing else. The note's 0.14 um of a first-order hold is of a force
whose FFT errs by 0.01 um: the case with the amplifier. Without it the edges of the chip alias, and
no filter can know. Modes: mass matrix, Jacobian and eigenvalues at a new pose.
Held-out errors of the learned deviation are in ``benchmarks/dynamic_deviation.py``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy import signal

from robotrue.core.arrays import Array
from robotrue.core.units import UM
from robotrue.dynamics.oscillators import Oscillators, join_oscillators
from robotrue.dynamics.pose_modes import pose_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.simulation.milling_arm import RATE, milling_arm, milling_table, pass_joints

BLOCKS: Final = (1, 20, 64, 256, 1024)
NOTE: Final = {1: 0.57, 20: 8.6, 64: 15.7, 256: 16.0}
"""M samples per CPU-second of the prototype, on this kind of machine."""
RUNS: Final = 5
FINER: Final = 64
TAPS: Final = 40_000
AMPLIFIER: Final = 5e3
"""Hz, fourth order."""


def cpu(work: Callable[[], object], count: int) -> float:
    """Returns the least processor time of one call, s."""
    work()
    best = np.inf
    for _ in range(RUNS):
        start = time.process_time()
        for _ in range(count):
            work()
        best = min(best, (time.process_time() - start) / count)
    return best


def modes() -> Oscillators:
    arm = milling_arm(1)
    return join_oscillators(
        [pose_modes(arm.arm, pass_joints(np.array([0.25]))[0]).oscillators(), arm.tool]
    )


def sections(own: Oscillators, method: str) -> list[tuple[Array, Array]]:
    """Each oscillator, force along its own shape to modal coordinate, as a discrete filter."""
    out = []
    for pole in own.poles:
        above, below = [1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2]
        b, a, _ = signal.cont2discrete((above, below), 1.0 / RATE, method=method)
        out.append((np.ravel(b), np.ravel(a)))
    return out


def shapes(own: Oscillators) -> tuple[Array, Array]:
    """Excitation (k, 3) and response (k, 3) of modal coordinates, real modes."""
    return own.excite.real, -2.0 * own.poles.imag[:, None] * own.respond.imag


def by_sections(own: Oscillators, method: str) -> Callable[[Array], Array]:
    filters, (excite, respond) = sections(own, method), shapes(own)
    states = [np.zeros(max(len(a), len(b)) - 1) for b, a in filters]

    def push(force: Array) -> Array:
        driven = force @ excite.T
        out = np.empty_like(driven)
        for k, (b, a) in enumerate(filters):
            out[:, k], states[k] = signal.lfilter(b, a, driven[:, k], zi=states[k])
        return out @ respond

    return push


def throughput(quick: bool) -> None:
    own, rng = modes(), np.random.default_rng(1)
    print(f"{len(own)} modes, 3 x 3 axes: M samples per CPU-second, microseconds per call")
    print(f"{'block':>6s} {'ours':>8s} {'us':>8s} {'sections':>9s} {'ratio':>7s} {'note':>7s}")
    for block in BLOCKS:
        stream, peer = ModalFilter(own, RATE), by_sections(own, "foh")
        force = rng.standard_normal((block, 3))
        out = np.empty_like(force)
        count = max(200, (20_000 if quick else 200_000) // block)
        ours = cpu(lambda s=stream, f=force, o=out: s.push(f, o), count)
        theirs = cpu(lambda p=peer, f=force: p(f), max(20, count // 50))
        note = f"{NOTE[block]:7.2f}" if block in NOTE else "      -"
        print(
            f"{block:6d} {block / ours / 1e6:8.2f} {ours * 1e6:8.2f} {block / theirs / 1e6:9.2f} "
            f"{theirs / ours:7.1f} {note}"
        )
    force, taps = rng.standard_normal((1 << 17, 3)), rng.standard_normal((TAPS, 3, 3))
    spent = cpu(
        lambda: [signal.oaconvolve(force[:, j], taps[:, i, j]) for i in range(3) for j in range(3)],
        1,
    )
    print(f"block convolution, {TAPS} taps: {len(force) / spent / 1e6:.2f}, a whole record at once")


def accuracy() -> None:
    own = modes()
    table = milling_table(1, FINER)
    lines = np.fft.rfftfreq(len(table), 1.0 / (RATE * FINER))
    soft = np.fft.rfft(table, axis=0) / np.sqrt(1.0 + (lines / AMPLIFIER) ** 8)[:, None]
    smooth = np.fft.irfft(soft, n=len(table), axis=0)
    errors(own, smooth, f"amplifier of {AMPLIFIER / 1e3:g} kHz")
    print("note: first-order hold 0.14, zero-order hold 1.9, Tustin 2.1, FFT 0.01 um (swing 24.6)")
    errors(own, table, "no amplifier, four slices: aliasing")
    long = np.tile(smooth[::FINER], (100, 1))
    whole = ModalFilter(own, RATE).push(long)
    packets = ModalFilter(own, RATE)
    parts = [packets.push(long[i : i + 77]) for i in range(0, len(long), 77)]
    apart = np.abs(np.concatenate(parts) - whole).max() / np.abs(whole).max()
    print(f"packets of 77 samples against one batch: {apart:.1e} of the largest displacement")


def errors(own: Oscillators, table: Array, what: str) -> None:
    n = len(table) // FINER
    spectrum = np.fft.rfft(table, axis=0) / len(table)
    lines = np.fft.rfftfreq(len(table), 1.0 / (RATE * FINER))
    response = own.response(lines)
    bent = np.einsum("fij,fj->fi", response, spectrum) * len(table)
    exact = np.fft.irfft(bent, n=len(table), axis=0)[::FINER]
    force = table[::FINER]
    long = np.tile(force, (400, 1))
    stream = ModalFilter(own, RATE)
    stream.settle(force.mean(axis=0))
    found = {"first-order hold (ours)": stream.push(long)}
    for name, method in (("zero-order hold", "zoh"), ("Tustin", "bilinear")):
        found[name] = by_sections(own, method)(long)
    bent = np.einsum(
        "fij,fj->fi", own.response(np.fft.rfftfreq(n, 1.0 / RATE)), np.fft.rfft(force, axis=0)
    )
    found["FFT of the samples, periodic"] = np.fft.irfft(bent, n=n, axis=0)
    swing = np.ptp(exact, axis=0).max() / UM
    print(f"\nmilling force at {RATE:g} samples/s, {what} (simulated), swing {swing:.1f} um")
    for name, values in found.items():
        miss = np.abs(values[-n:] - exact).max() / UM
        print(f"{name:28s} largest error {miss:7.3f} um")


def refresh() -> None:
    arm = milling_arm(1)
    joints = pass_joints(np.array([0.25, 0.2505]))
    before = pose_modes(arm.arm, joints[0])
    stream = ModalFilter(join_oscillators([before.oscillators(), arm.tool]), RATE)
    carry = np.eye(len(stream.oscillators))

    def change() -> None:
        after = pose_modes(arm.arm, joints[1])
        carry[:6, :6] = after.carry(before)
        stream.change(join_oscillators([after.oscillators(), arm.tool]), carry)

    alone = cpu(lambda: pose_modes(arm.arm, joints[1]), 500)
    whole = cpu(change, 300)
    print(f"\npose to modes {alone * 1e3:.3f} ms, into a running filter {whole * 1e3:.3f} ms")
    print("note: 1.06 ms; to reach 0.3 ms")


def main(arguments: list[str]) -> None:
    throughput("--quick" in arguments)
    accuracy()
    refresh()


if __name__ == "__main__":
    main(sys.argv[1:])
