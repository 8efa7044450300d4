"""Frozen tables of columns: what is refused, what is copied, how rows are cut and joined."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass, field
from typing import Annotated, Any

import numpy as np
import pytest

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, concat, count_rows
from robotrue.errors import ShapeError


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner(Columns):
    force: Annotated[Array, Column("n", unit="N")]

    def __len__(self) -> int:
        return len(self.force)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table(Columns):
    names: Annotated[tuple[str, ...], Column("n")]
    point: Annotated[Array, Column("n 3", unit="m")]
    joints: Annotated[Array, Column("n dof", unit="rad")]
    approach: Annotated[Array, Column("n dof", fill=0.0)] = EMPTY
    normal: Annotated[Array, Column("n 3", nan=True, fill=np.nan)] = EMPTY
    limits: Annotated[Array, Column("dof 2", inf=True, fill=np.inf)] = EMPTY
    map: Annotated[Array, Column("dof dof", fill=np.eye)] = EMPTY
    row: Annotated[IntArray, Column("n", fill=count_rows)] = EMPTY
    cutting: Annotated[BoolArray | None, Column("n")] = None
    inner: Annotated[Inner | None, Column("n")] = None
    free: Annotated[Array, Column("_ 2")] = field(default_factory=lambda: np.zeros((4, 2)))
    radius: float = 0.0

    def _check_rules(self) -> None:
        if self.radius < 0.0:
            raise ShapeError(f"radius {self.radius:g} m, expected 0 or more.")


def table(n: int = 3, **changes: object) -> Table:
    values: dict[str, object] = {
        "names": [f"p{k}" for k in range(n)],
        "point": np.arange(3.0 * n).reshape(n, 3),
        "joints": np.arange(6.0 * n).reshape(n, 6),
    }
    return Table(**{**values, **changes})  # type: ignore[arg-type]


def test_empty_columns_take_their_neutral_value() -> None:
    made = table(3)
    assert made.names == ("p0", "p1", "p2")
    assert made.approach.shape == (3, 6)
    assert not made.approach.any()
    assert made.normal.shape == (3, 3)
    assert np.isnan(made.normal).all()
    assert made.limits.shape == (6, 2)
    assert np.isinf(made.limits).all()
    np.testing.assert_array_equal(made.map, np.eye(6))
    assert made.row.tolist() == [1, 2, 3]
    assert made.row.dtype == np.int64
    assert made.cutting is None
    none = table(0)
    assert none.normal.shape == (0, 3)
    assert none.approach.shape == (0, 6)


def test_arrays_are_frozen_and_nobody_else_can_change_them() -> None:
    point = np.zeros((3, 3))
    made = table(point=point)
    point[0] = 7.0
    assert not made.point.any()
    with pytest.raises(ValueError, match="read-only"):
        made.point[0, 0] = 1.0
    with pytest.raises(FrozenInstanceError):
        made.point = point  # type: ignore[misc]


def test_a_frozen_array_is_not_copied() -> None:
    made = table()
    assert table(point=made.point).point is made.point
    assert table(point=made.point.tolist()).point.dtype == np.float64


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"point": np.zeros((2, 3))}, r"Table.point has shape \(2, 3\), expected \(3, 3\)."),
        ({"free": np.zeros((4, 2, 1))}, r"Table.free has shape \(4, 2, 1\), expected"),
        ({"point": np.zeros(3)}, r"Table.point has shape \(3,\), expected \(3, 3\)."),
        ({"joints": np.zeros(3)}, r"Table.joints has shape \(3,\), expected \(3, any\)."),
        ({"approach": np.zeros((3, 5))}, r"Table.approach has shape \(3, 5\), expected \(3, 6\)."),
        ({"free": np.zeros((4, 3))}, r"Table.free has shape \(4, 3\), expected \(any, 2\)."),
        ({"cutting": np.zeros(2, np.bool_)}, r"Table.cutting has shape \(2,\), expected \(3\)."),
        ({"inner": Inner(force=np.zeros(2))}, r"Table.inner has shape \(2,\), expected \(3\)."),
        ({"point": np.full((3, 3), np.nan)}, r"Table.point\[0, 0\] is nan, expected a finite"),
        ({"normal": np.full((3, 3), np.inf)}, r"Table.normal\[0, 0\] is inf, expected a finite"),
        ({"limits": np.full((6, 2), np.nan)}, r"Table.limits\[0, 0\] is nan, expected a finite"),
        ({"radius": -1.0}, "radius -1 m, expected 0 or more"),
    ],
)
def test_wrong_shapes_and_values_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        table(**changes)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (slice(1, None), [1, 2]),
        (np.array([2, 0]), [2, 0]),
        (np.array([True, False, True]), [0, 2]),
    ],
)
def test_rows_are_cut_from_every_column(rows: object, expected: list[int]) -> None:
    whole = table(
        cutting=[True, False, True], inner=Inner(force=np.arange(3.0)), radius=2.0, normal=np.eye(3)
    )
    part = whole.take(rows)  # type: ignore[arg-type]
    assert part.names == tuple(f"p{k}" for k in expected)
    np.testing.assert_array_equal(part.point, whole.point[expected])
    np.testing.assert_array_equal(part.normal, np.eye(3)[expected])
    assert part.row.tolist() == [k + 1 for k in expected]
    assert part.inner is not None
    assert part.inner.force.tolist() == expected
    assert part.free is whole.free
    assert part.limits is whole.limits
    assert part.radius == 2.0


def test_cutting_and_joining_give_the_table_back() -> None:
    whole = table(5, inner=Inner(force=np.arange(5.0)), cutting=np.arange(5) > 2)
    again = concat([whole.take(slice(k, k + 2)) for k in (0, 2, 4)])
    for name in ("names", "radius"):
        assert getattr(again, name) == getattr(whole, name)
    for name in ("point", "joints", "row", "cutting", "limits"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    assert again.inner is not None
    assert again.inner.force.tolist() == [0, 1, 2, 3, 4]


def test_tables_with_different_scalars_are_not_joined() -> None:
    with pytest.raises(ShapeError, match=r"Table\.radius differs"):
        concat([table(), table(radius=1.0)])
    with pytest.raises(ShapeError, match=r"Table\.limits differs"):
        concat([table(), table(limits=np.zeros((6, 2)))])
    with pytest.raises(ShapeError, match="none, expected one or more"):
        concat([])


def test_the_document_holds_json_values() -> None:
    document = table(1, inner=Inner(force=np.array([2.0]))).document()
    assert document["names"] == ["p0"]
    assert document["point"] == [[0.0, 1.0, 2.0]]
    assert document["normal"] == [[None, None, None]]
    assert document["inner"] == {"force": [2.0]}
    assert document["cutting"] is None
