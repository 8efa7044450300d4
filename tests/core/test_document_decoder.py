"""Documents are checked at the door: the fault says key, value and what is allowed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import pytest

from robotrue.core.document_decoder import decode
from robotrue.errors import ArchiveError, ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A nested record."""

    kind: Literal["plane", "sphere"]
    size: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A record of records."""

    count: int
    rows: tuple[Row, ...] = ()


def test_values_become_records_and_unknown_keys_are_passed_over() -> None:
    stated = {"count": 2, "rows": [{"kind": "plane"}, {"kind": "sphere", "size": 3}], "more": 1}
    document = decode(Document, stated)
    assert document == Document(count=2, rows=(Row(kind="plane"), Row(kind="sphere", size=3.0)))
    assert isinstance(document.rows[1].size, float)


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        ({}, "skin.count is missing"),
        ({"count": 1.5}, "skin.count is 1.5, expected a whole number"),
        ({"count": 1, "rows": [{"kind": "cone"}]}, r"skin.rows\[1\].kind is 'cone', expected 'pl"),
        ({"count": 1, "rows": [3]}, r"skin.rows\[1\] is 3, expected a table"),
        (7, "skin is 7, expected a table"),
    ],
)
def test_a_fault_is_named_with_its_key(stated: object, says: str) -> None:
    with pytest.raises(ArchiveError, match=says) as refused:
        decode(Document, stated, key="skin", source="m.rtm")
    assert refused.value.source == "m.rtm"
    assert "incomplete or damaged" in refused.value.message
    assert refused.value.hint is not None


def test_another_error_has_its_own_hint() -> None:
    with pytest.raises(ConfigurationError, match=r"^count is 'x', expected a whole number"):
        decode(dict[str, int], {"count": "x"}, error=ConfigurationError)
