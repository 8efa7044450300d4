"""Displacement of the tool from its force, sample by sample, exact for a force that is a ramp.

Between samples the force is taken as a straight line (first-order hold, ramp invariant): at 20 kHz
that is 14 times closer to the linear response than holding each sample. One sample in gives one
sample out, without delay; blocks of any length give the same numbers.

With p the pole, T the time between samples and phi_1(x) = (e^x - 1) / x,
phi_2(x) = (phi_1(x) - 1) / x, one oscillator moves by::

    z(n+1) = e^(pT) z(n) + T (phi_1 - phi_2) v.f(n) + T phi_2 v.f(n+1)

The state is w = z - T phi_2 v.f, which needs the last force only::

    w(n+1) = e^(pT) w(n) + T [phi_1 - phi_2 + e^(pT) phi_2] v.f(n)

The recursion is machine code, oscillators side by side in vector registers. All a filter knows is
one array, so that a call with one sample costs little more than the sample: ``ROWS`` rows of K
numbers, K a multiple of ``LANES`` and padded with zeros, then twelve numbers::

    0, 1         e^(pT), real and imaginary part
    2 .. 4       what the force x, y, z of the last sample adds to the real part
    5 .. 7       the same to the imaginary part
    8 .. 10      2 Re(u): real part of the state to x, y, z
    11 .. 13     -2 Im(u): imaginary part of the state to x, y, z
    14, 15       the state, real and imaginary part
    then         displacement over force at once (3, 3) m/N by rows; last force (3,) N
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.compiled import SUMS, compile_kernel
from robotrue.dynamics.frf import ComplexArray
from robotrue.dynamics.oscillators import Oscillators
from robotrue.errors import ModelMismatchError, ShapeError

LANES: Final = 4
ROWS: Final = 16
TAIL: Final = 12
DONE, NOT_FINITE, SHAPE = 0, 1, 2
_SERIES: Final = 0.01  # below this |pT| a series is used: the quotient would lose digits
_TERMS: Final = 5
_FLOAT: Final = np.dtype(np.float64)
STATE: Final = 14
"""First of the two rows of the kernel's memory that are the state."""
FASTEST: Final = 0.5
"""Part of the sampling rate that a mode may reach: above, the samples do not show it."""


class ModalFilter:
    """Oscillators in time: force in, displacement out, the state carried from call to call.

    The force before the first sample is zero and rises to it within one sample; :meth:`settle`
    starts from a standing force instead.

    Attributes:
        rate: Samples per second.
    """

    __slots__ = ("_add", "_lanes", "_memory", "_oscillators", "rate")

    def __init__(self, oscillators: Oscillators, rate: float) -> None:
        """Starts at rest.

        Raises:
            ShapeError: A rate that is not positive, or a mode at or above half of it.
        """
        if not (np.isfinite(rate) and rate > 0.0):
            raise ShapeError(f"rate {rate:g} 1/s, expected more than zero.")
        self.rate = float(rate)
        self._take(oscillators)

    @property
    def oscillators(self) -> Oscillators:
        """Oscillators that filter at present."""
        return self._oscillators

    def push(self, force: Array, out: Array | None = None) -> Array:
        """Returns the displacement (n, 3) m of the tool at each sample of its force (n, 3) N.

        Args:
            force: (n, 3) N.
            out: (n, 3) to write to and return, for pushing sample by sample.

        Raises:
            ShapeError: Another shape, or a force that is not finite; the state is then as before.
        """
        if (
            type(force) is not np.ndarray
            or force.dtype is not _FLOAT
            or not force.flags.c_contiguous
        ):
            force = np.ascontiguousarray(force, dtype=np.float64)
        if force.ndim != 2:
            raise ShapeError(f"force has shape {force.shape}, expected (any, 3).")
        if out is None:
            out = np.empty((len(force), 3))
        done = run(self._memory, force, out)
        if done == NOT_FINITE:
            row = int(np.flatnonzero(~np.isfinite(force).all(axis=1))[0])
            raise ShapeError(
                f"force sample {row} is {force[row].tolist()} N, expected finite numbers; this "
                "block was not filtered.",
                hint="drop the packet, mark the estimate invalid and go on with the next.",
            )
        if done != DONE:
            raise ShapeError(
                f"force has shape {force.shape} and out {out.shape}, expected (any, 3) of both."
            )
        return out

    def settle(self, force: Array) -> None:
        """Sets every oscillator to its steady state under a constant force (3,) N."""
        force = np.asarray(force, dtype=np.float64)
        if force.shape != (3,) or not np.isfinite(force).all():
            raise ShapeError(f"force {force}, expected 3 finite numbers.")
        own = self._oscillators
        self._keep(-(own.excite @ force) / own.poles, force)

    def change(self, oscillators: Oscillators, carry: Array | None = None) -> None:
        """Switches to other modes from the next sample on; position and speed do not jump.

        Args:
            oscillators: The modes from here on.
            carry: (k, k_before) real, normal coordinates after from normal coordinates before
                (:meth:`robotrue.dynamics.pose_modes.PoseModes.carry`). None for the same modes
                slightly moved: each keeps its displacement of the tool as closely as its shape
                allows.

        Raises:
            ModelMismatchError: Without ``carry``, another number of modes.
            ShapeError: A ``carry`` of another shape, or a mode at or above half the rate.
        """
        before = self._oscillators
        state, force = self.state()
        if carry is None:
            if len(before) != len(oscillators):
                raise ModelMismatchError(
                    f"{len(oscillators)} modes after {len(before)}: their correspondence is not "
                    "stated.",
                    hint="give carry, or filter with as many modes as before.",
                )
            carry = np.diag(_shape_ratio(before, oscillators))
        elif np.shape(carry) != (len(oscillators), len(before)):
            raise ShapeError(
                f"carry has shape {np.shape(carry)}, expected {(len(oscillators), len(before))}."
            )
        position = state.imag / before.poles.imag
        speed = (before.poles * state).imag / before.poles.imag
        position, speed = carry @ position, carry @ speed
        self._take(oscillators)
        poles = oscillators.poles
        # eta = Im z / omega_d and eta' = Im(p z) / omega_d, solved for z
        self._keep(speed - poles.real * position + 1j * poles.imag * position, force)

    def state(self) -> tuple[ComplexArray, Array]:
        """Returns the oscillators (k,) and the force (3,) N at the last sample."""
        k, force = len(self._oscillators), self._memory[-3:].copy()
        real, imaginary = self._memory[STATE * self._lanes : -TAIL].reshape(2, self._lanes)[:, :k]
        shifted = real + 1j * imaginary
        return shifted + self._add @ force, force

    def snapshot(self) -> Array:
        """Returns the state bit for bit, for a checkpoint: the kernel's own, (2 lanes + 3,)."""
        return self._memory[self._kept].copy()

    def resume(self, snapshot: Array) -> None:
        """Continues from :meth:`snapshot` of a filter with the same oscillators, bit for bit.

        Raises:
            ShapeError: The snapshot of another number of oscillators.
        """
        if np.shape(snapshot) != (len(self._kept),):
            raise ShapeError(
                f"snapshot has shape {np.shape(snapshot)}, expected ({len(self._kept)},)."
            )
        self._memory[self._kept] = snapshot

    @property
    def _kept(self) -> IntArray:
        """Indices of the state in the kernel's memory: two rows, and the last force."""
        size = len(self._memory)
        first = np.arange(STATE * self._lanes, size - TAIL)
        return np.concatenate([first, np.arange(size - 3, size)])

    def _take(self, oscillators: Oscillators) -> None:
        fastest = np.abs(oscillators.poles).max(initial=0.0) / (2.0 * np.pi)
        if fastest >= FASTEST * self.rate:
            raise ShapeError(
                f"a mode at {fastest:.0f} Hz, sampled {self.rate:g} times a second; the highest "
                f"mode has to stay below {FASTEST * self.rate:g} Hz.",
                hint="sample faster, or leave the mode to the residual.",
            )
        self._oscillators = oscillators
        self._memory, self._add = _memory(oscillators, self.rate)
        self._lanes = (len(self._memory) - TAIL) // ROWS

    def _keep(self, state: ComplexArray, force: Array) -> None:
        shifted = state - self._add @ force
        rows = self._memory[:-TAIL].reshape(ROWS, self._lanes)
        rows[STATE, : len(state)], rows[STATE + 1, : len(state)] = shifted.real, shifted.imag
        self._memory[-3:] = force


def _memory(own: Oscillators, rate: float) -> tuple[Array, ComplexArray]:
    """The kernel's memory at rest, and T phi_2 v (k, 3)."""
    x = own.poles / rate
    less = np.expm1(x)
    turn, one = less + 1.0, less / x
    two = _second(x, one)
    add = (two / rate)[:, None] * own.excite
    drive = ((one - two + turn * two) / rate)[:, None] * own.excite
    k = len(own)
    rows = np.zeros((ROWS, max(LANES, -(-k // LANES) * LANES)))
    rows[0, :k], rows[1, :k] = turn.real, turn.imag
    rows[2:5, :k], rows[5:8, :k] = drive.real.T, drive.imag.T
    rows[8:11, :k], rows[11:14, :k] = 2.0 * own.respond.real.T, -2.0 * own.respond.imag.T
    through = own.residual + 2.0 * (own.respond.T @ add).real
    return np.concatenate([rows.ravel(), through.ravel(), np.zeros(3)]), add


def _second(x: ComplexArray, first: ComplexArray) -> ComplexArray:
    """phi_2(x) = (phi_1 - 1) / x = sum_j x^j / (j + 2)!, to rounding for every |x|."""
    series = np.ones_like(x)
    for j in range(_TERMS, 0, -1):
        series = 1.0 + series * x / (j + 2.0)
    return np.asarray(np.where(np.abs(x) < _SERIES, 0.5 * series, (first - 1.0) / x))


def _shape_ratio(before: Oscillators, after: Oscillators) -> Array:
    """(k,) by which normal coordinates change so that the tool stays, in least squares.

    A normal coordinate moves the tool by -2 omega_d Im u, for real modes exactly.
    """
    old = -2.0 * before.poles.imag[:, None] * before.respond.imag
    new = -2.0 * after.poles.imag[:, None] * after.respond.imag
    size = np.einsum("ki,ki->k", new, new)
    return np.where(size > 0.0, np.einsum("ki,ki->k", new, old) / np.maximum(size, 1e-300), 0.0)


@compile_kernel(SUMS)
def run(memory: Array, force: Array, out: Array) -> int:
    """Writes the displacement of each sample to ``out`` and moves the state on.

    Returns ``DONE``; or, with nothing done, ``NOT_FINITE`` if a force is not and ``SHAPE`` if
    force and out are not (n, 3) both.

    Args:
        memory: (16 K + 12,).
        force: (n, 3) N, contiguous.
        out: (n, 3) m, contiguous.
    """
    if force.shape[1] != 3 or out.shape[1] != 3 or len(out) != len(force):
        return SHAPE
    sound = 0.0
    for n in range(len(force)):  # NaN and infinity stay, anything else becomes zero
        sound += (force[n, 0] + force[n, 1] + force[n, 2]) * 0.0
    if not np.isfinite(sound):
        return NOT_FINITE
    m = (len(memory) - 12) // 16
    r, s, tail = 14 * m, 15 * m, 16 * m
    fx, fy, fz = memory[tail + 9], memory[tail + 10], memory[tail + 11]
    for n in range(len(force)):
        x = 0.0
        y = 0.0
        z = 0.0
        for k in range(m):
            er, ei, re, im = memory[k], memory[k + m], memory[k + r], memory[k + s]
            a = memory[k + 2 * m] * fx + memory[k + 3 * m] * fy + memory[k + 4 * m] * fz
            b = memory[k + 5 * m] * fx + memory[k + 6 * m] * fy + memory[k + 7 * m] * fz
            a += er * re - ei * im
            b += er * im + ei * re
            memory[k + r] = a
            memory[k + s] = b
            x += memory[k + 8 * m] * a + memory[k + 11 * m] * b
            y += memory[k + 9 * m] * a + memory[k + 12 * m] * b
            z += memory[k + 10 * m] * a + memory[k + 13 * m] * b
        fx, fy, fz = force[n, 0], force[n, 1], force[n, 2]
        x += memory[tail] * fx + memory[tail + 1] * fy + memory[tail + 2] * fz
        y += memory[tail + 3] * fx + memory[tail + 4] * fy + memory[tail + 5] * fz
        z += memory[tail + 6] * fx + memory[tail + 7] * fy + memory[tail + 8] * fz
        out[n, 0], out[n, 1], out[n, 2] = x, y, z
    memory[tail + 9], memory[tail + 10], memory[tail + 11] = fx, fy, fz
    return DONE
