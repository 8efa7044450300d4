"""What became of a target, and why."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """One per target. Everything but ``COMPENSATED`` keeps the bytes that stood there."""

    COMPENSATED = 0
    UNCHANGED_NO_ERROR = 1  # the model predicts an error below what any controller resolves
    UNCHANGED_SOURCE = 2  # the reader could not make a pose of it: expression, unknown frame, ...
    UNCHANGED_AXIS_TARGET = 3  # compensated on request only
    UNCHANGED_UNREACHABLE = 4
    UNCHANGED_JOINT_LIMIT = 5
    UNCHANGED_SINGULAR = 6
    UNCHANGED_WRIST_SINGULAR = 7
    UNCHANGED_BRANCH_JUMP = 8  # a straight move that would need another arm configuration
    UNCHANGED_STEP = 9  # the correction is larger than allowed
    UNCHANGED_NOT_CONVERGED = 10
    UNCHANGED_CONFIGURATION = 11  # nothing says how the arm stands, and it matters

    @property
    def explanation(self) -> str:
        """One clause for reports: why the target is as it is."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    Status.COMPENSATED: "compensated",
    Status.UNCHANGED_NO_ERROR: "no error predicted",
    Status.UNCHANGED_SOURCE: "its pose cannot be read from the program",
    Status.UNCHANGED_AXIS_TARGET: "an axis target; compensated on request only",
    Status.UNCHANGED_UNREACHABLE: "out of the robot's reach",
    Status.UNCHANGED_JOINT_LIMIT: "beyond a joint limit",
    Status.UNCHANGED_SINGULAR: "too near a singularity",
    Status.UNCHANGED_WRIST_SINGULAR: "wrist stretched: axes 4 and 6 in line",
    Status.UNCHANGED_BRANCH_JUMP: "needs another arm configuration than the target before it",
    Status.UNCHANGED_STEP: "the correction is larger than allowed",
    Status.UNCHANGED_NOT_CONVERGED: "the inversion did not reach its tolerance",
    Status.UNCHANGED_CONFIGURATION: "nothing says which configuration the arm takes, and another "
    "one inside the joint limits has another error; state where it begins with [controller] "
    "start_deg in the cell, or --start A1,..,A6",
}


class Route(IntEnum):
    """How a target is treated by the solvers."""

    SKIP = 0  # nothing is known of it
    LINEAR = 1  # pose; the arm must keep its configuration on the way
    FREE = 2  # pose after a joint move: the nearest solution
    GIVEN = 3  # pose whose nominal joints are already chosen
    PASS = 4  # axis target, left as it is, but the arm goes there
    AXES = 5  # axis target to be compensated
