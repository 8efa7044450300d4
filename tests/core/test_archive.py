"""Archives: whole or not there, the same bytes for the same content, damage is noticed."""

from __future__ import annotations

import io
import json
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.archive import Archive, archive_bytes, read_archive, write_archive
from robotrue.core.arrays import frozen
from robotrue.core.files import write_atomic
from robotrue.errors import ArchiveError, FormatError, ShapeError


@pytest.fixture
def archive() -> Archive:
    return Archive(
        kind="test/thing",
        schema=3,
        document={"name": "x", "list": [1, 2.5]},
        arrays={"a": np.arange(6.0).reshape(2, 3), "b": np.zeros((0, 3))},
    )


def test_round_trip_is_exact(archive: Archive, tmp_path: Path) -> None:
    write_archive(tmp_path / "m.rt", archive)
    back = read_archive(tmp_path / "m.rt")
    assert (back.kind, back.schema) == ("test/thing", 3)
    assert dict(back.document) == {"name": "x", "list": [1, 2.5]}
    np.testing.assert_array_equal(back.array("a"), archive.arrays["a"])
    assert back.array("b").shape == (0, 3)


def test_equal_content_gives_equal_bytes(archive: Archive) -> None:
    assert archive_bytes(archive) == archive_bytes(archive)


def test_missing_array_is_named(archive: Archive) -> None:
    with pytest.raises(ArchiveError, match=r"no array 'c'; it holds \['a', 'b'\]"):
        archive.array("c")


def test_truncated_file(archive: Archive, tmp_path: Path) -> None:
    path = tmp_path / "m.rt"
    path.write_bytes(archive_bytes(archive)[:-40])
    with pytest.raises(ArchiveError, match="damaged"):
        read_archive(path)


def _rewritten(data: bytes, change: dict[str, object]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "document.json":
                content = json.dumps(json.loads(content) | change).encode()
            new.writestr(name, content)
    return out.getvalue()


def test_altered_content_is_noticed(archive: Archive, tmp_path: Path) -> None:
    path = tmp_path / "m.rt"
    path.write_bytes(_rewritten(archive_bytes(archive), {"kind": "test/other"}))
    with pytest.raises(ArchiveError, match="altered or damaged"):
        read_archive(path)


def test_file_from_the_future_is_refused(archive: Archive, tmp_path: Path) -> None:
    path = tmp_path / "m.rt"
    path.write_bytes(_rewritten(archive_bytes(archive), {"format_version": 99}))
    with pytest.raises(ArchiveError, match=r"format 99.*up to 1.*update robotrue"):
        read_archive(path)


def test_other_zip_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.zip", "w") as bundle:
        bundle.writestr("document.json", "{}")
    with pytest.raises(ArchiveError, match="not a robotrue archive"):
        read_archive(tmp_path / "x.zip")


def test_failed_write_leaves_the_old_file_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "model.rt"
    path.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FormatError, match="No space left on device"):
        write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["model.rt"]


def test_write_into_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot write"):
        write_atomic(tmp_path / "none" / "x", b"")


def test_frozen_names_the_bad_place() -> None:
    with pytest.raises(ShapeError, match=r"p\[1, 2\] is nan"):
        frozen([[0, 0, 0], [0, 0, float("nan")]], (None, 3), "p")
    with pytest.raises(ShapeError, match=r"p has shape \(2,\), expected \(any, 3\)"):
        frozen([0, 0], (None, 3), "p")
    with pytest.raises(ValueError, match="read-only"):
        frozen([1.0], (1,), "p")[0] = 2.0
