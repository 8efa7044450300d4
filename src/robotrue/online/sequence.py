"""The count that packets carry, watched: repeated, reordered, lost, leaping and late ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.errors import ConfigurationError, ShapeError
from robotrue.online.blocks import Flag


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceState:
    """State of a stream after its latest packet.

    Attributes:
        step: What the count grows by from packet to packet (RSI: ms of the cycle, 4 or 12).
        modulus: Where the count starts again at zero; 0 if it never does.
        window: Packets. A count back or ahead by more than this means another clock, not a loss.
        late_after: s between two packets on the host's clock from which the second is late.
        last: Highest count seen on the present clock; None before the first packet.
        host_time: s, when that packet came.
        total: Packets the sender has sent on this clock since the first one seen, losses included.
        late_count: The controller's own count of late answers, as last seen.
        received: Packets looked at.
        lost: Packets that never came; one that comes late is subtracted again.
        repeated: Packets whose count had come.
        reordered: Packets older than the latest.
        jumps: Clock jumps.
        late: Late packets.
    """

    step: int = 1
    modulus: int = 0
    window: int = 100
    late_after: float = float("inf")
    last: int | None = None
    host_time: float = float("-inf")
    total: int = 0
    late_count: int = 0
    received: int = 0
    lost: int = 0
    repeated: int = 0
    reordered: int = 0
    jumps: int = 0
    late: int = 0

    def __post_init__(self) -> None:
        """Checks."""
        if self.step < 1 or self.window < 1 or self.modulus < 0 or not self.late_after > 0.0:
            raise ConfigurationError(
                f"step {self.step}, window {self.window}, modulus {self.modulus}, late after "
                f"{self.late_after:g} s; expected step and window from 1, late after more than 0."
            )


def advance(
    state: SequenceState, count: int, host_time: float, *, late_count: int = 0
) -> tuple[SequenceState, Flag]:
    """Returns the state after a packet, and the packet's faults.

    A repeated or reordered packet leaves the clock where it is. After a jump the new count is
    taken: a controller that was restarted continues after one bad packet, and one damaged count
    marks itself and the packet after it.

    Args:
        state: Before the packet.
        count: The packet's own.
        host_time: s, when it came, on a clock that does not go back.
        late_count: The controller's count of late answers, where the packet holds it.

    Fails when: the sender leaps ahead by exactly one turn of its modulus.
    """
    flags = Flag.NONE
    if state.last is None:
        started = replace(state, last=count, host_time=host_time, received=1, late_count=late_count)
        return started, flags
    if late_count > state.late_count or host_time - state.host_time > state.late_after:
        flags |= Flag.LATE
    moved = count - state.last
    if state.modulus:
        half = state.modulus // 2
        moved = (moved + half) % state.modulus - half
    kind, packets = _kind(state, moved, host_time)
    flags |= kind
    late = state.late + bool(flags & Flag.LATE)
    seen = replace(state, received=state.received + 1, late=late, late_count=late_count)
    if kind & Flag.CLOCK_JUMP:
        state = replace(seen, last=count, host_time=host_time, total=seen.total + 1)
        return replace(state, jumps=state.jumps + 1), flags
    if kind & Flag.REPEATED:
        return replace(seen, repeated=seen.repeated + 1), flags
    if kind & Flag.REORDERED:
        return replace(seen, reordered=seen.reordered + 1, lost=max(0, seen.lost - 1)), flags
    return replace(
        seen,
        last=count,
        host_time=host_time,
        total=seen.total + packets,
        lost=seen.lost + packets - 1,
    ), flags


def _kind(state: SequenceState, moved: int, host_time: float) -> tuple[Flag, int]:
    packets, off_grid = divmod(moved, state.step)
    if off_grid or abs(packets) > state.window or host_time < state.host_time:
        return Flag.CLOCK_JUMP, 1
    if packets == 0:
        return Flag.REPEATED, 0
    if packets < 0:
        return Flag.REORDERED, packets
    return (Flag.GAP if packets > 1 else Flag.NONE), packets


def advance_block(
    state: SequenceState, counts: IntArray, host_times: Array
) -> tuple[SequenceState, IntArray]:
    """Returns the state after packets in the order they came, and the flags (n,) of each.

    Equal to :func:`advance` packet by packet, which handles every packet that does not follow the
    one before.

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
    follows = (_count_steps(state, counts[1:], counts[:-1]) == state.step) & ~(gone[1:] < 0.0)
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
    """Returns the number of leading true values."""
    return len(holds) if holds.all() else int(np.argmin(holds))


def _count_steps(state: SequenceState, counts: IntArray, before: IntArray) -> IntArray:
    moved = counts - before
    if state.modulus:
        half = state.modulus // 2
        moved = (moved + half) % state.modulus - half
    return np.asarray(moved)
