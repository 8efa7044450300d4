"""The noun of touches: neutral columns, labels, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robotrue.core.surfaces import Plane
from robotrue.errors import ShapeError
from robotrue.measurement.probing_set import NO_SURFACE, KnownDistance, ProbingSet

FLOOR = Plane(point=np.zeros(3), normal=np.array([0.0, 0.0, 1.0]))


def made(**changes: Any) -> ProbingSet:
    given: dict[str, Any] = {
        "names": ("K", "K", "L"),
        "point": np.eye(3),
        "joints": np.zeros((3, 6)),
    }
    return ProbingSet(**{**given, **changes})


def test_empty_columns_take_their_neutral_value() -> None:
    touches = made()
    assert touches.full.all()
    assert touches.parts == (0,)
    assert touches.labels == ("K", "K (2)", "L")
    assert (touches.touched == NO_SURFACE).all()
    np.testing.assert_array_equal(touches.lines, [1, 2, 3])
    assert np.isnan(touches.position).all()


def test_normals_are_made_unit_and_fix_one_direction() -> None:
    normal = np.array([[0.0, 0.0, 2.0], [np.nan] * 3, [np.nan] * 3])
    touches = made(normal=normal)
    np.testing.assert_array_equal(touches.full, [False, True, True])
    np.testing.assert_array_equal(touches.normal[0], [0.0, 0.0, 1.0])


def test_a_subset_keeps_what_belongs_to_it() -> None:
    touches = made(
        point=np.zeros((3, 3)),
        part=np.array([0, 1, 2]),
        sockets=(0, 1, 2),
        distances=(
            KnownDistance(first=0, second=1, length=0.3, sigma=1e-5),
            KnownDistance(first=1, second=2, length=0.3, sigma=1e-5),
        ),
    )
    kept = touches.subset([2, 1])
    assert kept.names == ("L", "K")
    assert kept.sockets == (1, 2)
    assert kept.distances == touches.distances[1:]
    assert len(touches.subset([])) == 0
    assert len(touches.subset(touches.part > 0)) == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"point": np.zeros((2, 3))}, r"point has shape \(2, 3\)"),
        ({"joints": np.zeros((2, 6))}, "joints has shape"),
        ({"joints": np.empty((0, 0))}, "'K' has neither joints nor a position"),
        ({"normal": np.zeros((3, 3))}, "normal of touch 'K' has length 0"),
        ({"normal": [[0, 0, np.nan]] + [[np.nan] * 3] * 2}, "normal of touch 'K' is"),
        ({"touched": np.array([0, 0, 1]), "surfaces": (FLOOR,)}, "surfaces 0 to 1, there are 1"),
        (
            {"touched": np.zeros(3), "surfaces": (FLOOR,), "normal": np.eye(3)},
            "names a surface and a normal",
        ),
        ({"radius": -1e-3}, "probe radius is -0.001 m"),
        ({"sockets": (4,)}, "no touch of part 4"),
        ({"sockets": (0,)}, "a socket is a place"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ShapeError, match=words):
        made(**changes)


@pytest.mark.parametrize(
    ("first", "second", "length", "sigma"), [(0, 0, 0.1, 1e-5), (0, 1, 1e-4, 1e-5), (0, 1, 0.1, 0)]
)
def test_distances_without_a_direction_are_refused(
    first: int, second: int, length: float, sigma: float
) -> None:
    with pytest.raises(ShapeError):
        KnownDistance(first=first, second=second, length=length, sigma=sigma)
