"""Records of the sensing kernels: what their numbers are called.

All fields are float64, so that a record is also a row of numbers, as checkpoints keep it.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array

HEAD: Final = 7
"""Columns of a row of joints before the joints, see ``JointTrack``."""


def _dtype(*fields: tuple[str, tuple[int, ...]]) -> np.dtype[np.void]:
    return np.dtype([(name, np.float64, shape) for name, shape in fields])


def state_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record of what one force sample leaves to the next.

    Fields: ``last_time`` s; ``anchor`` and ``steps`` of the grid of samples; ``pending`` samples
    missing before this; ``started``; ``left`` samples until the filters settled; ``window_left``
    samples until the window is full; ``row`` of the joints; ``lost`` joints since the last start;
    ``debt`` of missing samples; ``wrench`` the last; ``stage_1``, ``stage_2`` two low-passes of
    it; ``squares_1``, ``squares_2`` two of the squared displacement; joints (rad) that the pose
    and the modes are of.
    """
    one = ("last_time", "anchor", "steps", "pending", "started", "left", "window_left", "row",
           "lost", "debt")  # fmt: skip
    return _dtype(
        *((name, ()) for name in one),
        ("wrench", (6,)),
        ("stage_1", (6,)),
        ("stage_2", (6,)),
        ("squares_1", (3,)),
        ("squares_2", (3,)),
        ("joints_of_pose", (dof,)),
        ("joints_of_modes", (dof,)),
    )


def window_dtype(dof: int) -> np.dtype[np.void]:
    """Returns the record of sums over a window of milling.

    Fields: ``rows``; ``force`` sum (3,) N; ``turn_peak`` m and ``turn_force`` N of the present
    turn of the spindle; ``peaks``, ``force_peaks`` their sums over whole turns; ``turns``;
    ``seen`` samples; ``joints`` sum (dof,) rad.
    """
    return _dtype(
        ("rows", ()), ("force", (3,)), ("turn_peak", ()), ("turn_force", ()), ("peaks", ()),
        ("force_peaks", ()), ("turns", ()), ("seen", ()), ("joints", (dof,)),
    )  # fmt: skip


_PARAMETERS: Final = (
    "rate", "joints_age", "soft", "bridged", "force_most", "longest_lever", "room", "refresh",
    "memory", "held_mass", "learned", "offset", "window", "misfit",
)  # fmt: skip
PARAMETERS_DTYPE: Final = _dtype(*((name, ()) for name in _PARAMETERS))
"""Numbers of models and settings: Hz, s, gain of the low-passes, samples, N, m, rad, rad, samples,
kg, 1 with a learned deviation, m, samples, part of the displacement."""
POSE_DTYPE: Final = _dtype(
    ("read", (3, 3)), ("lever", (3,)), ("turned", (3, 3)), ("added", (3, 6)), ("still", (3, 6)),
    ("physics", (3,)), ("spread", (3, 6, 6)), ("zero", (3,)),
)  # fmt: skip
"""Numbers of a pose, see :func:`robotrue.online.sensing_pose.write_pose`."""
WORK_DTYPE: Final = _dtype(
    ("index", ()), ("turned", (3, 3)), ("added", (3,)), ("still", (3,)), ("spread", (3,)),
    ("physics", ()), ("along", ()),
)  # fmt: skip
"""A sample that enters the filters: its index in the block, -1 inside a bridged gap, and what is
added to what the filters make of it."""
WATCH_DTYPE: Final = _dtype(
    ("last", (3,)), ("whole_run", ()), ("whole_largest", ()), ("equal_run", ()),
    ("channels", (3, 5)),
)  # fmt: skip
"""Force watch: last force N; run of whole numbers and its largest size; run of equal samples; for
each axis the columns below."""
HIGHEST, TIMES_HIGHEST, LOWEST, TIMES_LOWEST, RUN = range(5)
"""Extreme values of an axis, how often it was flat there, and its run at one value."""


def new_record(dtype: np.dtype[np.void]) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Returns one record of zeros, shape (1,)."""
    return np.zeros(1, dtype)


def numbers_of(record: np.ndarray[Any, np.dtype[np.void]]) -> Array:
    """Returns the numbers of one record (k,), a view."""
    return record.view(np.float64)
