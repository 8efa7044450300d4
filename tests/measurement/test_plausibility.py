"""Data that cannot be what it claims: each diagnosis, and that honest data pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.plausibility import check_plausible

REACH = 1.8
LENGTHS = np.array([0.8, 0.7, 0.3])


def arm(joints: Array) -> Array:
    """Returns (n, 3) m: a turning column with three links in its plane."""
    pitch = np.cumsum(joints[:, 1:4], axis=1)
    out = np.cos(pitch) @ LENGTHS
    up = np.sin(pitch) @ LENGTHS
    return np.stack([np.cos(joints[:, 0]) * out, np.sin(joints[:, 0]) * out, up], axis=1)


def honest(n: int = 60, **changes: object) -> MeasurementSet:
    rng = np.random.default_rng(7)
    joints = rng.uniform(-1.0, 1.0, (n, 6))
    fields = {
        "joints": joints,
        "position": arm(joints) + rng.normal(size=(n, 3)) * 1e-3,
        "covariance": np.tile(np.eye(3) * 1e-10, (n, 1, 1)),
        "sources": ("grid.csv sha256:ab",),
    }
    return MeasurementSet(**(fields | changes))


def check(m: MeasurementSet, forward: Callable[[Array], Array] = arm) -> tuple[str, ...]:
    return check_plausible(m, forward(m.joints), REACH, forward=forward)


def complaint(m: MeasurementSet, forward: Callable[[Array], Array] = arm) -> str:
    with pytest.raises(ImplausibleDataError) as caught:
        check(m, forward)
    return str(caught.value)


@pytest.mark.parametrize("frame", ["base", "tracker"])
def test_honest_data_pass(frame: str) -> None:
    assert check(honest(frame=frame)) == ()


def test_a_base_that_is_a_little_off_passes() -> None:
    m = honest()
    assert check(replace(m, position=m.position + np.array([0.05, -0.03, 0.1]))) == ()


def test_any_tracker_frame_passes() -> None:
    m = honest(frame="tracker")
    turned = m.position[:, [1, 2, 0]] * [1.0, -1.0, -1.0] + [3.0, -2.0, 5.0]
    assert check(replace(m, position=turned)) == ()


@pytest.mark.parametrize("frame", ["base", "tracker"])
@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1000.0, "millimetres were read as metres"),
        (1e-3, "metres were read as millimetres"),
        (1e6, "micrometres were read as metres"),
        (1 / 25.4, "inches were read as millimetres"),
    ],
)
def test_wrong_unit_of_length(frame: str, factor: float, words: str) -> None:
    m = honest(frame=frame)
    found = complaint(replace(m, position=m.position * factor))
    assert found.startswith("grid.csv: distances between points are ")
    assert f"times those of the commanded poses: {words}." in found


def test_the_evidence_is_a_number() -> None:
    exact = honest()
    exact = replace(exact, position=arm(exact.joints) * 1000.2)
    assert complaint(exact) == (
        "grid.csv: distances between points are 1000.2 times those of the commanded poses: "
        "millimetres were read as metres. "
        "Try: state the unit of the position columns (millimetres)."
    )


@pytest.mark.parametrize("frame", ["base", "tracker"])
@pytest.mark.parametrize(
    ("factor", "words"),
    [(DEG, "radians were read as degrees"), (1 / DEG, "degrees were read as radians")],
)
def test_wrong_unit_of_angle(frame: str, factor: float, words: str) -> None:
    m = honest(frame=frame)
    assert words in complaint(replace(m, joints=m.joints * factor))


def test_mirrored_axis() -> None:
    m = honest()
    found = complaint(replace(m, position=m.position * [1.0, -1.0, 1.0]))
    assert "mirrored or exchanged axes" in found
    assert found.endswith("Try: read the position columns as x, -y, z.")
    m = replace(m, frame="tracker", position=m.position * [1.0, -1.0, 1.0])
    assert "the frame is left-handed" in complaint(m)


@pytest.mark.parametrize(
    ("order", "words"), [([1, 0, 2], "y, x, z"), ([1, 2, 0], "z, x, y"), ([2, 1, 0], "z, y, x")]
)
def test_permuted_axes(order: list[int], words: str) -> None:
    m = honest()
    assert f"columns as {words}." in complaint(replace(m, position=m.position[:, order]))


def test_upside_down() -> None:
    m = honest()
    found = complaint(replace(m, position=m.position * [1.0, -1.0, -1.0]))
    assert "the positions are not in the robot base" in found
    assert "once the frame is upside down" in found
    assert '[tracker] frame = "unknown"' in found


def test_shifted_frame() -> None:
    m = honest()
    found = complaint(replace(m, position=m.position + np.array([0.3, 0.4, 0.0])))
    assert "and 1.613 mm once the frame is moved by 499.5 mm." in found


def test_each_station_has_its_own_frame() -> None:
    m = honest(frame="tracker", station=np.repeat([0, 1, 2], [30, 27, 3]))
    second = np.repeat([False, True], 30)
    position = np.where(second[:, None], -m.position[:, [1, 0, 2]] * [1, 1, 1] + 4.0, m.position)
    turned = np.where(second[:, None], m.position[:, [1, 2, 0]] + 4.0, m.position)
    assert check(replace(m, position=turned)) == ()
    assert "left-handed" in complaint(replace(m, position=position * [1, 1, -1]))


def test_files_of_two_set_ups_without_a_station_column() -> None:
    m = honest(
        frame="tracker",
        group=np.repeat([0, 1], 30),
        group_names=("a", "b"),
        sources=("a.csv sha256:1", "b.csv sha256:2"),
    )
    second = np.repeat([False, True], 30)
    turned = np.where(second[:, None], m.position[:, [1, 2, 0]] + 4.0, m.position)
    found = complaint(replace(m, position=turned))
    assert found.startswith("a.csv, b.csv: measured and commanded positions differ")
    assert found.endswith("Try: number the tracker set-ups in a station column.")


def test_wrong_robot() -> None:
    m = honest()
    other = replace(m, position=arm(m.joints * [1, -1, 1, 1, 1, 1]))
    assert "this is not the measured robot" in complaint(other)
    shuffled = replace(m, position=np.roll(m.position, 1, axis=0))
    assert "joints and positions do not belong together" in complaint(shuffled)


def test_another_size_of_robot() -> None:
    m = honest(frame="tracker")
    found = complaint(replace(m, position=1.45 * m.position))
    assert "the points lie 1.45 times as far apart" in found


def test_one_row_in_another_unit_is_named() -> None:
    m = honest()
    position = m.position.copy()
    position[4] *= 1000.0
    found = complaint(replace(m, position=position))
    assert found.startswith("grid.csv:5: a point ")
    assert "(1 such row: line 5)" in found


def test_all_equal() -> None:
    m = honest()
    found = complaint(replace(m, position=np.tile([1.0, 0.0, 0.5], (len(m), 1))))
    assert found.startswith("grid.csv: all 60 measured positions lie within 0 mm rms of one point.")
    found = complaint(replace(m, joints=np.zeros_like(m.joints)))
    assert found.startswith("grid.csv: all 60 commanded positions lie within")
    rest = np.random.default_rng(1).normal(size=(60, 3)) * 5e-5 + 1.0
    assert "measured positions lie within" in complaint(replace(m, position=rest / np.sqrt(3)))


def test_too_few() -> None:
    assert complaint(honest(5)) == (
        "grid.csv: 5 poses, at least 6 are needed. "
        "Try: measure more poses, spread over the workspace."
    )
    assert "9 rows, but only 3 different ones" in complaint(honest().subset([0, 1, 2] * 3))


def test_a_pose_or_two_are_where_the_arm_was_sent_or_refused() -> None:
    m = honest(2)
    assert check_plausible(m, arm(m.joints), REACH, minimum=1) == ()
    away = replace(m, position=m.position + np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]))
    with pytest.raises(ImplausibleDataError, match=r"grid.csv:2: a point 200.7 mm from where the"):
        check_plausible(away, arm(m.joints), REACH, minimum=1)


def test_duplicates_are_reported() -> None:
    m = honest().subset([*range(20), 3, 5])
    assert check(m) == ("2 rows repeat an earlier one to the last digit (lines 4, 6 of grid.csv).",)
