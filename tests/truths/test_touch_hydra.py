"""Touches of a probe on the bolt holes of two arm flanges (Georgia Tech multi_robot_calibration).

The tool's own cloud of 20 holes is laid on the touched holes, block by block. The numbers were
found by an independent script; the last digits are its.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.registration.ambiguity import check_names, matches
from robotrue.cell.registration.fit import Noise, Registration, fit_points, point_residuals
from robotrue.cell.registration.touches import fit_touches
from robotrue.core.arrays import Array
from robotrue.core.poses import fit_rigid
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.probing_set import ProbingSet

pytestmark = pytest.mark.data

COLUMNS = ("MX Coord.", "MY Coord.", "MZ Coord.")
ARM_TO_ARM, FIRST, SECOND = (
    "robot_to_robot_091124.csv",
    "rob1_self_transform_092024.csv",
    "rob2_self_transform_092024.csv",
)


def read_touches(path: Path) -> tuple[tuple[str, ...], Array]:
    """Names (n) and points (n, 3) m of all touches, in the order of the file."""
    sheet = read_sheet(path)
    return sheet.words("Element Name"), sheet.numbers(COLUMNS) * MM


def touches_by_name(path: Path) -> list[Array]:
    """The touches (k, 3) m of each hole, in the order the holes were first touched."""
    names, points = read_touches(path)
    return [points[np.array(names) == name] for name in dict.fromkeys(names)]


def holes(data_dir: Path, file: str, block: int) -> tuple[Array, Array]:
    """The tool's holes and the touched ones (20, 3) m."""
    tool, touched = (
        np.array(
            [points.mean(axis=0) for points in touches_by_name(data_dir / "touch-hydra" / name)]
        )
        for name in ("tool_cloud.csv", file)
    )
    return tool, touched[20 * (block - 1) : 20 * block]


def robust_fit(tool: Array, touched: Array, *, noise: Noise) -> Registration:
    names = tuple(str(i + 1) for i in range(len(tool)))
    return fit_touches(ProbingSet(names=names, point=tool, position=touched), touched, noise=noise)


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
    fit = robust_fit(tool, touched, noise=Noise(touch=0.05 * MM, robot=0.15 * MM))
    assert fit.outliers == ("19", "20")
    np.testing.assert_allclose(fit.distances[18:] / MM, 2.018, atol=0.002)
    assert fit.rms / MM == pytest.approx(0.048, abs=6e-4)
    assert fit.distances[:18].max() < 0.11 * MM


def test_no_hole_of_the_other_blocks_is_accused(data_dir: Path) -> None:
    for file, block in ((ARM_TO_ARM, 2), (FIRST, 1), (FIRST, 2), (SECOND, 1), (SECOND, 2)):
        tool, touched = holes(data_dir, file, block)
        fit = robust_fit(tool, touched, noise=Noise(touch=0.05 * MM, robot=0.15 * MM))
        assert fit.outliers == (), (file, block)


def test_the_two_wrong_holes_were_shifted_together(data_dir: Path) -> None:
    """Both are off by one and the same vector: what moved was not a single touch."""
    tool, touched = holes(data_dir, ARM_TO_ARM, 1)
    fit = robust_fit(tool, touched, noise=Noise(touch=0.05 * MM, robot=0.15 * MM))
    np.testing.assert_allclose(fit.residuals[18] / MM, [1.380, 1.367, 0.544], atol=0.002)
    np.testing.assert_allclose(fit.residuals[19], fit.residuals[18], atol=0.01 * MM)


@pytest.mark.parametrize(
    ("file", "scatter_mm"),
    [
        (ARM_TO_ARM, (0.010, 0.018, 0.010)),
        (FIRST, (0.047, 0.040, 0.038)),
        (SECOND, (0.024, 0.033, 0.037)),
    ],
)
def test_scatter_of_repeated_touches(
    data_dir: Path, file: str, scatter_mm: tuple[float, float, float]
) -> None:
    """The printed ones are means of the holes' own sd; pooled, the few bad holes count for more."""
    touches = touches_by_name(data_dir / "touch-hydra" / file)
    assert len(touches) == 40
    assert min(map(len, touches)) >= 5
    each = np.array([points.std(axis=0, ddof=1) for points in touches])
    np.testing.assert_allclose(np.mean(each, axis=0) / MM, scatter_mm, atol=6e-4)
    spare = np.array([len(points) - 1 for points in touches])
    pooled = np.sqrt(spare @ each**2 / spare.sum())
    assert (pooled > 1.35 * np.mean(each, axis=0)).all()


def cubes(data_dir: Path) -> Array:
    """Bolt holes (arm, vertex, hole, 3) m of two flanges sent to the same eight vertices."""
    _, touched = read_touches(data_dir / "touch-hydra" / "cubes.csv")
    return touched.reshape(2, 8, 6, 3)


def test_two_arms_sent_to_the_same_vertices_end_millimetres_apart(data_dir: Path) -> None:
    vertex = cubes(data_dir).mean(axis=2)
    apart = np.linalg.norm(vertex[0] - vertex[1], axis=1) / MM
    expected = [3.749, 2.962, 1.966, 3.475, 4.026, 4.093, 3.081, 2.392]
    np.testing.assert_allclose(apart, expected, atol=6e-4)
    edges = np.linalg.norm(np.diff(vertex[0, :4], axis=0), axis=1) / MM
    np.testing.assert_allclose(edges, [200.21, 200.28, 200.60], atol=6e-3)


def test_one_bolt_pattern_is_found_again_and_the_other_is_another_one(data_dir: Path) -> None:
    """Six holes of arm 1 fit each other; those of arm 2 fit them in no order: another pattern."""
    holes_of = cubes(data_dir)
    pattern, tight = holes_of[0, 0], 0.05 * MM
    for vertex in range(1, 8):
        fit = fit_points(pattern, holes_of[0, vertex])
        assert 0.005 < fit.rms / MM < 0.014
        assert check_names(pattern, holes_of[0, vertex], tolerance=tight) == ()
    for vertex in range(8):
        assert 0.269 <= fit_points(pattern, holes_of[1, vertex]).rms / MM <= 0.300
        assert matches(pattern, holes_of[1, vertex], tolerance=tight) == ()
        own = fit_points(holes_of[1, 0], holes_of[1, vertex])
        assert own.rms / MM < 0.075


def test_a_hexagon_fits_twelve_ways_where_the_tolerance_is_wide(data_dir: Path) -> None:
    """What tells its holes apart is a hole placed some tenths off: a loose tolerance hides it."""
    first, second = cubes(data_dir)[0, :2]
    (doubt,) = check_names(first, second, tolerance=0.6 * MM)
    assert doubt.startswith("The pattern fits 12 ways within 0.60 mm")
    with pytest.raises(ImplausibleDataError, match=r"if names are exchanged \(1 is 2, 2 is 3"):
        check_names(first, second[[5, 0, 1, 2, 3, 4]], tolerance=0.05 * MM)
