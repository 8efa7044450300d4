"""Files that are whole or not there: also when the process that writes them is killed."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robotrue.core.files import atomic_stream
from robotrue.errors import FormatError

WRITER = """
import sys, time
from robotrue.core.files import atomic_stream
with atomic_stream(sys.argv[1]) as stream:
    stream.write(b"x" * 100_000)
    stream.flush()
    sys.stdout.write("written\\n")
    sys.stdout.flush()
    time.sleep(60)
"""


def test_a_stream_stands_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "out.src"
    path.write_bytes(b"old")
    path.chmod(0o640)
    with atomic_stream(path) as stream:
        stream.write(b"new ")
        stream.write(b"bytes")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new bytes"
    assert path.stat().st_mode & 0o777 == 0o640
    assert [p.name for p in tmp_path.iterdir()] == ["out.src"]


def test_an_error_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "out.src"

    def interrupted() -> None:
        with atomic_stream(path) as stream:
            stream.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())
    with pytest.raises(FormatError, match="cannot write"), atomic_stream(tmp_path / "no" / "x"):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="files without a name")
def test_a_killed_writer_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "out.src"
    child = subprocess.Popen(  # noqa: S603
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE
    )
    assert child.stdout is not None
    assert child.stdout.readline() == b"written\n"
    child.send_signal(signal.SIGKILL)
    child.wait()
    child.stdout.close()
    assert not list(tmp_path.iterdir())
