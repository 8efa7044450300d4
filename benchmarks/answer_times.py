"""Packets of a controller and answers to them, with the times the system gives them on the way.

What is measured is neither what the controller counts nor what we say: a socket that hears all of
the loopback interface, and the kernel's stamp of each datagram at the moment it is put into its
receiver's socket. A process of its own: ``python benchmarks/answer_times.py PORT FILE`` until its
input ends, PORT ours. Needs the right to hear an interface (CAP_NET_RAW).
"""

from __future__ import annotations

import ctypes
import re
import socket
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_IPOC = re.compile(rb"<IPOC>(\d+)</IPOC>")
_STAMP, _FILTER, _FORCE = 35, 26, 33
"""SO_TIMESTAMPNS, SO_ATTACH_FILTER, SO_RCVBUFFORCE of Linux."""
_ROOM = 1 << 25
_ALL = 3
_COMING = 0
"""PACKET_HOST; the loopback shows every packet once more on its way out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerTimes:
    """First packet and first answer of every IPOC.

    Attributes:
        ipoc: (n,) of the packets.
        came: (n,) s of day, when the packet was in our socket.
        answered: (n,) s of day, when the answer was in the controller's; NaN where none was given.
    """

    ipoc: np.ndarray
    came: np.ndarray
    answered: np.ndarray

    @property
    def took(self) -> np.ndarray:
        """(n,) s."""
        return self.answered - self.came


class Tap:
    """Hears the interface from entry to exit of the context; then ``times``, or None unheard."""

    def __init__(self, port: int, folder: Path) -> None:
        self._port, self._file = port, folder / "answers.npy"
        self.times: AnswerTimes | None = None

    def __enter__(self) -> Tap:
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve()), str(self._port), str(self._file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        if self._process.stdout is not None:
            self._process.stdout.readline()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate(timeout=30.0)
        if self._process.returncode:
            return
        rows = np.load(self._file)
        ours = rows[:, 1] != 0
        ipoc, first = np.unique(rows[~ours, 0], return_index=True)
        came = rows[~ours][first, 2] * 1e-9
        answers, first = np.unique(rows[ours, 0], return_index=True)
        answered = np.full(len(ipoc), np.nan)
        _, packet, answer = np.intersect1d(ipoc, answers, return_indices=True)
        answered[packet] = rows[ours][first[answer], 2] * 1e-9
        self.times = AnswerTimes(ipoc=ipoc, came=came, answered=answered)


def only_port(link: socket.socket, port: int) -> None:
    """Has the kernel pass on UDP from and to a port alone."""
    code = [
        (0x30, 0, 0, 9),  # protocol
        (0x15, 0, 6, socket.IPPROTO_UDP),
        (0xB1, 0, 0, 0),  # length of the head
        (0x48, 0, 0, 0),  # port it comes from
        (0x15, 2, 0, port),
        (0x48, 0, 0, 2),  # port it goes to
        (0x15, 0, 1, port),
        (0x06, 0, 0, 0xFFFF),
        (0x06, 0, 0, 0),
    ]
    text = b"".join(struct.pack("HBBI", *line) for line in code)
    room = ctypes.create_string_buffer(text)
    link.setsockopt(
        socket.SOL_SOCKET, _FILTER, struct.pack("HL", len(code), ctypes.addressof(room))
    )


def listen(port: int, file: str) -> None:
    """Hears until the input ends, then writes rows of IPOC, whether it is an answer, ns of day."""
    link = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(_ALL))
    only_port(link, port)
    link.setsockopt(socket.SOL_SOCKET, _FORCE, _ROOM)
    link.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
    link.bind(("lo", _ALL))
    link.settimeout(0.2)
    sys.stdout.write("\n")
    sys.stdout.flush()
    rows: list[tuple[int, bool, int]] = []
    over = False
    while not over:
        over = bool(_ended())
        while True:
            try:
                data, told, _, address = link.recvmsg(65535, 64)
            except TimeoutError:
                break
            found = _IPOC.search(data)
            if address[2] != _COMING or found is None:
                continue
            head = 4 * (data[0] & 15)
            seconds, nanoseconds = struct.unpack("@qq", told[0][2])
            comes_from = int.from_bytes(data[head : head + 2], "big")
            rows.append((int(found[1]), comes_from == port, seconds * 10**9 + nanoseconds))
    np.save(file, np.array(rows, dtype=np.int64).reshape(-1, 3))


def _ended() -> list[object]:
    import select

    ready = select.select([sys.stdin], [], [], 0)[0]
    return list(ready)


if __name__ == "__main__":
    listen(int(sys.argv[1]), sys.argv[2])
