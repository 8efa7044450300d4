"""Configuration words as columns: which joints they ask for, and which to write for new joints.

Columns as in :mod:`robotrue.core.words`, meanings as in :mod:`robotrue.robot.configuration`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.words import NO_WORD, WORDS, Maker
from robotrue.robot.configuration import (
    EDGE,
    abb_confdata,
    fanuc_words,
    kuka_status_turn,
    yaskawa_rconf,
)
from robotrue.robot.model import RobotModel

KUKA_SHAPE: Final = 7
"""Bits of S that name the branch; bit 3 says how the point was taught."""
_BRANCH: Final[dict[str, tuple[int, ...]]] = {
    "kuka": (0,),
    "abb": (3,),
    "fanuc": (0, 1, 2),
    "yaskawa": (0, 1, 2),
}
"""Columns that name the branch."""
_TURNS: Final[dict[str, dict[int, int]]] = {
    "kuka": dict.fromkeys(range(6), 1),
    "abb": {0: 0, 3: 1, 5: 2},
    "fanuc": {3: 3, 4: 4, 5: 5},
    "yaskawa": {3: 3, 5: 4, 0: 5},
}
"""Axis (from 0) and the column that speaks of its turn."""
_LIMIT_SLACK: Final = 1e-9


def configuration_words(robot: RobotModel, maker: Maker, joints: Array) -> IntArray:
    """Returns the words (..., w) of joints q (..., 6) rad.

    Raises:
        ConfigurationError: Not an ortho-parallel arm.
    """
    if maker == "kuka":
        return np.stack(kuka_status_turn(robot, joints), axis=-1)
    if maker == "abb":
        return abb_confdata(robot, joints)
    if maker == "fanuc":
        return fanuc_words(robot, joints)
    if maker == "yaskawa":
        return yaskawa_rconf(robot, joints)
    return np.zeros((*np.shape(joints)[:-1], WORDS[maker]), dtype=np.int64)


def branch_words(maker: Maker, words: IntArray) -> IntArray:
    """Returns of words (n, w) what names the branch (n, b); ``NO_WORD`` where it is not written."""
    out = words[:, _BRANCH.get(maker, ())]
    mask = KUKA_SHAPE if maker == "kuka" else -1
    return np.where(out == NO_WORD, out, out & mask)


def branch_fits(maker: Maker, wanted: IntArray, have: IntArray) -> BoolArray:
    """Returns which branches (n, b) with words ``have`` (n, b, w) are those of ``wanted`` (n, w).

    Words that are not written fit any branch.
    """
    out = np.ones(have.shape[:2], dtype=np.bool_)
    mask = KUKA_SHAPE if maker == "kuka" else -1
    for column in _BRANCH.get(maker, ()):
        asked = wanted[:, None, column]
        out &= (asked == NO_WORD) | ((have[:, :, column] & mask) == (asked & mask))
    return out


def on_turn(
    robot: RobotModel, maker: Maker, joints: Array, wanted: IntArray
) -> tuple[Array, BoolArray]:
    """Returns joints (n, 6) rad on the turns that words ask for, and whether the limits allow it.

    Of several turns that fit the one nearest to zero of the controller's axis is taken. An axis
    nearer than ``EDGE`` to where its word changes fits both.

    Args:
        robot: The arm.
        maker: Whose words.
        joints: (n, 6) rad, any turn.
        wanted: (n, w).
    """
    out, good = np.array(joints), np.ones(len(joints), dtype=np.bool_)
    if robot.controller is None:
        return out, good
    turns = _TURNS.get(maker, {})
    for i in range(6):
        best = np.full(len(joints), np.inf)
        for k in (0, -1, 1):
            q = joints[:, i] + 2.0 * np.pi * k
            axis = robot.controller.sign[i] * q + robot.controller.offset[i]
            allowed = (q >= robot.limits[i, 0] - _LIMIT_SLACK) & (
                q <= robot.limits[i, 1] + _LIMIT_SLACK
            )
            if i in turns:
                allowed &= _axis_fits(maker, i, axis, wanted[:, turns[i]])
            better = allowed & (np.abs(axis) < best)
            out[better, i] = q[better]
            best[better] = np.abs(axis)[better]
        good &= np.isfinite(best)
    return out, good


def renewed(maker: Maker, written: IntArray, before: IntArray, after: IntArray) -> IntArray:
    """Returns the words (n, w) to write, ``NO_WORD`` where what is written stays.

    A word is renewed only where the correction changes it: where a controller counts otherwise
    than :mod:`robotrue.robot.configuration` says, the program's own words stand.

    Args:
        maker: Whose words.
        written: (n, w) in the program.
        before: (n, w) of the joints of the target as written.
        after: (n, w) of the joints that will be commanded.
    """
    value = after.copy()
    same = before == after
    if maker == "kuka":
        old = written[:, 0]
        value[:, 0] = (after[:, 0] & KUKA_SHAPE) | (old & ~KUKA_SHAPE)
    return np.where(same | (written == NO_WORD), NO_WORD, value).astype(np.int64)


def _axis_fits(maker: Maker, axis: int, value: Array, word: IntArray) -> BoolArray:
    """Whether axis values (n,) rad of the controller have the turn of a word (n,)."""
    low, high = (_axis_word(maker, axis, value + shift, word) for shift in (-EDGE, EDGE))
    return np.asarray((word == NO_WORD) | low | high)


def _axis_word(maker: Maker, axis: int, value: Array, word: IntArray) -> BoolArray:
    if maker == "kuka":
        return np.asarray((value < 0.0) == ((word >> axis) & 1 == 1))
    if maker == "abb":
        return np.asarray(np.floor(value / (0.5 * np.pi)) == word)
    if maker == "fanuc":
        return np.asarray(np.rint(value / (2.0 * np.pi)) == word)
    return np.asarray((np.abs(value) > np.pi) == (word == 1))
