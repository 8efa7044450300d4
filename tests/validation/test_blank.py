"""A part in its blank: what is left where, the shift, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.blank import BlankCheck, check_blank

T_BASE_PART = pose_from_xyz_abc(np.array([1.0, -0.1, 0.5]), np.array([10.0, -5.0, 3.0]) * DEG)
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * [0.2, 0.1, 0.15]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX = TriangleMesh(
    vertices=CORNERS,
    faces=np.array([f for a, b, c, d in QUADS for f in ((a, b, c), (a, c, d))]),
)
LEFT = {"-x": 3.0, "+x": 7.0, "-y": 4.0, "+y": 4.0, "+z": 6.0}
"""mm of blank over the part on each face; it stands on -z."""


def touch(left: dict[str, float], *, radius: float = 0.0, spread: float = 1.0) -> ProbingSet:
    names, points, normals = [], [], []
    low, high = CORNERS.min(axis=0), CORNERS.max(axis=0)
    for name, over in left.items():
        axis, sign = "xyz".index(name[1]), 1.0 if name[0] == "+" else -1.0
        for u, v in ((0.2, 0.2), (0.8, 0.3), (0.4, 0.9), (0.7, 0.7)):
            share = np.insert(0.5 + spread * (np.array([u, v]) - 0.5), axis, 0.0)
            point = low + share * (high - low)
            point[axis] = (high if sign > 0 else low)[axis] + sign * over * MM
            names.append(name)
            points.append(point)
            normals.append(sign * np.eye(3)[axis])
    position = np.array(points) + radius * np.array(normals)
    return ProbingSet(
        names=tuple(names), point=np.array(points), normal=np.array(normals), radius=radius,
        position=apply(T_BASE_PART, position),
    )  # fmt: skip


def checked(touches: ProbingSet, required: float = 2.0, T: Array = T_BASE_PART) -> BlankCheck:
    return check_blank(BOX, touches, touches.position, T, sigma=0.1 * MM, required=required * MM)


@pytest.mark.parametrize("radius", [0.0, 3.0 * MM])
def test_what_is_left_on_every_face(radius: float) -> None:
    found = checked(touch(LEFT, radius=radius))
    left = {face.name: face.allowance / MM for face in found.faces}
    assert left == pytest.approx(LEFT)
    assert found.verdict == "fits"
    assert found.least.name == "-x"
    assert found.least.corner[0] == 0.0
    np.testing.assert_allclose(found.shift / MM, [2.0, 0.0, 0.0], atol=1e-9)
    assert dict(zip(left, found.after / MM, strict=True)) == pytest.approx(
        LEFT | {"-x": 5.0, "+x": 5.0}
    )
    assert "opposite +z" in found.doubts[0]


def test_a_blank_that_lies_askew_is_turned_about_the_axis_it_may_turn_about() -> None:
    turn = np.array([0.0, 0.0, 1.5]) * DEG  # 200 mm long: 5 mm from end to end
    touches = touch({"-x": 3.0, "+x": 3.0, "-y": 2.0, "+y": 2.0, "+z": 6.0})
    askew = pose_from_xyz_abc(np.zeros(3), np.array([1.5, 0.0, 0.0]) * DEG)
    at = T_BASE_PART @ askew  # the blank as it lies; the part's frame stays
    position = apply(at, apply(np.linalg.inv(T_BASE_PART), touches.position))
    found = check_blank(BOX, touches, position, T_BASE_PART, sigma=0.05 * MM, required=1.5 * MM)
    assert found.least.allowance < 0.5 * MM
    np.testing.assert_allclose(found.turn / DEG, turn / DEG, atol=1e-3)
    assert found.verdict == "fits when turned"
    np.testing.assert_allclose(found.after / MM, [3.0, 3.0, 2.0, 2.0, 6.0], atol=1e-3)
    # the same with nothing touched on -y: what would come nearer there is not known, nothing turns
    rows = np.array([i for i, name in enumerate(touches.names) if name != "-y"])
    alone = check_blank(
        BOX, touches.subset(rows), position[rows], T_BASE_PART, sigma=0.05 * MM, required=1.5 * MM
    )
    assert not alone.turn.any()
    # where the shift is enough nothing turns, and about an axis that sees untouched sides neither
    assert not checked(touches, 1.0).turn.any()
    nodding = T_BASE_PART @ pose_from_xyz_abc(np.zeros(3), np.array([0.0, 1.5, 0.0]) * DEG)
    position = apply(nodding, apply(np.linalg.inv(T_BASE_PART), touches.position))
    tipped = check_blank(BOX, touches, position, T_BASE_PART, sigma=0.05 * MM, required=1.5 * MM)
    assert np.abs(tipped.turn[:2]).max() < 1e-9


def test_the_verdicts() -> None:
    assert checked(touch(LEFT), 4.5).verdict == "does not fit"  # 4 on both y faces
    uneven = LEFT | {"-y": 6.0, "+y": 6.0}
    assert checked(touch(uneven), 4.5).verdict == "fits when shifted"
    assert checked(touch(LEFT | {"-x": 7.0}), 4.0).verdict == "undecided"
    assert checked(touch(LEFT | {"-x": -1.0, "+x": 1.0}), 0.5).verdict == "does not fit"
    out = checked(touch(LEFT | {"-x": -1.0}), 1.0)
    assert out.least.allowance == pytest.approx(-1.0 * MM)
    assert out.verdict == "fits when shifted"


def test_a_tilted_blank_is_nearest_at_a_corner() -> None:
    touches = touch(LEFT)
    tilt = pose_from_xyz_abc(np.zeros(3), np.array([-1.0, 0.0, 0.0]) * DEG)
    found = checked(touches, T=T_BASE_PART @ tilt)
    side = next(face for face in found.faces if face.name == "+x")
    lever = 0.1 * np.tan(1.0 * DEG)
    assert 7.0 * MM - side.allowance == pytest.approx(lever, abs=0.1 * MM)


def test_touches_too_close_together_take_the_tilt_of_the_drawing() -> None:
    found = checked(touch(LEFT, spread=0.0))
    assert not any(face.tilted for face in found.faces)
    assert "from the drawing" in found.doubts[0]


def test_bad_blanks_are_refused() -> None:
    touches = touch(LEFT)
    position = touches.position.copy()
    position[:8] = touches.position[[4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(ImplausibleDataError, match=r"blank would be -\d+\.\d mm thick"):
        check_blank(BOX, touches, position, T_BASE_PART, sigma=1e-4, required=0.0)
    position = touches.position.copy()
    position[0] += T_BASE_PART[:3, 0] * 0.08
    with pytest.raises(ImplausibleDataError, match=r"touches .* lie in a plane \d+ deg from the"):
        check_blank(BOX, touches, position, T_BASE_PART, sigma=1e-4, required=0.0)
    with pytest.raises(ConfigurationError, match="allowance -1 mm"):
        checked(touch(LEFT), -1.0)
    bare = ProbingSet(names=("a",), point=np.zeros((1, 3)), position=np.zeros((1, 3)))
    with pytest.raises(ConfigurationError, match="a has no normal"):
        checked(bare)
    with pytest.raises(ObservabilityError, match="no touch"):
        checked(touch(LEFT).subset(np.zeros(20, dtype=bool)))
