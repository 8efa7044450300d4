"""Record writer in a separate thread, so that the disk never delays an answer to the robot.

Every frame goes to the system as it comes (a killed process loses none of those) and to the disk
every ``sync`` seconds (a power failure loses the frames since). While the disk refuses, is full or
stalls, frames wait in memory and are tried again every second; nothing is dropped. Where they fill
``memory``, the record can no longer be whole, and :meth:`RecordWriter.put` raises.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.link import Health
from robotrue.online.record import RecordHeader, StreamRecord, header_bytes, segments
from robotrue.online.record_frames import Arrays, Content, Kind, content_size, frame_bytes

SYNC: Final = 1.0
"""s between two writes through to the disk."""
SEGMENT: Final = 256 << 20
"""Bytes from which a new segment starts."""
MEMORY: Final = 256 << 20
"""Bytes of frames that may wait for the disk."""
_AHEAD: Final = 16 << 20
"""Bytes by which sources that can wait run ahead of the disk at most: memory stays flat."""
_RETRY: Final = 1.0
_BATCH: Final = 4 << 20
_MOST: Final = 4096

Write = Callable[[int, bytes | memoryview], int]


class RecordWriter:
    """Appends frames to a record.

    Attributes:
        path: Folder of the record.
        first: Number of the first frame this writer writes.
    """

    def __init__(
        self,
        path: str | Path,
        header: RecordHeader,
        *,
        segment: int = SEGMENT,
        memory: int = MEMORY,
        write: Write = os.write,
    ) -> None:
        """Opens a record, or continues one in a new segment.

        Args:
            path: Folder; created if missing.
            header: Of the segments to come.
            segment: Bytes from which a new segment starts.
            memory: Bytes of frames that may wait.
            write: Writes bytes to a file; another one in tests of a full disk.

        Raises:
            ConfigurationError: Another process writes to it.
            FormatError: It cannot be written to.
        """
        self.path = Path(path)
        self._header, self._segment = header_bytes(header), segment
        self._memory, self._write = memory, write
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock_file = os.open(self.path / "lock", os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as cause:
            raise FormatError(
                f"cannot write: {cause.strerror}.", source=path, hint="check the folder."
            ) from cause
        _lock(self._lock_file, self.path)
        self.first = self._number = StreamRecord(self.path).next_number()
        self._segment_number = _last_segment(self.path)
        self._file, self._length, self._synced = -1, 0, time.monotonic()
        self._queue: deque[tuple[Kind, int, Content | Arrays, int]] = deque()
        self._waiting, self._written, self._fault, self._faults = 0, 0, "", 0
        self._broken: BaseException | None = None
        self._closing = False
        self._change = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="record", daemon=True)
        self._thread.start()

    def put(self, kind: Kind, content: Content | Arrays) -> int:
        """Returns the number of a frame that will be written; never waits for the disk.

        Raises:
            FormatError: More is waiting for the disk than may, or the record is closed.
        """
        size = content_size(content)
        with self._change:
            if self._broken is not None:
                raise self._broken
            if self._closing:
                raise FormatError("the record is closed.", source=self.path)
            if self._waiting + size > self._memory:
                raise FormatError(
                    f"{self._waiting / 1e6:.0f} MB are queued for the disk, the limit is "
                    f"{self._memory / 1e6:.0f} MB: the record would not be whole "
                    f"({self._fault or 'the disk is too slow'}).",
                    source=self.path,
                    hint="free space, or a faster disk for --record.",
                )
            number = self._number
            self._number += 1
            self._waiting += size
            self._queue.append((kind, number, content, size))
            self._change.notify()
        return number

    @property
    def waiting(self) -> int:
        """Bytes of frames that wait for the disk."""
        return self._waiting

    @property
    def crowded(self) -> bool:
        """True if a source that can wait should wait for the disk."""
        return self._waiting > min(self._memory // 2, _AHEAD)

    def health(self) -> Health:
        """Returns frames written (``received``), times the disk refused, and its latest fault."""
        return Health(
            name=f"record {self.path}",
            connected=not self._fault and self._broken is None,
            received=self._written,
            refused=self._faults,
            last_fault=self._fault or ("" if self._broken is None else str(self._broken)),
        )

    def close(self) -> None:
        """Writes all waiting frames through to the disk, and ends.

        Raises:
            FormatError: The disk does not take the waiting frames; states the number lost.
        """
        with self._change:
            self._closing = True
            self._change.notify()
        self._thread.join()
        os.close(self._lock_file)
        if self._broken is not None:
            raise self._broken
        if self._queue:
            raise FormatError(
                f"{len(self._queue)} frames could not be written: {self._fault}.",
                source=self.path,
                hint="free space, and record again.",
            )

    def _run(self) -> None:
        try:
            while self._wait():
                closing = self._closing  # a write refused before that is tried once more
                if self._queue and not self._write_batch():
                    if closing:
                        return
                    with self._change:
                        self._change.wait(_RETRY)
                elif time.monotonic() - self._synced >= SYNC:
                    self._sync_to_disk()
            self._end_segment()
        except BaseException as fault:  # raised by the next put: the thread has no caller
            self._broken = fault

    def _wait(self) -> bool:
        """Returns False when all is written and no more will come."""
        with self._change:
            if not self._queue and not self._closing:
                self._change.wait(SYNC)
            return bool(self._queue) or not self._closing

    def _write_batch(self) -> bool:
        """Writes a batch; whether the disk took it. The remainder stays in the queue."""
        batch, size, most = [], 0, min(_BATCH, self._segment - self._length)
        for kind, number, content, _ in self._queue_now():
            batch.append(frame_bytes(kind, number, content))
            size += len(batch[-1])
            if size >= most:
                break
        done = 0
        try:
            if self._file < 0:
                self._begin_segment()
            data = memoryview(b"".join(batch))
            while done < size:
                done += self._write(self._file, data[done:])
        except OSError as fault:
            self._note_refusal(fault)
        else:
            self._fault = ""
        whole, length = 0, 0
        for frame in batch:
            if length + len(frame) > done:
                break
            whole, length = whole + 1, length + len(frame)
        self._length += length
        self._written += whole
        with self._change:
            for _ in range(whole):
                self._waiting -= self._queue.popleft()[3]
        if done < size:
            self._leave_segment()
            return False
        if self._length >= self._segment:
            self._end_segment()
        return True

    def _queue_now(self) -> list[tuple[Kind, int, Content | Arrays, int]]:
        with self._change:
            return list(itertools.islice(self._queue, _MOST))

    def _note_refusal(self, fault: OSError) -> None:
        self._fault = f"cannot write to the disk: {fault.strerror or fault}"
        self._faults += 1

    def _begin_segment(self) -> None:
        self._segment_number += 1
        try:
            how = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
            self._file = os.open(self._segment_path(), how, 0o644)
        except OSError:
            self._segment_number -= 1
            raise
        self._length = 0
        done = 0
        while done < len(self._header):
            done += self._write(self._file, self._header[done:])
        self._length = len(self._header)

    def _leave_segment(self) -> None:
        """Ends a segment the disk refused at its last whole frame; the next try begins another."""
        if self._file < 0:
            return
        with contextlib.suppress(OSError):
            os.ftruncate(self._file, self._length)
        os.close(self._file)
        self._file = -1
        if not self._length:  # not even the header: the name is free again
            with contextlib.suppress(OSError):
                os.unlink(self._segment_path())
                self._segment_number -= 1

    def _segment_path(self) -> Path:
        return self.path / f"segment-{self._segment_number:06d}.rtr"

    def _sync_to_disk(self) -> None:
        self._synced = time.monotonic()
        if self._file < 0:
            return
        try:
            os.fsync(self._file)
        except OSError as fault:
            self._note_refusal(fault)

    def _end_segment(self) -> None:
        if self._file >= 0:
            self._sync_to_disk()
            os.close(self._file)
            self._file, self._length = -1, 0


def _last_segment(path: Path) -> int:
    found = segments(path)
    return int(found[-1].stem.removeprefix("segment-")) if found else 0


def _lock(file: int, path: Path) -> None:
    """Acquires the lock, which the system releases even where the process is killed."""
    fault: OSError | None = None
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError as cause:
            fault = cause
    else:
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as cause:
            fault = cause
    if fault is not None:
        os.close(file)
        raise ConfigurationError(
            "another process writes to this record.", source=path, hint="another --record folder."
        ) from fault
