"""What became of a target, and why."""

from __future__ import annotations

from enum import IntEnum

from robotrue.core.explained import Explained


class Status(Explained):
    """One per target. Everything but ``COMPENSATED`` keeps the bytes that stood there."""

    COMPENSATED = 0, "compensated"
    UNCHANGED_NO_ERROR = 1, "no error predicted"
    UNCHANGED_SOURCE = 2, "its pose cannot be read from the program"
    UNCHANGED_AXIS_TARGET = 3, "an axis target; compensated on request only"
    UNCHANGED_UNREACHABLE = 4, "out of the robot's reach"
    UNCHANGED_JOINT_LIMIT = 5, "beyond a joint limit"
    UNCHANGED_SINGULAR = 6, "too near a singularity"
    UNCHANGED_WRIST_SINGULAR = 7, "wrist stretched: axes 4 and 6 in line"
    UNCHANGED_BRANCH_JUMP = 8, "needs another arm configuration than the target before it"
    UNCHANGED_STEP = 9, "the correction is larger than allowed"
    UNCHANGED_NOT_CONVERGED = 10, "the inversion did not reach its tolerance"
    UNCHANGED_CONFIGURATION = (
        11,
        "nothing says which configuration the arm takes, and another one inside the "
        "joint limits has another error; state where it begins with [controller] "
        "start_deg in the cell, or --start A1,..,A6",
    )


class Route(IntEnum):
    """How a target is treated by the solvers."""

    SKIP = 0  # nothing is known of it
    LINEAR = 1  # pose; the arm must keep its configuration on the way
    FREE = 2  # pose after a joint move: the nearest solution
    GIVEN = 3  # pose whose nominal joints are already chosen
    PASS = 4  # axis target, left as it is, but the arm goes there
    AXES = 5  # axis target to be compensated
