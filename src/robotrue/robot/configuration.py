"""Configuration words of the controllers, from joints, and joints from words.

A Cartesian target states the tool pose, not the arm's configuration. Each brand adds words for it:
which of the eight branches, which turn of an axis. All need an ortho-parallel arm with a spherical
wrist and refer to the controller's own axes (``robot.controller``).

Sources: KUKA KSS system integrators' manual ("Status and Turn"); ABB RAPID reference, ``confdata``;
Fanuc and Yaskawa operators' manuals. Rules marked *from memory* or *by robot type* below were not
checked on a controller: compare one taught point before trusting them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD, WORDS, Maker
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.rotations import wrap
from robotrue.robot.inverse import require_opw
from robotrue.robot.model import RobotModel

EDGE: Final = 1e-6
"""rad; an angle nearer than this to the edge of two words satisfies both."""
_TURN: Final = 2.0 * np.pi
_QUARTER: Final = np.pi / 2.0
KUKA_SHAPE: Final = 7
"""Bits of S that name the branch; bit 3 marks a point taught with absolute accuracy."""
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
"""Axis (from 0) and the column of its turn."""
_LIMIT_SLACK: Final = 1e-9


def controller_axes(robot: RobotModel, joints: Array) -> Array:
    """Returns the axis values the controller displays (..., 6) rad from q (..., 6) rad."""
    return robot.controller.to_controller(np.asarray(joints, dtype=np.float64))


def axis_relation(robot: RobotModel) -> Callable[[Array], Array]:
    """Returns what takes the controller's axes (..., n) rad to joints q (..., n) rad."""
    return robot.controller.to_model


def kuka_status_turn(robot: RobotModel, joints: Array) -> tuple[IntArray, IntArray]:
    """Returns KUKA's S and T (...,) of joints q (..., 6) rad.

    S bit 0: the wrist point is behind axis 1 (overhead). Bit 1: the forearm is folded to the
    positive side of axis 3; A3 >= 0 where axes 3 and 4 meet, and A3 at or beyond the angle at which
    axis 2, axis 3 and the wrist point are in line where they are offset. Bit 2: A5 is negative
    (0 <= A5 < 180 and A5 < -180 deg give 0). Bit 3 (taught on an absolute-accuracy robot, *from
    memory*) is not set. T bit i: axis i + 1 is negative.

    Raises:
        ConfigurationError: Not an ortho-parallel arm.
    """
    _, fold, ahead = require_opw(robot).posture(joints)
    axes = controller_axes(robot, joints)
    status = (ahead < 0.0) + 2 * (fold >= 0.0) + 4 * (wrap(axes[..., 4]) < 0.0)
    turn = (axes < 0.0) @ (1 << np.arange(6))
    return np.asarray(status, dtype=np.int64), np.asarray(turn, dtype=np.int64)


def abb_confdata(robot: RobotModel, joints: Array) -> IntArray:
    """Returns ABB's cf1, cf4, cf6, cfx (..., 4) of joints q (..., 6) rad.

    cf1, cf4, cf6: quarter turn of axes 1, 4 and 6 (0..90 deg = 0, 90..180 = 1, -90..0 = -1). cfx of
    an arm with a spherical wrist: 4 if the wrist point is behind axis 1, plus 2 if it is behind the
    lower arm, plus 1 if axis 5 is negative.

    Fails when: the robot type counts cfx otherwise (arms with a parallel rod and some paint and
    seven-axis arms do, *by robot type, from memory*); take cfx from a taught point then.

    Raises:
        ConfigurationError: Not an ortho-parallel arm.
    """
    _, fold, ahead = require_opw(robot).posture(joints)
    axes = controller_axes(robot, joints)
    quarters = np.floor(axes[..., [0, 3, 5]] / _QUARTER)
    cfx = 4 * (ahead < 0.0) + 2 * (fold < 0.0) + (wrap(axes[..., 4]) < 0.0)
    out = np.concatenate([quarters, np.asarray(cfx)[..., None]], axis=-1)
    return out.astype(np.int64)


def fanuc_words(robot: RobotModel, joints: Array) -> IntArray:
    """Returns Fanuc's CONFIG as numbers (..., 6) of joints q (..., 6) rad.

    1 for F, U and T, 0 for N, D and B: N if J5 is negative, F else; U if the elbow is above the
    line from shoulder to wrist; T if the wrist point is in front of axis 1. Then the turns of J4,
    J5 and J6: 0 within +-180 deg, 1 for 180..540, -1 for -540..-180. N is the wrist bent down with
    J4 at zero (J5 = -90 deg, tool down, ``N U T``), as in Tesseract's ``robot_config.h``; some
    robot types print the turn of J1 in place of J5's.

    Raises:
        ConfigurationError: Not an ortho-parallel arm.
    """
    _, fold, ahead = require_opw(robot).posture(joints)
    axes = controller_axes(robot, joints)
    letters = [wrap(axes[..., 4]) >= 0.0, fold >= 0.0, ahead >= 0.0]
    turns = np.rint(axes[..., 3:] / _TURN)
    out = np.concatenate([np.stack([np.asarray(x) for x in letters], axis=-1), turns], axis=-1)
    return out.astype(np.int64)


def yaskawa_rconf(robot: RobotModel, joints: Array) -> IntArray:
    """Returns the first six fields of Yaskawa's RCONF (..., 6) of joints q (..., 6) rad.

    0 flip / 1 no flip; 0 upper / 1 lower elbow; 0 front / 1 rear; then 1 where the R, T and S axis
    is beyond +-180 deg. Flip: R within a quarter turn of zero or of a whole turn, *from memory*.

    Raises:
        ConfigurationError: Not an ortho-parallel arm.
    """
    _, fold, ahead = require_opw(robot).posture(joints)
    axes = controller_axes(robot, joints)
    no_flip = np.abs(wrap(axes[..., 3])) > _QUARTER
    beyond = [np.abs(axes[..., i]) > np.pi for i in (3, 5, 0)]
    fields = [no_flip, fold < 0.0, ahead < 0.0, *beyond]
    return np.stack([np.asarray(f) for f in fields], axis=-1).astype(np.int64)


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
    robot: RobotModel, maker: Maker, joints: Array, wanted: IntArray, *, near: Array | None = None
) -> tuple[Array, BoolArray]:
    """Returns joints (n, 6) rad on the turns stated by words, and whether the limits allow it.

    Of several turns that fit the nearest is taken. An axis nearer than ``EDGE`` to where its word
    changes fits both.

    Args:
        robot: The arm.
        maker: Whose words.
        joints: (n, 6) rad, any turn.
        wanted: (n, w).
        near: (6,) rad; zero of the controller's axes if not given.
    """
    out, good = np.array(joints), np.ones(len(joints), dtype=np.bool_)
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
            apart = np.abs(axis if near is None else q - near[i])
            better = allowed & (apart < best)
            out[better, i] = q[better]
            best[better] = apart[better]
        good &= np.isfinite(best)
    return out, good


def renew_words(maker: Maker, written: IntArray, before: IntArray, after: IntArray) -> IntArray:
    """Returns the words (n, w) to write, ``NO_WORD`` where what is written stays.

    A word is renewed only where the correction changes it: where a controller counts differently
    from this module, the program's own words stay.

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
    """True where axis values (n,) rad of the controller have the turn of a word (n,)."""
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
