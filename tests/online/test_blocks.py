"""Blocks hold samples as they came; an estimate without standing holds no numbers."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.errors import ShapeError
from robotrue.online.blocks import force_block, joint_block
from robotrue.online.estimates import Doubt, EstimateBlock
from robotrue.online.samples import Flag, ForceSample, JointSample, unknown_pose


def joints(k: int, dof: int = 6) -> JointSample:
    return JointSample(
        controller_time=k * 4e-3, host_time=1.0 + k, joints=np.full(dof, 0.1 * k),
        T_frame_tool=unknown_pose(), sequence=k,
    )  # fmt: skip


def force(k: int, frame: str = "sensor", fx: float = 1.0) -> ForceSample:
    return ForceSample(
        controller_time=k * 1e-3, host_time=1.0 + k, wrench=np.array([fx, 0, 0, 0, 0, 0]),
        frame=frame, sequence=k, status=3,
    )  # fmt: skip


def test_joints() -> None:
    block = joint_block([joints(1), joints(2)])
    np.testing.assert_array_equal(block.joints[:, 0], [0.1, 0.2])
    np.testing.assert_array_equal(block.sequence, [1, 2])
    assert len(block) == 2
    assert block.valid.all()
    with pytest.raises(ShapeError, match="different numbers of joints"):
        joint_block([joints(1), joints(2, dof=7)])
    with pytest.raises(ShapeError, match="no samples"):
        joint_block([])


def test_force_keeps_flags_and_frame() -> None:
    block = force_block([force(1), force(2, fx=np.nan)])
    np.testing.assert_array_equal(block.valid, [True, False])
    assert Flag(int(block.flags[1])) is Flag.NOT_FINITE
    np.testing.assert_array_equal(block.status, [3, 3])
    with pytest.raises(ShapeError, match="different frames"):
        force_block([force(1), force(2, frame="tool")])
    with pytest.raises(ValueError, match="read-only"):
        block.wrench[0, 0] = 7.0


def test_an_invalid_estimate_holds_no_number() -> None:
    def block(error: list[float], doubt: Doubt) -> EstimateBlock:
        return EstimateBlock(
            host_time=np.zeros(1), error=np.array([error]), sd=np.array([error]),
            static=np.zeros((1, 3)), wrench=np.zeros((1, 6)), joints=np.zeros((1, 6)),
            sequence=np.zeros(1), doubt=np.array([int(doubt)]),
        )  # fmt: skip

    assert block([1e-6, 0, 0], Doubt.EXTRAPOLATED).valid.all()
    assert not block([np.nan] * 3, Doubt.SETTLING).valid.any()
    with pytest.raises(ShapeError, match="NaN where it is invalid"):
        block([1e-6, 0, 0], Doubt.BAD_FORCE)
    with pytest.raises(ShapeError, match="NaN where it is invalid"):
        block([np.nan] * 3, Doubt.NONE)
