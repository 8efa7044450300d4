"""Touches of a probe on the bolt holes of two arm flanges (Georgia Tech multi_robot_calibration).

The tool's own cloud of 20 holes is laid on the touched holes, block by block. The numbers were
found by an independent script; the last digits are its.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.registration.fit import Noise, point_residuals
from robotrue.cell.registration.points import fit_points
from robotrue.cell.registration.robust import fit_points_robust
from robotrue.cell.registration.touch_file import TouchColumns, mean_touches, read_touches
from robotrue.core.arrays import Array
from robotrue.core.poses import fit_rigid
from robotrue.core.units import MM

pytestmark = pytest.mark.data

COLUMNS = TouchColumns(
    name="Element Name", position=("MX Coord.", "MY Coord.", "MZ Coord."), unit=MM
)
ARM_TO_ARM, FIRST, SECOND = (
    "robot_to_robot_091124.csv",
    "rob1_self_transform_092024.csv",
    "rob2_self_transform_092024.csv",
)


def holes(data_dir: Path, file: str, block: int) -> tuple[Array, Array]:
    """The tool's holes and the touched ones (20, 3) m."""
    tool, touched = (
        mean_touches(read_touches(data_dir / "touch-hydra" / name, COLUMNS)).position
        for name in ("tool_cloud.csv", file)
    )
    return tool, touched[20 * (block - 1) : 20 * block]


@pytest.mark.parametrize(
    ("file", "block", "rms_mm", "worst_mm", "point", "others_mm", "others_p95_mm"),
    [
        (ARM_TO_ARM, 1, 0.603, 1.818, 19, 0.733, 2.009),
        (ARM_TO_ARM, 2, 0.069, 0.120, 15, 0.084, 0.139),
        (FIRST, 1, 0.038, 0.095, 1, 0.047, 0.095),
        (FIRST, 2, 0.159, 0.329, 19, 0.200, 0.370),
        (SECOND, 1, 0.280, 0.469, 13, 0.331, 0.508),
        (SECOND, 2, 0.060, 0.129, 3, 0.073, 0.131),
    ],
)
def test_all_holes_and_six_for_the_other_fourteen(
    data_dir: Path,
    file: str,
    block: int,
    rms_mm: float,
    worst_mm: float,
    point: int,
    others_mm: float,
    others_p95_mm: float,
) -> None:
    tool, touched = holes(data_dir, file, block)
    fit = fit_points(tool, touched)
    assert fit.rms / MM == pytest.approx(rms_mm, abs=6e-4)
    assert fit.distances.max() / MM == pytest.approx(worst_mm, abs=6e-4)
    assert int(np.argmax(fit.distances)) + 1 == point
    rng = np.random.default_rng(0)
    left = []
    for _ in range(200):
        order = rng.permutation(20)
        six, rest = order[:6], order[6:]
        T = fit_rigid(tool[six], touched[six])
        left.append(np.linalg.norm(point_residuals(T, tool[rest], touched[rest]), axis=1) / MM)
    assert np.sqrt(np.mean(np.square(left))) == pytest.approx(others_mm, abs=6e-4)
    assert np.percentile(left, 95) == pytest.approx(others_p95_mm, abs=6e-4)


def test_the_wrong_holes_of_the_first_block_are_named(data_dir: Path) -> None:
    """Hole 19 is the worst of the plain fit; without it hole 20 is as wrong: both 2.02 mm off."""
    tool, touched = holes(data_dir, ARM_TO_ARM, 1)
    fit = fit_points_robust(tool, touched, noise=Noise(touch=0.05 * MM, robot=0.15 * MM))
    assert fit.outliers == ("19", "20")
    np.testing.assert_allclose(fit.distances[18:] / MM, 2.018, atol=0.002)
    assert fit.rms / MM == pytest.approx(0.048, abs=6e-4)
    assert fit.distances[:18].max() < 0.11 * MM


def test_no_hole_of_the_other_blocks_is_accused(data_dir: Path) -> None:
    for file, block in ((ARM_TO_ARM, 2), (FIRST, 1), (FIRST, 2), (SECOND, 1), (SECOND, 2)):
        tool, touched = holes(data_dir, file, block)
        fit = fit_points_robust(tool, touched, noise=Noise(touch=0.05 * MM, robot=0.15 * MM))
        assert fit.outliers == (), (file, block)


def test_the_two_wrong_holes_were_shifted_together(data_dir: Path) -> None:
    """Both are off by one and the same vector: what moved was not a single touch."""
    tool, touched = holes(data_dir, ARM_TO_ARM, 1)
    fit = fit_points_robust(tool, touched, noise=Noise(touch=0.05 * MM, robot=0.15 * MM))
    np.testing.assert_allclose(fit.residuals[18] / MM, [1.380, 1.367, 0.544], atol=0.002)
    np.testing.assert_allclose(fit.residuals[19], fit.residuals[18], atol=0.01 * MM)
