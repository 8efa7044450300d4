"""State of the arm between two targets, which determines the next target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, IntArray

KNOWN: Final = 0
GUESSED: Final = 1
PARTED: Final = 2
"""Whether the configuration of a target is known, a guess, or a guess that matters."""

STATE_DTYPE: Final = np.dtype(
    [
        ("near", np.float64, (6,)),
        ("joints", np.float64, (6,)),
        ("sign", np.float64, (6,)),
        ("shoulder", np.int64),
        ("elbow", np.int64),
        ("flip", np.int64),
        ("reached", np.int64),
        ("begun", np.int64),
        ("configuration", np.int64),
        ("words", np.int64, (3,)),
    ]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmState:
    """The arm between two targets. The solvers change the record in place.

    Attributes:
        record: (1,) with the fields
            ``near`` (6,) rad, the joints chosen last;
            ``joints`` (6,) rad, the joints driven to last;
            ``sign`` (6,) of the last motion of every joint, 0 unknown;
            ``shoulder``, ``elbow``, ``flip`` +1 or -1, the branch of the closed form, 0 unknown;
            ``reached`` 1 once the arm has been at a target;
            ``begun`` 1 once there was a target, reached or not;
            ``configuration`` ``KNOWN``, ``GUESSED`` or ``PARTED``;
            ``words`` (3,) of the last target that names its branch, see ``Plan.words``.
    """

    record: np.ndarray[tuple[int], np.dtype[np.void]]

    def copy(self) -> ArmState:
        """Returns an independent copy."""
        return ArmState(record=self.record.copy())

    def equals(self, other: ArmState) -> bool:
        """Returns whether both are equal bit for bit."""
        return self.record.tobytes() == other.record.tobytes()

    @property
    def words(self) -> IntArray:
        """(3,) the words of the record, to be changed in place."""
        words: IntArray = self.record["words"][0]
        return words

    def get(self, name: str) -> int:
        """Returns the present value of a field that is one number."""
        return int(self.record[name][0])

    def set(self, name: str, value: object) -> None:
        """Changes a field."""
        self.record[name][0] = value


def state_at(home: Array, *, stated: bool) -> ArmState:
    """Returns the arm before the first target of a program.

    Args:
        home: (6,) rad, its joints.
        stated: Whether the user or the program states it; it is a guess otherwise.
    """
    record = np.zeros(1, STATE_DTYPE)
    record["near"], record["joints"] = home, home
    record["configuration"] = KNOWN if stated else GUESSED
    record["words"] = NO_WORD
    return ArmState(record=record)
