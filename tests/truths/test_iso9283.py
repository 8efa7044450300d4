"""ISO 9283 characteristics against a worked example, computed by hand from the definitions.

Commanded (1000, 0, 500) mm. Four cycles at (1000.3, 0.1, 500), (1000.1, -0.1, 500),
(1000.2, 0.1, 500), (1000.2, -0.1, 500) mm. Barycentre (1000.2, 0, 500): AP_p = 0.2 mm.
l = sqrt(0.02), sqrt(0.02), 0.1, 0.1 mm; l_bar = 0.120710678 mm;
S_l = sqrt(4 * 0.020710678^2 / 3) = 0.023914631 mm; RP_l = l_bar + 3 S_l = 0.192454571 mm.
"""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.errors import ShapeError
from robotrue.validation.iso9283 import path_characteristics, pose_characteristics

COMMANDED = np.array([1000.0, 0.0, 500.0]) * MM
CYCLES = (
    np.array([[1000.3, 0.1, 500], [1000.1, -0.1, 500], [1000.2, 0.1, 500], [1000.2, -0.1, 500]])
    * MM
)


def test_pose_accuracy_and_repeatability_of_the_worked_example():
    result = pose_characteristics(COMMANDED, CYCLES)
    assert result.n == 4
    assert result.AP_p / MM == pytest.approx(0.2, abs=1e-9)
    assert result.AP_xyz / MM == pytest.approx([0.2, 0.0, 0.0], abs=1e-9)
    assert result.barycentre / MM == pytest.approx([1000.2, 0.0, 500.0], abs=1e-9)
    assert result.RP_l / MM == pytest.approx(0.192454571, abs=1e-8)
    assert np.isnan(result.AP_abc).all()


def test_angles_of_the_worked_example_across_half_a_turn():
    # Differences to the command: a +1, +3 deg (179 -> -179 is +2); b 0.1, -0.1; c 0, 0.
    result = pose_characteristics(
        COMMANDED,
        CYCLES[:2],
        commanded_abc=np.array([178.0, 10.0, 0.0]) * DEG,
        attained_abc=np.array([[179.0, 10.1, 0.0], [-179.0, 9.9, 0.0]]) * DEG,
    )
    assert result.AP_abc / DEG == pytest.approx([2.0, 0.0, 0.0], abs=1e-9)
    # S of (1, 3) is sqrt 2, of (0.1, -0.1) is 0.1 sqrt 2.
    assert result.RP_abc / DEG == pytest.approx([3 * 2**0.5, 0.3 * 2**0.5, 0.0], abs=1e-9)


def test_path_takes_the_worst_station_of_each():
    # Station 0: both cycles 0.3 mm off the same way: AT 0.3, no spread.
    # Station 1: at +0.2 and -0.2 mm: barycentre on the command, l = 0.2, 0.2, S = 0: RT 0.2.
    stations = np.array([[0.0, 0, 0], [100.0, 0, 0]]) * MM
    cycles = np.array([[[0, 0.3, 0], [100, 0.2, 0]], [[0, 0.3, 0], [100, -0.2, 0]]]) * MM
    result = path_characteristics(stations, cycles)
    assert (result.AT_p / MM, result.AT_station) == (pytest.approx(0.3), 0)
    assert (result.RT_p / MM, result.RT_station) == (pytest.approx(0.2), 1)
    assert result.RT_p_at / MM == pytest.approx([0.0, 0.2], abs=1e-9)


def test_one_cycle_has_no_repeatability():
    with pytest.raises(ShapeError, match="needs at least 2"):
        pose_characteristics(COMMANDED, CYCLES[:1])
    with pytest.raises(ShapeError, match="one is missing"):
        pose_characteristics(COMMANDED, CYCLES, commanded_abc=np.zeros(3))
