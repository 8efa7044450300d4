"""One force sample after the other, in machine code: checked, turned into base, bent, summed up.

``gathered`` takes samples until something needs Python: the filters have to settle or to change,
or a window is full. It writes a row of work per sample that enters the filters, those of a bridged
gap included. ``combined`` adds what the filters made of them. Every number depends on the samples
before it alone, so any cutting into blocks gives the same numbers.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, IntArray
from robotrue.core.compiled import EXACT, SUMS, compiled
from robotrue.online.estimates import Doubt
from robotrue.online.samples import Flag
from robotrue.online.sensing_pose import (
    ADDED,
    LEVER,
    PHYSICS,
    READ,
    SENSOR,
    SPREAD,
    STILL,
    TURNED,
    ZERO,
    Constants,
    posed,
)
from robotrue.online.sensing_watch import watched

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
"""Why ``gathered`` stopped."""

# state, one number each
LAST_TIME, ANCHOR, STEPS, PENDING, STARTED, LEFT, WINDOW_LEFT, ROW, LOST, DEBT = range(10)
WRENCH, STAGE_1, STAGE_2, SQUARES_1, SQUARES_2, JOINTS = 10, 16, 22, 28, 31, 34
"""Last wrench, two low-passes of it, two of the squared displacement; last the joints (dof) that
pose and modes are of, one after the other."""
# numbers of the models and settings
(
    RATE, AGE, SOFT, BRIDGED, MOST, LONGEST, ROOM, REFRESHED, MEMORY, MASS, LEARNED, OFFSET,
    WHOLE_WINDOW, MISFIT,
) = range(14)  # fmt: skip
PARAMETERS: Final = 14
# a row of work
INDEX, ROW_TURNED, ROW_ADDED, ROW_STILL, ROW_SPREAD, ROW_PHYSICS, ALONG = 0, 1, 10, 13, 16, 19, 20
WORK: Final = 21
# sums over a window; then joints (dof)
ROWS, FORCE_SUM, TURN_PEAK, TURN_FORCE, PEAKS, FORCE_PEAKS, TURN_COUNT, SEEN = (
    0,
    1,
    4,
    5,
    6,
    7,
    8,
    9,
)
WINDOW_SUMS: Final = 10
_OFF_GRID: Final = 0.75
_FOLLOWS: Final = 0.01
"""How fast the grid of samples follows the sender's clock."""
_FORGIVEN, _MOST_DEBT = 0.99, 10.0
"""Missing samples are forgotten in a hundred; more than so many at once: another rate."""
_LEVER_FORCE: Final = 5.0
_LEVER_FLOOR: Final = 0.5
"""N and N m; below them a lever says nothing."""
_LIMIT_SLACK: Final = 1e-3
_MOVED: Final = 1e-4
"""rad, turn of a joint after which the numbers of the pose are computed anew."""


@compiled(EXACT)
def gathered(
    first: int,
    host_time: Array,
    controller_time: Array,
    wrench: Array,
    flags: IntArray,
    frame: int,
    rows: Array,
    p: Array,
    c: Constants,
    s: Array,
    watch: Array,
    window: Array,
    pose: Array,
    joints: Array,
    wrench_out: Array,
    doubts: IntArray,
    force: Array,
    work: Array,
) -> tuple[int, int, int, int]:
    """Takes samples from ``first`` on; returns next sample, rows of work, why, and at which row.

    Args:
        first: Sample to begin with.
        host_time: (n,) s.
        controller_time: (n,) s or NaN.
        wrench: (n, 6) N, N m.
        flags: (n,).
        frame: BASE, TOOL or SENSOR.
        rows: (k, HEAD + 2 dof) of :class:`robotrue.online.sensing_joints.JointTrack`.
        p: (PARAMETERS,).
        c: Models.
        s: State, changed.
        watch: State of the watch over the force, changed.
        window: Sums over the window, changed.
        pose: Numbers of the pose the state names, changed with it.
        joints: (n, dof) rad, written: model joints, NaN where not known.
        wrench_out: (n, 6), written.
        doubts: (n,), written.
        force: (cap, 3) N, written: rows of work for the filters.
        work: (cap, WORK), written.
    """
    n, dof = len(host_time), len(c.compliance)
    q, now = np.empty(dof), np.empty(6)
    of_pose, of_modes = s[JOINTS : JOINTS + dof], s[JOINTS + dof : JOINTS + 2 * dof]
    count, room = 0, len(force) - 1 - int(p[BRIDGED])
    i = first
    while i < n and count < room:
        for k in range(dof):
            joints[i, k] = np.nan
        for k in range(6):
            wrench_out[i, k] = np.nan
        time = host_time[i]
        doubt = _clocked(time, controller_time[i], flags[i], p, s)
        if flags[i] & _NO_SLOT:
            doubts[i] = doubt
            i += 1
            continue
        if watched(wrench[i], p[MOST], watch):
            doubt |= BAD_FORCE
        row = int(s[ROW])
        while row + 1 < len(rows) and rows[row + 1, 0] <= time:
            row += 1
        s[ROW] = row
        known = row >= 0 and time - rows[row, 2] <= p[AGE]
        if known:
            doubt |= _joints(time, rows[row], p, c, q)
            for k in range(dof):
                joints[i, k] = q[k]
        else:
            doubt |= NO_JOINTS
            s[LOST] = 1.0
        if doubt & (BAD_FORCE | CLOCK | NO_JOINTS):
            s[PENDING] += 1.0
            doubts[i] = doubt
            i += 1
            continue
        if not _apart(q, of_pose) <= _MOVED:
            _kept(q, of_pose)
            posed(q, frame, c, pose)
        _wrench(wrench[i], frame, pose, c.held, p[MASS], rows[row, 4:7], now)
        why, missing = GOES_ON, int(s[PENDING])
        if s[STARTED] == 0.0 or s[LOST] != 0.0 or s[PENDING] > p[BRIDGED]:
            why, missing = SETTLE, 0
            _start(now, p, s, window)
        if why == SETTLE or _apart(q, of_modes) > p[REFRESHED]:
            _kept(q, of_modes)
            why = SETTLE if why == SETTLE else REFRESH
        at = count
        for k in range(1, missing + 2):
            work[count, INDEX] = i if k == missing + 1 else -1.0
            _row(k / (missing + 1.0), now, q, pose, c, p, s, window, force[count], work[count])
            count += 1
        for k in range(6):
            s[WRENCH + k] = wrench_out[i, k] = now[k]
        s[PENDING] = 0.0
        if s[LEFT] >= 0.0:
            doubt |= SETTLING
        else:
            s[LEFT] = -1.0
        doubts[i] = doubt | _strange(s, p, c.learned, dof)
        i += 1
        if p[LEARNED] != 0.0 and s[WINDOW_LEFT] <= 0.0:
            s[WINDOW_LEFT] = p[WHOLE_WINDOW]
            return i, count, why + 4 * WINDOW, at
        if why != GOES_ON:
            return i, count, why, at
    return i, count, GOES_ON, count


@compiled(EXACT)
def _clocked(time: float, sent: float, flag: int, p: Array, s: Array) -> int:
    """Doubts of a sample's clocks and flags; a gap in the sender's clock counts what is missing."""
    doubt = 0
    if not np.isfinite(time) or time < s[LAST_TIME]:
        doubt |= CLOCK
    else:
        s[LAST_TIME] = time
    if flag & _FLAG_INVALID:
        doubt |= BAD_FORCE
    if flag & _FLAG_JUMP:
        doubt |= CLOCK
    if not flag & _NO_SLOT and _stepped(sent, flag, p, s):
        doubt |= CLOCK
    return doubt


@compiled(EXACT)
def _joints(time: float, row: Array, p: Array, c: Constants, q: Array) -> int:
    """Writes the joints of a time; returns doubts about them."""
    doubt, dof = int(row[1]), len(q)
    on = min(time - row[2], row[3])
    for k in range(dof):
        q[k] = row[7 + k] + on * row[7 + dof + k]
        if not c.limits[k, 0] - _LIMIT_SLACK <= q[k] <= c.limits[k, 1] + _LIMIT_SLACK:
            doubt |= OUTSIDE
        if abs(q[k] - c.home[k]) > p[ROOM]:
            doubt |= OUTSIDE
    return doubt


@compiled(EXACT)
def _apart(one: Array, two: Array) -> float:
    """Largest difference; NaN where one is."""
    size = 0.0
    for k in range(len(one)):
        gap = abs(one[k] - two[k])
        if not gap <= size:
            size = gap
    return size


@compiled(EXACT)
def _kept(values: Array, out: Array) -> None:
    for k in range(len(values)):
        out[k] = values[k]


@compiled(EXACT)
def _start(now: Array, p: Array, s: Array, window: Array) -> None:
    """Forgets all but clocks and joints; the low-passes stand at the present wrench."""
    s[STARTED], s[LOST], s[LEFT], s[WINDOW_LEFT] = 1.0, 0.0, p[MEMORY], p[WHOLE_WINDOW]
    for k in range(len(window)):
        window[k] = 0.0
    for k in range(6):
        s[WRENCH + k] = s[STAGE_1 + k] = s[STAGE_2 + k] = now[k]
        s[SQUARES_1 + k] = 0.0  # both stages, three axes each


@compiled(EXACT)
def _stepped(time: float, flag: int, p: Array, s: Array) -> bool:
    """Counts the samples that never came; says whether the sender's clock is not to be trusted."""
    if not np.isfinite(time):
        if flag & _FLAG_GAP:
            s[PENDING] += 1.0 + p[BRIDGED]
        s[ANCHOR] = np.nan
        return False
    if not np.isfinite(s[ANCHOR]) or flag & _FLAG_JUMP:
        s[ANCHOR], s[STEPS] = time * p[RATE], 0.0
        return False
    s[STEPS] += 1.0
    s[DEBT] *= _FORGIVEN
    off = time * p[RATE] - s[ANCHOR] - s[STEPS]
    if off < -_OFF_GRID:
        s[ANCHOR], s[STEPS] = time * p[RATE], 0.0
        s[PENDING] += 1.0 + p[BRIDGED]
        return True
    if off > _OFF_GRID:
        missing = math.floor(off + 0.5)
        s[DEBT] += min(missing, 2.0)
        s[STEPS] += missing
        s[PENDING] += missing
        off -= missing
    s[ANCHOR] += _FOLLOWS * off
    return bool(s[DEBT] > _MOST_DEBT)


@compiled(EXACT)
def _wrench(
    read: Array, frame: int, pose: Array, held: Array, mass: float, acceleration: Array, out: Array
) -> None:
    """Writes the wrench of the process on the tool point in base axes, N and N m.

    As :func:`robotrue.dynamics.flange_sensor.process_wrench`, sample by sample. Where no moment is
    measured, that about the tool point is taken as zero.
    """
    moments = np.isfinite(read[3]) and np.isfinite(read[4]) and np.isfinite(read[5])
    fx, fy, fz, mx, my, mz = read[0], read[1], read[2], 0.0, 0.0, 0.0
    if moments:
        mx, my, mz = read[3], read[4], read[5]
    if frame == SENSOR:
        gx = held[0] - mass * acceleration[0]
        gy = held[1] - mass * acceleration[1]
        gz = held[2] - mass * acceleration[2]
        px = pose[READ] * gx + pose[READ + 3] * gy + pose[READ + 6] * gz
        py = pose[READ + 1] * gx + pose[READ + 4] * gy + pose[READ + 7] * gz
        pz = pose[READ + 2] * gx + pose[READ + 5] * gy + pose[READ + 8] * gz
        fx, fy, fz = fx - held[6] - px, fy - held[7] - py, fz - held[8] - pz
        if moments:
            cx, cy, cz = held[3], held[4], held[5]
            mx -= held[9] + cy * pz - cz * py
            my -= held[10] + cz * px - cx * pz
            mz -= held[11] + cx * py - cy * px
    for r in range(3):
        a, b, d = pose[READ + 3 * r], pose[READ + 3 * r + 1], pose[READ + 3 * r + 2]
        out[r] = a * fx + b * fy + d * fz
        out[3 + r] = a * mx + b * my + d * mz
    if moments:  # from the sensor's origin to the tool point; zero in other frames
        ax, ay, az = pose[LEVER], pose[LEVER + 1], pose[LEVER + 2]
        out[3] -= ay * out[2] - az * out[1]
        out[4] -= az * out[0] - ax * out[2]
        out[5] -= ax * out[1] - ay * out[0]


@compiled(SUMS)
def _row(
    part: float,
    now: Array,
    q: Array,
    pose: Array,
    c: Constants,
    p: Array,
    s: Array,
    window: Array,
    force: Array,
    work: Array,
) -> None:
    """Writes a row of work for the wrench ``part`` of the way from the last sample to this."""
    n, soft = len(q), p[SOFT]
    for k in range(6):
        w = s[WRENCH + k] + part * (now[k] - s[WRENCH + k])
        if k < 3:
            force[k] = w
        s[STAGE_1 + k] += soft * (w - s[STAGE_1 + k])
        s[STAGE_2 + k] += soft * (s[STAGE_1 + k] - s[STAGE_2 + k])
    slow, t = s[STAGE_2 : STAGE_2 + 6], pose[TURNED : TURNED + 9]
    fx, fy, fz = force[0], force[1], force[2]
    work[ALONG] = c.learned[n + 3] * fx + c.learned[n + 4] * fy + c.learned[n + 5] * fz
    for k in range(3):
        force[k] = t[k] * fx + t[3 + k] * fy + t[6 + k] * fz
    for k in range(9):
        work[ROW_TURNED + k] = t[k]
    work[ROW_PHYSICS] = p[OFFSET]
    for r in range(3):
        work[ROW_PHYSICS] += pose[PHYSICS + r] * slow[r]
        added, still, spread = 0.0, 0.0, pose[ZERO + r]
        for a in range(6):
            added += pose[ADDED + 6 * r + a] * slow[a]
            still += pose[STILL + 6 * r + a] * slow[a]
            total = 0.0
            for b in range(6):
                total += pose[SPREAD + 36 * r + 6 * a + b] * slow[b]
            spread += slow[a] * total
        work[ROW_ADDED + r], work[ROW_STILL + r] = added, still
        work[ROW_SPREAD + r] = spread
    s[LEFT] -= 1.0
    s[WINDOW_LEFT] -= 1.0
    if p[LEARNED] != 0.0:
        window[ROWS] += 1.0
        window[FORCE_SUM] += fx
        window[FORCE_SUM + 1] += fy
        window[FORCE_SUM + 2] += fz
        for k in range(n):
            window[WINDOW_SUMS + k] += q[k]


@compiled(EXACT)
def _strange(s: Array, p: Array, learned: Array, dof: int) -> int:
    """A slow force whose moment no cut makes, or unlike those the deviation was learned from."""
    doubt = 0
    size = math.sqrt(s[STAGE_2] ** 2 + s[STAGE_2 + 1] ** 2 + s[STAGE_2 + 2] ** 2)
    twist = math.sqrt(s[STAGE_2 + 3] ** 2 + s[STAGE_2 + 4] ** 2 + s[STAGE_2 + 5] ** 2)
    if size > _LEVER_FORCE and twist > p[LONGEST] * size + _LEVER_FLOOR:
        doubt |= BAD_FORCE
    if p[LEARNED] != 0.0:
        for c in range(3):
            if not learned[dof + 6 + c] <= s[STAGE_2 + c] <= learned[dof + 9 + c]:
                doubt |= EXTRAPOLATED
    return doubt


@compiled(SUMS)
def combined(
    begin: int,
    end: int,
    moved: Array,
    work: Array,
    p: Array,
    noise: Array,
    correction: Array,
    direction: Array,
    turn: float,
    s: Array,
    window: Array,
    doubts: IntArray,
    error: Array,
    sd: Array,
    static: Array,
) -> None:
    """Writes the estimates of rows of work from what the filters made of them.

    Args:
        begin: First row.
        end: Behind the last.
        moved: (cap, 3) m, out of the filters.
        work: Of :func:`gathered`.
        p: Parameters.
        noise: (3,) m^2, variance that the force's noise leaves, in the response's axes.
        correction: (3,) of :class:`robotrue.online.sensing_windows.WindowDeviation`.
        direction: (3,) it acts along; zero without.
        turn: Samples per turn of the spindle.
        s: State, changed.
        window: Sums over the window, changed.
        doubts: (n,), changed.
        error: (n, 3) m, written.
        sd: (n, 3) m, written.
        static: (n, 3) m, written.
    """
    e = np.empty(3)
    for k in range(begin, end):
        for c in range(3):
            square = moved[k, c] ** 2
            s[SQUARES_1 + c] += p[SOFT] * (square - s[SQUARES_1 + c])
            s[SQUARES_2 + c] += p[SOFT] * (s[SQUARES_1 + c] - s[SQUARES_2 + c])
        along, added = 0.0, 0.0
        for r in range(3):
            e[r] = 0.0
            for c in range(3):
                e[r] += work[k, ROW_TURNED + 3 * r + c] * moved[k, c]
            along += direction[r] * e[r]
            added += direction[r] * work[k, ROW_ADDED + r]
        if p[LEARNED] != 0.0:
            _peak(along, work[k, ALONG], turn, window)
        i = int(work[k, INDEX])
        if i < 0:
            continue
        if p[LEARNED] != 0.0 and correction[2] != 0.0:
            doubts[i] |= EXTRAPOLATED if correction[2] == 1.0 else OUTSIDE
        bad = (doubts[i] & INVALID) != 0
        learned = work[k, ROW_PHYSICS] - added if p[LEARNED] != 0.0 else 0.0
        for r in range(3):
            spread = work[k, ROW_SPREAD + r] + direction[r] ** 2 * correction[1]
            for c in range(3):
                part = work[k, ROW_TURNED + 3 * r + c] ** 2
                spread += part * (noise[c] + p[MISFIT] ** 2 * s[SQUARES_2 + c])
            error[i, r] = e[r] + work[k, ROW_ADDED + r] + direction[r] * (learned + correction[0])
            sd[i, r] = math.sqrt(spread)
            static[i, r] = work[k, ROW_STILL + r] + direction[r] * learned
            if bad:
                error[i, r] = sd[i, r] = static[i, r] = np.nan


@compiled(EXACT)
def _peak(bent: float, pushed: float, turn: float, window: Array) -> None:
    """Keeps the largest of every turn of the spindle in the window, as ``peaks_per_turn``."""
    seen, turns = window[SEEN], window[TURN_COUNT]
    edge = np.rint(turns * turn)
    if seen >= np.rint((turns + 1.0) * turn):
        window[PEAKS] += window[TURN_PEAK]
        window[FORCE_PEAKS] += window[TURN_FORCE]
        window[TURN_COUNT] = turns + 1.0
        edge = seen
    if seen == edge:
        window[TURN_PEAK], window[TURN_FORCE] = bent, abs(pushed)
    else:
        window[TURN_PEAK] = max(window[TURN_PEAK], bent)
        window[TURN_FORCE] = max(window[TURN_FORCE], abs(pushed))
    window[SEEN] = seen + 1.0
