"""Stalls of the whole machine, seen by a thread of highest priority on every processor.

Each sleeps a millisecond by the clock; what it overslept, nobody on that processor could have
used: the host did not run the virtual processor, or the kernel kept it to itself. No answer is
given there then, whoever gives it. A process of its own: ``python benchmarks/machine_stalls.py``
until its input ends, then one line of JSON.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import subprocess
import sys
import threading
import time
from bisect import bisect_left
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

SLEEP = 1e-3
"""s."""
STALL = 1e-3
"""s overslept that are told; the probe's own way through the interpreter is a tenth of it."""
LONGEST = 5.0
"""s; no stall is longer."""
PRIORITY = 90
_LOCK_ALL = 3
"""MCL_CURRENT | MCL_FUTURE: no page of the probe has to be fetched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stalls:
    """What the probes saw.

    Attributes:
        preferred: Whether they had real-time priority; without, their stalls are anybody's.
        seconds: How long they looked.
        found: Processor, begin (s on the clock of the day), length (s); by their begin.
        stolen: s of all processors that the host says it gave to others, of /proc/stat.
    """

    preferred: bool
    seconds: float
    found: tuple[tuple[int, float, float], ...]
    stolen: float

    def within(self, begin: float, end: float) -> float:
        """Returns s of the longest part of a stall that lies between two times of day."""
        first = bisect_left(self.found, begin - LONGEST, key=itemgetter(1))
        last = bisect_left(self.found, end, key=itemgetter(1))
        near = self.found[first:last]
        return max((0.0, *(min(end, a + d) - max(begin, a) for _, a, d in near)))

    def told(self) -> str:
        """Returns a line about them."""
        lengths = [d for _, _, d in self.found]
        how = "" if self.preferred else " (without real-time priority: of the probe)"
        return (
            f"stalls of a processor over {1e3 * STALL:g} ms{how}: {len(lengths)} in "
            f"{self.seconds:.0f} s, together {1e3 * sum(lengths):.0f} ms, longest "
            f"{1e3 * max(lengths, default=0.0):.1f} ms, over 4 ms "
            f"{sum(d > 4e-3 for d in lengths)}; stolen by the host {self.stolen:.2f} s"
        )


class Probe:
    """The probes' process, from entry to exit of the context; then ``stalls``."""

    def __enter__(self) -> Probe:
        self._begun, self._stolen = time.monotonic(), stolen()
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        return self

    def __exit__(self, *_: object) -> None:
        out, _ = self._process.communicate(timeout=10.0)
        told = json.loads(out)
        self.stalls = Stalls(
            preferred=told["preferred"],
            seconds=time.monotonic() - self._begun,
            found=tuple(sorted(((c, t, d) for c, t, d in told["found"]), key=lambda s: s[1])),
            stolen=stolen() - self._stolen,
        )


def stolen() -> float:
    """Returns s that the host has kept from all processors since the start, as it says."""
    line = Path("/proc/stat").read_text().partition("\n")[0].split()
    return int(line[8]) / os.sysconf("SC_CLK_TCK") if len(line) > 8 else 0.0


def watch(processor: int, over: threading.Event, found: list[tuple[int, float, float]]) -> None:
    """Looks at one processor until it is over."""
    os.sched_setaffinity(0, {processor})
    now = time.monotonic()
    while not over.is_set():
        due = now + SLEEP
        time.sleep(SLEEP)
        now = time.monotonic()
        if now - due > STALL:
            found.append((processor, time.time() - (now - due), now - due))


def processor_watch(processor: int) -> None:
    """One probe: a process for each processor, so that none waits for another's interpreter."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        preferred = True
    except OSError:
        preferred = False
    ctypes.CDLL(None).mlockall(_LOCK_ALL)
    gc.disable()
    over, found = threading.Event(), list[tuple[int, float, float]]()
    watching = threading.Thread(target=watch, args=(processor, over, found))
    watching.start()
    sys.stdin.read()
    over.set()
    watching.join()
    sys.stdout.write(json.dumps({"preferred": preferred, "found": found}))


def main() -> None:
    probes = [
        subprocess.Popen(
            [sys.executable, __file__, str(k)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        for k in sorted(os.sched_getaffinity(0))
    ]
    sys.stdin.read()
    told = [json.loads(p.communicate()[0]) for p in probes]
    found = [stall for one in told for stall in one["found"]]
    sys.stdout.write(
        json.dumps({"preferred": all(one["preferred"] for one in told), "found": found})
    )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        processor_watch(int(sys.argv[1]))
    else:
        main()
