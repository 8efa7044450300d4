"""Estimates made by a formula, for sinks."""

import numpy as np

from robotrue.online.estimates import Doubt, EstimateBlock


def estimates(start, count, *, rate=1000.0, doubt=Doubt.NONE, dof=6, at=100.0):
    """Rows ``start`` to ``start + count``: 40 um of 7 Hz along x, 10 um along y, 3 um along z."""
    k = np.arange(start, start + count)
    t = at + k / rate
    error = np.stack([40e-6 * np.sin(2 * np.pi * 7 * t), 10e-6 * np.cos(t), np.full(count, 3e-6)])
    doubts = np.broadcast_to(np.asarray(doubt, dtype=np.int64), count)
    valid = (doubts & int(Doubt.INVALID)) == 0
    hide = np.where(valid, 0.0, np.nan)[:, None]
    return EstimateBlock(
        host_time=t,
        error=error.T + hide,
        sd=np.full((count, 3), 2e-6) + hide,
        static=0.5 * error.T,
        wrench=np.tile([100.0, -50.0, 20.0, 0.1, 0.2, 0.3], (count, 1)) + hide,
        joints=np.tile(np.arange(1, dof + 1) * 0.1, (count, 1)),
        sequence=k,
        doubt=doubts,
    )
