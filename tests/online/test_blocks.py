"""Blocks hold samples as they came; an invalid estimate holds no numbers."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.errors import ShapeError
from robotrue.online.blocks import Flag, ForceBlock, check_wrenches
from robotrue.online.estimates import Doubt, EstimateBlock


def test_force_keeps_flags_and_is_frozen() -> None:
    wrench = np.array([[1.0, 0, 0, 0, 0, 0], [np.inf, 0, 0, 0, 0, 0]])
    wrench, flags = check_wrenches(wrench, np.zeros(2, dtype=np.int64))
    block = ForceBlock(
        controller_time=np.zeros(2), host_time=np.zeros(2), wrench=wrench, frame="sensor",
        sequence=np.array([1, 2]), status=np.array([3, 3]), flags=flags,
    )  # fmt: skip
    np.testing.assert_array_equal(block.valid, [True, False])
    assert Flag(int(block.flags[1])) is Flag.NOT_FINITE
    np.testing.assert_array_equal(block.status, [3, 3])
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
