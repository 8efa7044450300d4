"""Fifty small files that claim to be workspaces and would fill memory or disk: all refused."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from test_exchange import filled

from robotrue.store.exchange import export_project
from robotrue.store.nouns import DOCUMENT
from robotrue.store.records import ItemQuery
from robotrue.store.verify import verify
from robotrue.store.workspace import Workspace

BOMBS = 50
EXPANDED = 16 << 20
"""Bytes a bomb expands to; each is less than 1 MiB on the disk."""
MOST_MB = 40
"""By how much the memory of the importing process may grow over all of them."""
pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="reads /proc, which Linux has"
)
CHILD = """
import json, sys
from pathlib import Path
from robotrue.errors import RobotrueError
from robotrue.store.exchange_import import import_project
from robotrue.store.workspace import Workspace

def memory_mb(name):
    text = Path("/proc/self/status").read_text()
    return next(int(x.split()[1]) for x in text.splitlines() if x.startswith(name)) / 1024

told = {}
with Workspace.open(sys.argv[1]) as workspace:
    import_project(workspace, sys.argv[2])  # a sound one first: all code is loaded
    before = memory_mb("VmRSS")
    for path in sorted(Path(sys.argv[3]).iterdir()):
        try:
            import_project(workspace, path)
            told[path.name] = "taken"
        except RobotrueError as cause:
            told[path.name] = type(cause).__name__
        told[path.name + " MB"] = memory_mb("VmHWM") - before
print(json.dumps(told))
"""


def _manifest(members: dict[str, object], more: str = "") -> bytes:
    stated = {"format": "robotrue-project", "format_version": 1, "schema": "0001"}
    text = json.dumps({**stated, "members": members})
    return f"{text[:-1]}{more}}}".encode()


def _long_manifest(draw: random.Random) -> dict[str, bytes]:
    begin, piece, end = draw.choice(
        [("[", "0,", "0]"), ("[", "[],", "0]"), ("", "[", ""), ("", '{"a":', ""), ("0", " ", "")]
    )
    return {"manifest.json": _manifest({}, f',"x":{begin}{piece * (EXPANDED // len(piece))}{end}')}


def _many_members(draw: random.Random) -> dict[str, bytes]:
    names = [f"{draw.choice(('blobs', 'samples'))}/{k:064x}" for k in range(4000)]
    entry = {"sha256": "0" * 64, "size": 0}
    return {"manifest.json": _manifest(dict.fromkeys(names, entry)), **dict.fromkeys(names, b"")}


def _long_lines(draw: random.Random) -> dict[str, bytes]:
    length = 2 ** draw.randrange(12, 25)
    word = draw.choice([b"0", b"[", b'{"a":', b" ", b'"', b"9,"])
    line = (word * (length // len(word)))[: length - 1] + b"\n"
    return _with_table(draw.choice(["items", "journal", "jobs"]), line * (EXPANDED // length))


def _short_rows(draw: random.Random) -> dict[str, bytes]:
    row = draw.choice([b"{}\n", b"\n", b"[]\n", b"0\n", b'{"id": 1}\n'])
    return _with_table(draw.choice(["items", "blobs", "journal"]), row * (EXPANDED // len(row)))


def _zeros(draw: random.Random) -> dict[str, bytes]:
    return _with("blobs/" + "{sha256}", bytes(EXPANDED - draw.randrange(1000)))


def _with_table(table: str, content: bytes) -> dict[str, bytes]:
    return _with(f"tables/{table}.jsonl", content)


def _with(name: str, content: bytes) -> dict[str, bytes]:
    import hashlib

    sha256 = hashlib.sha256(content).hexdigest()
    name = name.format(sha256=sha256)
    members = {name: {"sha256": sha256, "size": len(content)}}
    return {"manifest.json": _manifest(members), name: content}


KINDS: tuple[Callable[[random.Random], dict[str, bytes]], ...] = (
    _long_manifest,
    _many_members,
    _long_lines,
    _short_rows,
    _zeros,
)


@pytest.mark.parametrize("workspace", ["sqlite"], indirect=True)
def test_bombs_are_refused_in_little_memory_and_leave_nothing(
    workspace: Workspace, tmp_path: Path
) -> None:
    filled(workspace, tmp_path)
    export_project(workspace, tmp_path / "sound.zip")
    bombs = tmp_path / "bombs"
    bombs.mkdir()
    draw = random.Random(1)  # noqa: S311
    for k in range(BOMBS):
        path = bombs / f"{k:02}_{KINDS[k % len(KINDS)].__name__}"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as bundle:
            for name, content in KINDS[k % len(KINDS)](draw).items():
                bundle.writestr(name, content)
        assert path.stat().st_size < 1 << 20
    with Workspace.create(tmp_path / "other") as other:
        folder = other.folder
    call = [sys.executable, "-c", CHILD, str(folder), str(tmp_path / "sound.zip"), str(bombs)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert {told[path.name] for path in bombs.iterdir()} == {"ArchiveError"}, told
    assert max(told[f"{path.name} MB"] for path in bombs.iterdir()) < MOST_MB, told
    with Workspace.open(folder) as other:
        assert items_of(other) == items_of(workspace)
        assert verify(other).faults == verify(other).unnamed == ()
    left = {path.name for path in folder.iterdir()} - {"blobs", "samples", "robotrue.db"}
    assert not [p for name in left if (folder / name).is_dir() for p in (folder / name).iterdir()]


def items_of(workspace: Workspace) -> list[tuple[str, str]]:
    from robotrue.store import items

    return [(each.id, each.name) for each in items.search(workspace, DOCUMENT, ItemQuery()).items]
