"""What share of windows a right band holds: known where windows are alone or all alike."""

import numpy as np
import pytest

from robotrue.dynamics.deviation_validation import join_shares, share_by_chance


def test_windows_of_their_own_are_a_binomial():
    found = share_by_chance(np.diag(np.linspace(1.0, 4.0, 100) ** 2))
    assert found.shares.mean() == pytest.approx(0.95, abs=0.003)
    assert found.effective == pytest.approx(100.0, rel=0.15)
    low, high = found.range
    assert (low, high) == (pytest.approx(0.90, abs=0.011), pytest.approx(0.99, abs=0.011))


def test_windows_that_are_all_alike_are_one():
    found = share_by_chance(4.0 * np.ones((50, 50)) + 1e-9 * np.eye(50))
    assert found.effective == pytest.approx(1.0, rel=0.05)
    assert found.below(0.88) == pytest.approx(0.05, abs=0.02)


def test_blocks_of_ten_count_as_blocks():
    blocks = np.kron(np.eye(10), np.ones((10, 10))) + 1e-9 * np.eye(100)
    one = share_by_chance(blocks)
    assert one.effective == pytest.approx(10.0, rel=0.15)
    both = join_shares([one, one], [100, 100])
    assert both.effective == pytest.approx(20.0, rel=0.15)
