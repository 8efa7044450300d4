"""The count of packets watched many at once: the same flags as packet by packet, only sooner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import ShapeError
from robotrue.online.samples import Flag
from robotrue.online.sequence import SequenceState, advance


def advance_block(
    state: SequenceState, counts: IntArray, host_times: Array
) -> tuple[SequenceState, IntArray]:
    """Returns the state after packets in the order they came, and the flags (n,) of each.

    Equal to :func:`robotrue.online.sequence.advance` packet by packet, which is asked about every
    packet that does not follow the one before.

    Args:
        state: Before the first packet.
        counts: (n,), the packets' own.
        host_times: (n,) s, when they came.

    Raises:
        ShapeError: Arrays of different lengths.
    """
    n = len(counts)
    if host_times.shape != counts.shape:
        raise ShapeError(f"{n} counts and host times of shape {host_times.shape}.")
    flags = np.zeros(n, dtype=np.int64)
    gone = np.diff(host_times, prepend=np.nan)
    follows = (_moved(state, counts[1:], counts[:-1]) == state.step) & ~(gone[1:] < 0.0)
    breaks = np.append(np.flatnonzero(~follows) + 1, n)
    at = 0
    while at < n:
        state, wrong = advance(state, int(counts[at]), float(host_times[at]))
        flags[at] = int(wrong)
        at += 1
        if at == n or (state.last, state.host_time) != (counts[at - 1], host_times[at - 1]):
            continue  # after a repeated or old packet the one before is not the latest
        end = int(breaks[np.searchsorted(breaks, at)])
        if end > at:
            late = gone[at:end] > state.late_after
            flags[at:end] = np.where(late, int(Flag.LATE), 0)
            state = replace(
                state,
                last=int(counts[end - 1]),
                host_time=float(host_times[end - 1]),
                total=state.total + end - at,
                received=state.received + end - at,
                late=state.late + int(late.sum()),
            )
            at = end
    return state, flags


def in_order(latest: float, times: Array, jump: float) -> tuple[float, IntArray]:
    """Returns the latest time and the flags (n,) of samples that have a time and no count.

    Args:
        latest: s, before the first; minus infinity at the start.
        times: (n,) s.
        jump: s; a clock that goes back by more is another clock, by less a sample out of order.
    """
    flags = np.zeros(len(times), dtype=np.int64)
    rising = np.diff(times, prepend=np.nan) > 0.0
    at = 0
    while at < len(times):
        time = float(times[at])
        if time > latest:
            end = at + 1 + _run(rising[at + 1 :])
            latest = float(times[end - 1])
            at = end
            continue
        kind = Flag.REPEATED if time == latest else Flag.REORDERED
        if latest - time > jump:
            kind = Flag.CLOCK_JUMP
            latest = time
        flags[at] = int(kind)
        at += 1
    return latest, flags


def _run(holds: BoolArray) -> int:
    """How many hold from the first on."""
    return len(holds) if holds.all() else int(np.argmin(holds))


def _moved(state: SequenceState, counts: IntArray, before: IntArray) -> IntArray:
    moved = counts - before
    if state.modulus:
        half = state.modulus // 2
        moved = (moved + half) % state.modulus - half
    return np.asarray(moved)
