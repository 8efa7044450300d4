"""Damaged and forged model files: read as they were, or refused by one error."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from robotrue.core.archive import archive_from
from robotrue.errors import ArchiveError


@pytest.fixture(scope="module")
def mutator() -> ModuleType:
    """The mutator that release runs use with 20,000 files."""
    path = Path(__file__).parents[2] / "benchmarks" / "damaged_archives.py"
    spec = importlib.util.spec_from_file_location("damaged_archives", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_damage_ends_in_a_traceback_and_no_forged_array_is_accepted(mutator: ModuleType) -> None:
    count, faults = mutator.tried(640, seed=1)
    assert sum(count.values()) == 640
    assert faults == []


def test_claims_of_size_are_refused_before_memory_is_taken(mutator: ModuleType) -> None:
    head, arrays = mutator.contents(mutator.samples()["tool"])
    shape = b"{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000,), }\n"
    raw = b"\x93NUMPY\x01\x00" + len(shape).to_bytes(2, "little") + shape
    with pytest.raises(ArchiveError, match="0 bytes for an array of shape"):
        archive_from(mutator.packed(head, arrays, centre=raw))
    with pytest.raises(ArchiveError, match="a document that is too large"):
        archive_from(mutator.packed(head, arrays, document=b" " * (33 * 2**20)))
    with pytest.raises(ArchiveError, match="damaged"):
        archive_from(mutator.packed(head, arrays, document=b"[" * 100_000))
