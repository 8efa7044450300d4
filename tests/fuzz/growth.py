"""Pieces of a language over and over: what takes more than its share of time.

    python tests/fuzz/growth.py [DIALECT ...]

Every piece stands ``MANY`` times in a row at three places of the sample. What takes more than
``SLOW`` s is tried with a quarter as many; over ``STEEP`` times as long for four times as much is
growth with the square or worse, and printed.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from languages import LANGUAGES, frames_of
from laws import TooSlow, limited, read, require_identity, timed

from robotrue.errors import RobotrueError

MANY = 12_000
SLOW = 0.7
STEEP = 8.0
LIMIT = 60.0


def seconds(name: str, data: bytes) -> float:
    """Processor time of reading and writing; the limit where it is not ready by then."""
    files = ((LANGUAGES[name].name, data),)

    def once() -> None:
        try:
            require_identity(name, files, read(name, files, frames_of(name)))
        except RobotrueError:
            return

    try:
        with limited(LIMIT):
            return timed(once)[1]
    except TooSlow:
        return LIMIT


def grown(sample: bytes, piece: bytes, where: float, count: int) -> bytes:
    """The sample with the piece over and over; a piece that ends a line goes behind one."""
    at = int(where * len(sample))
    if piece.endswith(b"\n"):
        at = sample.find(b"\n", at) + 1
    return sample[:at] + piece * count + sample[at:]


def main() -> int:
    """Tries every piece of the dialects named, or of all."""
    steep = 0
    for name in sys.argv[1:] or LANGUAGES:
        language = LANGUAGES[name]
        pieces = dict.fromkeys([*language.pieces, b" ", b"a", b"a\n", b"1 ", b"(a", b"[1,"])
        rows = language.sample.split(b"\n")
        pieces |= dict.fromkeys(row + b"\n" for row in rows if row.strip())
        for piece in pieces:
            for where in (0.1, 0.5, 0.9) if piece and not piece.endswith(b"\n") else (0.5,):
                long = seconds(name, grown(language.sample, piece, where, MANY))
                if long < SLOW:
                    continue
                short = seconds(name, grown(language.sample, piece, where, MANY // 4))
                if long > STEEP * short or long >= LIMIT:
                    steep += 1
                    sys.stdout.write(
                        f"{name}: {piece[:60]!r} at {where}: {long:.2f} s for {MANY}, "
                        f"{short:.2f} s for {MANY // 4}\n"
                    )
                    sys.stdout.flush()
    return 1 if steep else 0


if __name__ == "__main__":
    sys.exit(main())
