"""A ball in sockets: folders of places, files of joints, and the same touches as rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError, ImplausibleDataError, ShapeError
from robotrue.measurement.formats.sockets import read_sockets
from robotrue.measurement.measurement_set import touched_rows
from robotrue.measurement.probing_set import ProbingSet


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return folder


TWO = {
    "right/hole_0.csv": "0.1,0.2,-0.3\n0.4,0.5,0.6\n",
    "right/hole_1.csv": "1e-1,-2.0e0,3\n",
    "front/hole_0.csv": "1,1,1\n2,2,2\n3,3,3\n",
    "front/hole_1.csv": "1,1,2\n",
    "front/hole_0_pose.csv": "9,9,9,9,9,9,9\n",
}


def test_places_and_sockets_come_in_the_order_of_their_names(tmp_path: Path) -> None:
    found = read_sockets(written(tmp_path, TWO), spacing=50 * MM, spacing_sigma=0.1 * MM)
    assert found.places == ("front", "right")
    assert found.sockets == ("front/hole_0", "front/hole_1", "right/hole_0", "right/hole_1")
    np.testing.assert_array_equal(found.place, [0, 0, 1, 1])
    touches = found.touches
    np.testing.assert_array_equal(touches.part, [0, 0, 0, 1, 2, 2, 3])
    np.testing.assert_array_equal(touches.lines, [1, 2, 3, 1, 1, 2, 1])
    np.testing.assert_allclose(
        touches.joints[4:], [[0.1, 0.2, -0.3], [0.4, 0.5, 0.6], [0.1, -2, 3]]
    )
    assert touches.sockets == (0, 1, 2, 3)
    assert touches.names[3] == "front/hole_1"
    assert not touches.point.any()
    assert [(d.first, d.second, d.length, d.sigma) for d in touches.distances] == [
        (0, 1, 0.05, 1e-4),
        (2, 3, 0.05, 1e-4),
    ]
    np.testing.assert_array_equal(np.flatnonzero(found.rows_at(["right"])), [4, 5, 6])
    with pytest.raises(
        ConfigurationError, match=r"no place 'left'; places of the fixture: front, r"
    ):
        found.rows_at(["left"])


@pytest.mark.parametrize(
    ("files", "error", "message"),
    [
        ({}, FormatError, "no socket files"),
        ({"a/hole_0.csv": "1,2\n1,x\n"}, FormatError, r"hole_0.csv:2: joint 2 is 'x'"),
        ({"a/hole_0.csv": "1,nan\n"}, FormatError, r"joint 2 is 'nan', expected a finite"),
        ({"a/hole_0.csv": "1,2\n", "b/hole_0.csv": "1,2,3\n"}, FormatError, "3 columns, hole_0.c"),
        (
            {"a/hole_0.csv": "1,2\n45,2\n"},
            ImplausibleDataError,
            r":2: a joint of 45, joints are in",
        ),
        ({"a/hole_0.csv": "1,2\n"}, ShapeError, "a spacing, and 1 sockets at 'a'"),
    ],
)
def test_what_cannot_be_read_is_named(
    tmp_path: Path, files: dict[str, str], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        read_sockets(written(tmp_path, files), spacing=50 * MM)


def test_touched_points_become_rows_of_as_many_set_ups_as_there_are_parts(tmp_path: Path) -> None:
    touches = read_sockets(written(tmp_path, TWO)).touches
    rows = touched_rows(touches, sigma=0.1 * MM)
    assert rows.frame == "tracker"
    np.testing.assert_array_equal(rows.station, touches.part)
    np.testing.assert_array_equal(rows.joints, touches.joints)
    np.testing.assert_allclose(rows.covariance[0], 1e-8 * np.eye(3))
    assert not rows.position.any()
    assert rows.group_names == ("part 0", "part 1", "part 2", "part 3")
    flat = ProbingSet(
        names=("A",), point=np.zeros((1, 3)), joints=np.zeros((1, 3)), normal=np.array([[0, 0, 1]])
    )
    with pytest.raises(ShapeError, match="1 of 1 touches fix one direction only"):
        touched_rows(flat, sigma=0.1 * MM)
    with pytest.raises(ShapeError, match="0 joints"):
        touched_rows(
            ProbingSet(names=("A",), point=np.zeros((1, 3)), position=np.zeros((1, 3))), sigma=1e-4
        )
