"""Monuments show how the tracker's frame moves; repeated shots show how far one shot scatters."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ShapeError
from robotrue.measurement.formats.mapping import build_mapping
from robotrue.measurement.formats.measured_files import open_sheet, read_measurements
from robotrue.measurement.formats.table import read_run
from robotrue.measurement.frame_walk import MonumentShots, estimate_walk, remove_walk
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.repeated_poses import average_repeats

NESTS = {
    "M1": (2.0, 1.0, 0.0),
    "M2": (-1.0, 2.0, 0.1),
    "M3": (0.5, -2.0, 0.4),
    "M4": (1.0, 0.0, 1.5),
}
SIGMA = 5.0 * UM
ROWS = 40


def run_that_drifts(seed: int) -> tuple[MeasurementSet, MonumentShots, Array, Array]:
    """Rows, shots every fifth row, moments of the rows, and true points (n, 3) m."""
    rng = np.random.default_rng(seed)
    shift = np.cumsum(rng.normal(0.0, 8.0 * UM, (ROWS, 3)), axis=0)
    turn = np.cumsum(rng.normal(0.0, 3e-6, (ROWS, 3)), axis=0)
    shift, turn = shift - shift[0], turn - turn[0]

    def see(point: Array, at: int) -> Array:
        moved = matrix_from_rotation_vector(turn[at]) @ point + shift[at]
        return moved + rng.normal(0.0, SIGMA, 3)

    true = rng.uniform(-1.5, 1.5, (ROWS, 3))
    noise = np.tile(SIGMA**2 * np.eye(3), (ROWS, 1, 1))
    seen = MeasurementSet(
        joints=rng.uniform(-1, 1, (ROWS, 6)),
        position=np.stack([see(point, at) for at, point in enumerate(true)]),
        covariance=noise,
    )
    when = [(name, at) for at in range(0, ROWS, 5) for name in NESTS]
    shots = MonumentShots(
        nest=tuple(name for name, _ in when),
        position=np.stack([see(np.array(NESTS[name]), at) for name, at in when]),
        covariance=np.tile(SIGMA**2 * np.eye(3), (len(when), 1, 1)),
        moment=np.array([float(at) for _, at in when]),
    )
    return seen, shots, np.arange(ROWS, dtype=np.float64), true


def test_the_walk_is_taken_off_and_its_width_is_honest() -> None:
    before, after, inside = [], [], []
    for seed in range(4):
        seen, shots, moment, true = run_that_drifts(seed)
        moved, _ = remove_walk(seen, shots, moment)
        gap = moved.position - true
        before.append(np.linalg.norm(seen.position - true, axis=1)[20:].mean())
        after.append(np.linalg.norm(gap, axis=1)[20:].mean())
        squares = np.einsum("ni,nij,nj->n", gap, np.linalg.inv(moved.covariance), gap)
        inside.append(squares < 7.815)  # 95 % of chi-squared with 3 degrees of freedom
    assert np.mean(after) < 0.5 * np.mean(before)
    assert np.mean(after) < 27.0 * UM
    assert 0.90 < np.mean(inside) <= 1.0


def test_a_frame_at_rest_stays_where_it_is() -> None:
    _, shots, moment, _ = run_that_drifts(1)
    rng = np.random.default_rng(2)
    places = np.array([NESTS[name] for name in shots.nest])
    still = replace(shots, position=places + rng.normal(0.0, SIGMA, places.shape))
    walk = estimate_walk(still, moment)
    assert np.abs(walk.mean[:, :3]).max() < 5.0 * UM
    assert np.sqrt(walk.covariance[:, 0, 0]).max() < 5.0 * UM


def test_two_nests_show_a_shift_and_one_shot_shows_nothing() -> None:
    seen, shots, moment, _ = run_that_drifts(3)
    pair = shots.take(np.isin(np.array(shots.nest), ["M1", "M2"]))
    walk = estimate_walk(pair, moment)
    assert (walk.nests, walk.turn_step) == (2, 0.0)
    assert not walk.mean[:, 3:].any()
    with pytest.raises(ShapeError, match="4 shots of 4 nests, none of them shot twice"):
        remove_walk(seen, shots.take(slice(0, 4)), moment)


FILE = """Name,A1,A2,X,Y,Z
M1,,,0,0,0
M2,,,1000,0,0
M3,,,0,1000,0
P1,1,2,500,500,100
P1,1,2,500.004,500,100
M1,,,0.1,0,0
M2,,,1000.1,0,0
M3,,,0.1,1000,0
P2,3,4,500.1,200,100
"""


def test_rows_of_monuments_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(FILE)
    stated = {"name": "run", "joints": ["A1", "A2"], "position": ["X", "Y", "Z"]}
    stated |= {"point_name": "Name", "monuments": "M*", "repeats": "mean"}
    sheet, mapping = open_sheet(path, build_mapping(stated))
    run = read_run(sheet, mapping)
    assert run.rows.source_row.tolist() == [5, 10]
    np.testing.assert_allclose(run.rows.position[1] / MM, [500.0, 200.0, 100.0], atol=0.012)
    assert run.remarks[0].startswith("monuments: 6 shots of 3 nests; the frame moved up to 1")
    assert run.remarks[1].startswith("1 pose was shot 2 times: one shot scatters by 7.3 um")


def test_monuments_in_the_canonical_columns(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    text = FILE.replace("Name,A1,A2,X,Y,Z", "monument,j1_deg,j2_deg,x_mm,y_mm,z_mm")
    path.write_text(text.replace("P1", "").replace("P2", ""))
    rows = read_measurements(path)
    assert len(rows) == 3
    np.testing.assert_allclose(rows.position[2] / MM, [500.0, 200.0, 100.0], atol=0.012)


def test_the_mean_of_repeated_shots_and_their_scatter() -> None:
    rng = np.random.default_rng(5)
    joints = np.repeat(rng.uniform(-90, 90, (40, 6)) * DEG, 3, axis=0)
    place = np.repeat(rng.uniform(-1, 1, (40, 3)), 3, axis=0)
    order = rng.permutation(120)
    rows = MeasurementSet(
        joints=joints[order],
        position=(place + rng.normal(0.0, 20.0 * UM, place.shape))[order],
        covariance=np.tile((10.0 * UM) ** 2 * np.eye(3), (120, 1, 1)),
    )
    poses = average_repeats(rows)
    assert (len(poses.mean), poses.freedom, set(poses.shots)) == (40, 80, {3})
    assert poses.scatter == pytest.approx(20.0 * UM, rel=0.15)
    assert poses.repeatability == pytest.approx(np.sqrt(300.0) * UM, rel=0.2)
    np.testing.assert_allclose(poses.mean.covariance[0], (100.0 / 3.0) * UM**2 * np.eye(3))
    alone = average_repeats(rows.subset(np.arange(1)))
    assert (alone.freedom, len(alone.mean)) == (0, 1)
