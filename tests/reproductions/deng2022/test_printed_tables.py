"""Printed figures of Deng et al. 2022 (JME 58(14), doi 10.3901/JME.2022.14.170), Tables 4 and 8."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.deng2022.readings import SIMILARITY_READINGS
from robotrue_reproductions.deng2022.arm_experiment import arm_results
from robotrue_reproductions.deng2022.similarity_table import (
    FOUND,
    TABLE_4,
    layout_similarity,
    table_4_cell,
)


@pytest.fixture(scope="module")
def found():
    cell = table_4_cell()
    return {kind: layout_similarity(cell, layout) for kind, layout in FOUND.items()}


def test_the_recommended_reading_reaches_table_4(found):
    # Layout and points are not printed: these were found by a search, so this shows only that the
    # reading can reach the table.
    for kind, allowed in (("cylinder", 0.003), ("cube", 0.0065)):
        away = np.abs(found[kind]["per-point"] - TABLE_4[kind]).max()
        assert away < allowed


def test_similarity_falls_with_distance_and_the_cylinder_beats_the_cube(found):
    cylinder, cube = found["cylinder"]["per-point"], found["cube"]["per-point"]
    assert (np.diff(cylinder) < 0.0).all()
    assert (np.diff(cube) < 0.0).all()
    assert (cylinder > cube).all()


def test_the_literal_coordinates_fall_with_the_square_of_the_distance(found):
    # cos of the angle between turned points: 1 - P as 1 : 4 : 9, which Table 4 (1 : 2.5 : 2.7) is
    # not. Equal for every arm.
    lost = 1.0 - found["cylinder"]["coordinates"]
    np.testing.assert_allclose(lost / lost[0], [1.0, 4.0, 9.0], rtol=0.05)
    printed = 1.0 - np.array(TABLE_4["cylinder"])
    assert printed[2] / printed[0] < 3.0


def test_every_reading_gives_a_cosine(found):
    for values in found.values():
        assert set(values) == set(SIMILARITY_READINGS)
        assert all((np.abs(v) <= 1.0).all() for v in values.values())


@pytest.fixture(scope="module")
def arm():
    return arm_results("S2A", 1, quick=True)


def test_tr_gpr_with_206_poses_comes_to_the_printed_size(arm):
    # Table 8 prints 0.182 mm for one arm; a prototype of this scenario had 0.151 (median of 24).
    mean, largest, _ = arm.accuracy["Tr-GPR"] * 1e3
    assert 0.12 < mean < 0.19
    assert largest < 0.454
    assert arm.accuracy["GPR-378"][0] < arm.accuracy["Tr-GPR"][0]


def test_gpr_50_is_not_the_printed_one_unless_its_kernel_is_never_learned(arm):
    assert arm.accuracy["GPR-50"][0] < 0.3 * 0.658e-3
    fixed = arm.accuracy["GPR-50, zero mean, fixed 100 mm"]
    assert fixed[0] > 2.0 * arm.accuracy["GPR-50"][0]
    assert fixed[2] > 2.0 * 0.149e-3


def test_the_compensated_hole_is_nearer_to_its_place(arm):
    assert arm.dry["after"][0] < 0.2 * arm.dry["before"][0]
    assert arm.hole["after"][2] < arm.hole["before"][2]
