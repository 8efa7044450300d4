"""One force sample after the other, in machine code: checked, turned into base, bent, summed up.

``ingest`` takes samples until something needs Python: the filters have to settle or to change, or a
window is full. It writes a row of work per sample that enters the filters, those of a bridged gap
included. ``combine`` adds what the filters made of them. Every number depends on the samples before
it alone, so any cutting into blocks gives the same numbers. Records as in
:mod:`robotrue.online.sensing_records`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray, Records
from robotrue.core.compiled import EXACT, SUMS, compile_kernel
from robotrue.online.blocks import Flag
from robotrue.online.estimates import Doubt
from robotrue.online.sensing_pose import SENSOR, Constants, write_pose
from robotrue.online.sensing_records import HEAD
from robotrue.online.sensing_watch import refuse_force
from robotrue.online.sensing_windows import add_peak, clear_window

NO_JOINTS: Final = int(Doubt.NO_JOINTS)
BAD_FORCE: Final = int(Doubt.BAD_FORCE)
OUTSIDE: Final = int(Doubt.OUTSIDE)
SETTLING: Final = int(Doubt.SETTLING)
CLOCK: Final = int(Doubt.CLOCK)
EXTRAPOLATED: Final = int(Doubt.EXTRAPOLATED)
INVALID: Final = int(Doubt.INVALID)
_FLAG_INVALID: Final = int(Flag.INVALID)
_FLAG_JUMP: Final = int(Flag.CLOCK_JUMP)
_FLAG_GAP: Final = int(Flag.GAP)
_NO_SLOT: Final = int(Flag.REPEATED | Flag.REORDERED)
GOES_ON, SETTLE, REFRESH, WINDOW = 0, 1, 2, 3
"""Why ``ingest`` stopped."""

_OFF_GRID: Final = 0.75
_FOLLOWS: Final = 0.01
"""How fast the grid of samples follows the sender's clock."""
_FORGIVEN, _MOST_DEBT = 0.99, 10.0
"""Missing samples are forgotten in a hundred; more than so many at once: another rate."""
_LEVER_FORCE: Final = 5.0
_LEVER_FLOOR: Final = 0.5
"""N and N m; below them a lever is not meaningful."""
_LIMIT_SLACK: Final = 1e-3
_MOVED: Final = 1e-4
"""rad, turn of a joint after which the numbers of the pose are computed again."""


@compile_kernel(EXACT)
def ingest(
    first: int, host_time: Array, controller_time: Array, wrench: Array, flags: IntArray,
    frame: int, rows: Array, parameters: Records, c: Constants, states: Records, watches: Records,
    windows: Records, poses: Records, joints: Array, wrench_out: Array, doubts: IntArray,
    force: Array, work: Records,
) -> tuple[int, int, int, int]:  # fmt: skip
    """Checks and rotates force samples from ``first`` on until Python is needed.

    Args:
        first: Sample to begin with.
        host_time: (n,) s.
        controller_time: (n,) s or NaN.
        wrench: (n, 6) N, N m.
        flags: (n,).
        frame: BASE, TOOL or SENSOR.
        rows: (k, HEAD + 2 dof) of :class:`robotrue.online.sensing_joints.JointTrack`.
        parameters: (1,).
        c: Models.
        states: (1,), changed.
        watches: (1,) state of the watch over the force, changed.
        windows: (1,) sums over the window, changed.
        poses: (1,) numbers of the pose the state names, changed with it.
        joints: (n, dof) rad, written: model joints, NaN where not known.
        wrench_out: (n, 6), written.
        doubts: (n,), written.
        force: (cap, 3) N, written: rows of work for the filters.
        work: (cap,), written.

    Returns:
        Next sample, rows of work, why it stopped (plus 4 ``WINDOW`` where a window is full), and
        the row of work at which it did.
    """
    p, s, pose = parameters[0], states[0], poses[0]
    q, now = np.empty(len(c.compliance)), np.empty(6)
    count, room = 0, len(force) - 1 - int(p.bridged)
    for i in range(first, len(host_time)):
        if count >= room:
            return i, count, GOES_ON, count
        joints[i, :], wrench_out[i, :] = np.nan, np.nan
        doubt = _check_clocks(host_time[i], controller_time[i], flags[i], p, s)
        doubts[i] = doubt
        if flags[i] & _NO_SLOT:
            continue
        if refuse_force(wrench[i], p.force_most, watches[0]):
            doubt |= BAD_FORCE
        row = _find_joints(host_time[i], rows, s)
        if row >= 0 and host_time[i] - rows[row, 2] <= p.joints_age:
            doubt |= _write_joints(host_time[i], rows[row], p, c, q)
            joints[i, :] = q
        else:
            doubt |= NO_JOINTS
            s.lost = 1.0
        doubts[i] = doubt
        if doubt & (BAD_FORCE | CLOCK | NO_JOINTS):
            s.pending += 1.0
            continue
        if not _largest_difference(q, s.joints_of_pose) <= _MOVED:
            s.joints_of_pose[:] = q
            write_pose(q, frame, c, poses)
        _write_wrench(wrench[i], frame, pose, c, p.held_mass, rows[row, 4:HEAD], now)
        why, missing = GOES_ON, int(s.pending)
        if s.started == 0.0 or s.lost != 0.0 or s.pending > p.bridged:
            why, missing = SETTLE, 0
            _restart(now, p, s, windows[0])
        if why == SETTLE or _largest_difference(q, s.joints_of_modes) > p.refresh:
            s.joints_of_modes[:] = q
            why = SETTLE if why == SETTLE else REFRESH
        stopped_at = count
        for k in range(1, missing + 2):
            work[count].index = i if k == missing + 1 else -1.0
            part = k / (missing + 1.0)
            _write_work(part, now, q, pose, c, p, s, windows[0], force[count], work[count])
            count += 1
        for k in range(6):
            s.wrench[k] = wrench_out[i, k] = now[k]
        s.pending = 0.0
        if s.left >= 0.0:
            doubts[i] |= SETTLING
        else:
            s.left = -1.0
        doubts[i] |= _check_slow_force(s, p, c)
        if p.learned != 0.0 and s.window_left <= 0.0:
            s.window_left = p.window
            return i + 1, count, why + 4 * WINDOW, stopped_at
        if why != GOES_ON:
            return i + 1, count, why, stopped_at
    return len(host_time), count, GOES_ON, count


@compile_kernel(EXACT)
def _find_joints(time: float, rows: Array, s: np.record) -> int:
    """Returns the last row of joints that came before a time, -1 without; the state keeps it."""
    row = int(s.row)
    while row + 1 < len(rows) and rows[row + 1, 0] <= time:
        row += 1
    s.row = row
    return row


@compile_kernel(EXACT)
def _check_clocks(time: float, sent: float, flag: int, p: np.record, s: np.record) -> int:
    """Returns the warnings of a sample's clocks and flags; counts missing samples."""
    doubt = 0
    if not np.isfinite(time) or time < s.last_time:
        doubt |= CLOCK
    else:
        s.last_time = time
    if flag & _FLAG_INVALID:
        doubt |= BAD_FORCE
    if flag & _FLAG_JUMP:
        doubt |= CLOCK
    if not flag & _NO_SLOT and _count_missing(sent, flag, p, s):
        doubt |= CLOCK
    return doubt


@compile_kernel(EXACT)
def _write_joints(time: float, row: Array, p: np.record, c: Constants, q: Array) -> int:
    """Writes the joints of a time; returns their warnings."""
    doubt, dof = int(row[1]), len(q)
    on = min(time - row[2], row[3])
    for k in range(dof):
        q[k] = row[HEAD + k] + on * row[HEAD + dof + k]
        if not c.limits[k, 0] - _LIMIT_SLACK <= q[k] <= c.limits[k, 1] + _LIMIT_SLACK:
            doubt |= OUTSIDE
        if abs(q[k] - c.home[k]) > p.room:
            doubt |= OUTSIDE
    return doubt


@compile_kernel(EXACT)
def _largest_difference(one: Array, two: Array) -> float:
    """Largest difference; NaN where one is."""
    size = 0.0
    for k in range(len(one)):
        gap = abs(one[k] - two[k])
        if not gap <= size:
            size = gap
    return size


@compile_kernel(EXACT)
def _restart(now: Array, p: np.record, s: np.record, window: np.record) -> None:
    """Forgets all but clocks and joints; the low-passes begin at the present wrench."""
    s.started, s.lost, s.left, s.window_left = 1.0, 0.0, p.memory, p.window
    clear_window(window)
    s.wrench[:], s.stage_1[:], s.stage_2[:] = now, now, now
    s.squares_1[:], s.squares_2[:] = 0.0, 0.0


@compile_kernel(EXACT)
def _count_missing(time: float, flag: int, p: np.record, s: np.record) -> bool:
    """Counts the samples that never came; returns whether the sender's clock is unreliable."""
    if not np.isfinite(time):
        if flag & _FLAG_GAP:
            s.pending += 1.0 + p.bridged
        s.anchor = np.nan
        return False
    if not np.isfinite(s.anchor) or flag & _FLAG_JUMP:
        s.anchor, s.steps = time * p.rate, 0.0
        return False
    s.steps += 1.0
    debt = s.debt = s.debt * _FORGIVEN
    off = time * p.rate - s.anchor - s.steps
    if off < -_OFF_GRID:
        s.anchor, s.steps = time * p.rate, 0.0
        s.pending += 1.0 + p.bridged
        return True
    if off > _OFF_GRID:
        missing = math.floor(off + 0.5)
        debt = s.debt = debt + min(missing, 2.0)
        s.steps += missing
        s.pending += missing
        off -= missing
    s.anchor += _FOLLOWS * off
    return bool(debt > _MOST_DEBT)


@compile_kernel(EXACT)
def _write_wrench(
    read: Array,
    frame: int,
    pose: np.record,
    c: Constants,
    mass: float,
    acceleration: Array,
    out: Array,
) -> None:
    """Writes the wrench of the process on the tool point in base axes, N and N m.

    As :func:`robotrue.dynamics.flange_sensor.process_wrench`, sample by sample. Where no moment is
    measured, that about the tool point is taken as zero.
    """
    moments = np.isfinite(read[3]) and np.isfinite(read[4]) and np.isfinite(read[5])
    force, moment, pull = np.empty(3), np.zeros(3), np.zeros(3)
    for r in range(3):
        force[r] = read[r]
        if moments:
            moment[r] = read[3 + r]
    if frame == SENSOR:
        for r in range(3):
            for k in range(3):
                pull[r] += pose.read[k, r] * (c.weight[k] - mass * acceleration[k])
        for r in range(3):
            u, v = (r + 1) % 3, (r + 2) % 3
            force[r] = force[r] - c.force_offset[r] - pull[r]
            if moments:
                moment[r] -= c.moment_offset[r] + c.centre[u] * pull[v] - c.centre[v] * pull[u]
    for r in range(3):
        out[r] = out[3 + r] = 0.0
        for k in range(3):
            out[r] += pose.read[r, k] * force[k]
            out[3 + r] += pose.read[r, k] * moment[k]
    if moments:  # from the sensor's origin to the tool point; zero in other frames
        for r in range(3):
            u, v = (r + 1) % 3, (r + 2) % 3
            out[3 + r] -= pose.lever[u] * out[v] - pose.lever[v] * out[u]


@compile_kernel(SUMS)
def _write_work(
    part: float, now: Array, q: Array, pose: np.record, c: Constants, p: np.record, s: np.record,
    window: np.record, force: Array, work: np.record,
) -> None:  # fmt: skip
    """Writes a row of work for the wrench ``part`` of the way from the last sample to this."""
    n = len(q)
    for k in range(6):
        w = s.wrench[k] + part * (now[k] - s.wrench[k])
        if k < 3:
            force[k] = w
        s.stage_1[k] += p.soft * (w - s.stage_1[k])
        s.stage_2[k] += p.soft * (s.stage_1[k] - s.stage_2[k])
    fx, fy, fz = force[0], force[1], force[2]
    work.along = c.direction[0] * fx + c.direction[1] * fy + c.direction[2] * fz
    work.physics = p.offset
    for r in range(3):
        force[r] = pose.turned[0, r] * fx + pose.turned[1, r] * fy + pose.turned[2, r] * fz
        work.turned[r, :] = pose.turned[r]
        work.physics += pose.physics[r] * s.stage_2[r]
        added, still, spread = 0.0, 0.0, pose.zero[r]
        for a in range(6):
            added += pose.added[r, a] * s.stage_2[a]
            still += pose.still[r, a] * s.stage_2[a]
            total = 0.0
            for b in range(6):
                total += pose.spread[r, a, b] * s.stage_2[b]
            spread += s.stage_2[a] * total
        work.added[r], work.still[r], work.spread[r] = added, still, spread
    s.left -= 1.0
    s.window_left -= 1.0
    if p.learned != 0.0:
        window.rows += 1.0
        window.force[0] += fx
        window.force[1] += fy
        window.force[2] += fz
        for k in range(n):
            window.joints[k] += q[k]


@compile_kernel(EXACT)
def _check_slow_force(s: np.record, p: np.record, c: Constants) -> int:
    """A slow force whose moment no cut makes, or unlike those the deviation was learned from."""
    doubt, slow = 0, s.stage_2
    size = math.sqrt(slow[0] ** 2 + slow[1] ** 2 + slow[2] ** 2)
    twist = math.sqrt(slow[3] ** 2 + slow[4] ** 2 + slow[5] ** 2)
    if size > _LEVER_FORCE and twist > p.longest_lever * size + _LEVER_FLOOR:
        doubt |= BAD_FORCE
    if p.learned != 0.0:
        for k in range(3):
            if not c.force_low[k] <= slow[k] <= c.force_high[k]:
                doubt |= EXTRAPOLATED
    return doubt


@compile_kernel(SUMS)
def combine(
    count: int, moved: Array, work: Records, parameters: Records, noise: Array, correction: Array,
    direction: Array, turn: float, states: Records, windows: Records, doubts: IntArray,
    error: Array, sd: Array, static: Array,
) -> None:  # fmt: skip
    """Writes the estimates of rows of work from what the filters made of them.

    Args:
        count: Rows of work.
        moved: (cap, 3) m, out of the filters.
        work: (cap,) of :func:`ingest`.
        parameters: (1,).
        noise: (3,) m^2, variance that the force's noise leaves, in the response's axes.
        correction: (3,) of :class:`robotrue.online.sensing_windows.WindowDeviation`.
        direction: (3,) it acts along; zero without.
        turn: Samples per turn of the spindle.
        states: (1,), changed.
        windows: (1,) sums over the window, changed.
        doubts: (n,), changed.
        error: (n, 3) m, written.
        sd: (n, 3) m, written.
        static: (n, 3) m, written.
    """
    p, s, e = parameters[0], states[0], np.empty(3)
    for k in range(count):
        row = work[k]
        for c in range(3):
            square = moved[k, c] ** 2
            s.squares_1[c] += p.soft * (square - s.squares_1[c])
            s.squares_2[c] += p.soft * (s.squares_1[c] - s.squares_2[c])
        along, added = 0.0, 0.0
        for r in range(3):
            e[r] = 0.0
            for c in range(3):
                e[r] += row.turned[r, c] * moved[k, c]
            along += direction[r] * e[r]
            added += direction[r] * row.added[r]
        if p.learned != 0.0:
            add_peak(along, row.along, turn, windows[0])
        i = int(row.index)
        if i < 0:
            continue
        if p.learned != 0.0 and correction[2] != 0.0:
            doubts[i] |= EXTRAPOLATED if correction[2] == 1.0 else OUTSIDE
        learned = row.physics - added if p.learned != 0.0 else 0.0
        for r in range(3):
            spread = row.spread[r] + direction[r] ** 2 * correction[1]
            for c in range(3):
                part = row.turned[r, c] ** 2
                spread += part * (noise[c] + p.misfit**2 * s.squares_2[c])
            error[i, r] = e[r] + row.added[r] + direction[r] * (learned + correction[0])
            sd[i, r] = math.sqrt(spread)
            static[i, r] = row.still[r] + direction[r] * learned
            if doubts[i] & INVALID:
                error[i, r] = sd[i, r] = static[i, r] = np.nan
