"""A record gives back what was put in, cut anywhere, damaged anywhere, on a disk that is full."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from record_cases import HEADER, estimate_rows, force_rows, joint_rows, same

from robotrue.errors import ArchiveError, ConfigurationError, FormatError, ShapeError
from robotrue.online.record import StreamRecord, header_bytes, segments
from robotrue.online.record_frames import Kind, frame_bytes, frame_from
from robotrue.online.record_writer import RecordWriter

CHECKPOINT = {
    "state": np.arange(6.0).reshape(2, 3),
    "modes": np.array([1.0 + 2.0j]),
    "rows": np.array(5),
    "text": np.frombuffer(b"abc", np.uint8),
}


def put_all(writer: RecordWriter, start: int = 0) -> None:
    writer.put(Kind.JOINTS, joint_rows(start, 3))
    writer.put(Kind.FORCE, force_rows(start, 8, late=0.5))
    writer.put(Kind.ESTIMATES, estimate_rows(start, 8))
    writer.put(Kind.CLOCK, {"stream": "force", "offset_s": 0.1 + 0.2})
    writer.put(Kind.CHECKPOINT, CHECKPOINT)


def filled(path: Path, start: int = 0) -> Path:
    writer = RecordWriter(path, HEADER)
    put_all(writer, start)
    writer.close()
    return path


def test_frames_come_back_bit_for_bit(tmp_path: Path) -> None:
    record = StreamRecord(filled(tmp_path / "r"))
    frames = list(record.frames())
    assert [f.kind for f in frames] == [1, 2, 3, 4, 6]
    assert [f.number for f in frames] == list(range(5))
    assert same(frames[0].content, joint_rows(0, 3))
    assert same(frames[1].content, force_rows(0, 8, late=0.5))
    assert same(frames[2].content, estimate_rows(0, 8))
    assert frames[3].content == {"stream": "force", "offset_s": 0.1 + 0.2}
    assert frames[4].content.keys() == CHECKPOINT.keys()
    for name, values in frames[4].content.items():
        np.testing.assert_array_equal(values, CHECKPOINT[name])
        assert values.shape == CHECKPOINT[name].shape
        assert values.flags.writeable
    assert record.header() == HEADER
    assert record.torn == []


def test_columns_without_news_are_left_out() -> None:
    bare = force_rows(0, 100)
    assert len(frame_bytes(Kind.FORCE, 0, bare)) < 100 * 8 * 5 + 60
    with pytest.raises(ShapeError, match="of int16"):
        frame_bytes(Kind.CHECKPOINT, 0, {"a": np.zeros(2, np.int16)})
    data = frame_bytes(Kind.FORCE, 3, bare)
    with pytest.raises(FormatError, match="frame 3 is no force: 3 bytes too many"):
        frame_from(data[:24], data[24:] + b"abc")


def test_cut_at_every_byte(tmp_path: Path) -> None:
    """Wherever the last segment ends, whole frames are read and the next writer goes on."""
    whole = segments(filled(tmp_path / "whole"))[0].read_bytes()
    lengths = [
        len(frame_bytes(f.kind, f.number, f.content))
        for f in StreamRecord(tmp_path / "whole").frames()
    ]
    ends = len(header_bytes(HEADER)) + np.cumsum([0, *lengths])
    path = tmp_path / "cut"
    path.mkdir()
    near = {int(end) + k for end in ends for k in range(-3, 26)}
    for cut in sorted({*range(0, len(whole), 29), *near} & {*range(len(whole) + 1)}):
        (path / "segment-000001.rtr").write_bytes(whole[:cut])
        record = StreamRecord(path)
        frames = list(record.frames())
        assert len(frames) == max(0, int(np.sum(ends <= cut)) - 1)
        left = cut - int(ends[ends <= cut].max(initial=0))
        assert sum(t.length for t in record.torn) == left
        assert record.next_number() == len(frames)


def test_goes_on_behind_a_torn_frame(tmp_path: Path) -> None:
    path = filled(tmp_path / "r")
    torn = segments(path)[0]
    torn.write_bytes(torn.read_bytes()[:-7])
    writer = RecordWriter(path, HEADER)
    assert writer.first == 4
    put_all(writer, 100)
    writer.close()
    record = StreamRecord(path)
    frames = list(record.frames())
    assert [f.number for f in frames] == list(range(9))
    assert same(frames[4].content, joint_rows(100, 3))
    assert [(t.segment.name, t.inside) for t in record.torn] == [("segment-000001.rtr", False)]


def test_damage_inside_is_refused_or_left_out(tmp_path: Path) -> None:
    path = filled(tmp_path / "r")
    segment = segments(path)[0]
    data = bytearray(segment.read_bytes())
    data[len(header_bytes(HEADER)) + 40] ^= 1
    segment.write_bytes(data)
    with pytest.raises(FormatError, match=r"damaged at byte \d+; whole frames follow"):
        list(StreamRecord(path).frames())
    record = StreamRecord(path)
    assert [f.number for f in record.frames(skip_damage=True)] == [1, 2, 3, 4]
    assert [t.inside for t in record.torn] == [True]


def test_segments_roll_and_keep_their_order(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "r", HEADER, segment=2000)
    for k in range(60):
        writer.put(Kind.FORCE, force_rows(k * 10, 10))
    writer.close()
    assert len(segments(tmp_path / "r")) > 5
    frames = list(StreamRecord(tmp_path / "r").frames())
    assert [f.number for f in frames] == list(range(60))
    assert np.concatenate([f.content.sequence for f in frames]).tolist() == list(range(600))


def test_two_writers_of_one_record(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "r", HEADER)
    with pytest.raises(ConfigurationError, match="another process writes to this record"):
        RecordWriter(tmp_path / "r", HEADER)
    writer.close()
    RecordWriter(tmp_path / "r", HEADER).close()


def test_no_record_and_a_newer_one(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no segment in this folder"):
        list(StreamRecord(tmp_path).frames())
    (tmp_path / "segment-000001.rtr").write_bytes(b"PK\x03\x04 something else")
    with pytest.raises(FormatError, match="not a segment of a record"):
        list(StreamRecord(tmp_path).frames())
    text = json.dumps({"schema": 99}).encode()
    import zlib

    numbers = len(text).to_bytes(4, "little") + zlib.crc32(text).to_bytes(4, "little")
    new = b"robotrue record\n" + numbers + text + b"\n"
    (tmp_path / "segment-000001.rtr").write_bytes(new)
    with pytest.raises(ArchiveError, match="record schema 99"):
        list(StreamRecord(tmp_path).frames())


class FullDisk:
    """Takes some bytes, then none until there is room again."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.refused = threading.Event()

    def __call__(self, file: int, data: bytes | memoryview) -> int:
        if not self.room:
            self.refused.set()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        done = os.write(file, bytes(data[: self.room]))
        self.room -= done
        return done


def test_a_full_disk_loses_nothing_once_there_is_room(tmp_path: Path) -> None:
    disk = FullDisk(4000)
    writer = RecordWriter(tmp_path / "r", HEADER, write=disk)
    for k in range(40):
        writer.put(Kind.FORCE, force_rows(k * 10, 10))
    assert disk.refused.wait(10.0)
    writer.put(Kind.FORCE, force_rows(400, 10))  # sensing goes on
    while writer.health().connected:
        pass
    assert writer.health().last_fault == "cannot write to the disk: No space left on device"
    disk.room = 10**9
    writer.close()
    assert writer.health().connected
    frames = list(StreamRecord(tmp_path / "r").frames())
    assert np.concatenate([f.content.sequence for f in frames]).tolist() == list(range(410))


def test_a_disk_that_stays_full_stops_the_record(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "r", HEADER, memory=20_000, write=FullDisk(0))

    def put_on() -> None:
        for k in range(100):
            writer.put(Kind.FORCE, force_rows(k * 10, 10))

    with pytest.raises(FormatError, match="are queued for the disk, the limit is 0 MB"):
        put_on()
    assert writer.crowded
    with pytest.raises(FormatError, match="frames could not be written: cannot write to the disk"):
        writer.close()
    assert not segments(tmp_path / "r")


def test_a_fault_in_the_thread_reaches_the_service(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "r", HEADER)
    writer.put(Kind.CHECKPOINT, {"a": np.zeros(2, np.int16)})
    with pytest.raises(ShapeError, match="of int16"):
        writer.close()


KILLED = """
import sys
sys.path[:0] = [{tests!r}]
from record_cases import HEADER, force_rows
from robotrue.online.record_frames import Kind
from robotrue.online.record_writer import RecordWriter
writer = RecordWriter({path!r}, HEADER, segment=20000)
k = writer.first
while True:
    writer.put(Kind.FORCE, force_rows(k * 10, 10))
    k += 1
    if k % 100 == 0:
        print(k, flush=True)
    while writer.crowded:
        pass
"""


def test_killed_while_it_writes(tmp_path: Path) -> None:
    path = tmp_path / "r"
    text = KILLED.format(tests=str(Path(__file__).parent), path=str(path))
    for kill in range(3):
        command = [sys.executable, "-c", text]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:  # noqa: S603
            assert process.stdout is not None
            while process.stdout.readline():  # however slow the disk is
                # the thread that writes may not have made the first segment yet
                frames = StreamRecord(path).frames() if segments(path) else ()
                if sum(len(f.content.sequence) for f in frames) >= 1000 * (kill + 1):
                    break
            process.send_signal(signal.SIGKILL)
    frames = list(StreamRecord(path).frames())
    assert [f.number for f in frames] == list(range(len(frames)))
    rows = np.concatenate([f.content.sequence for f in frames])
    assert rows.tolist() == list(range(len(rows)))
    assert len(rows) >= 3000
