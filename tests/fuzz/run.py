"""Generated and damaged programs by the thousand: ``make fuzz``.

    python tests/fuzz/run.py [--dialects krl,rapid] [--whole 10000] [--damaged 100000] [--seed 1]
                             [--undone 10000] [--seconds 0] [--samples DIR] [--keep DIR]
                             [--limit 5]

Prints a table, one row per dialect, and leaves with 1 if a law was broken: whole programs, those
given back byte for byte at zero correction, those (of the first ``--undone``) that a correction and
its undoing leave within half a digit, those refused because a corrected arc is none, targets moved;
damaged programs, those read and those refused; the slowest of them. ``--seconds`` ends the damage
of a dialect after so much processor time. A row is printed when its dialect is done, broken laws
and progress at once; Ctrl-C or ``kill`` ends the run with the row of what was done. Each kind of
broken case is made smaller and kept in ``--keep``.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from languages import LANGUAGES, Language, frames_of
from laws import Files, read, require_identity, require_undone, survives
from mutated import damaged
from written import Pen

from robotrue.errors import ConfigurationError
from robotrue.program.lang import find_language, language_names

POOL = 300
"""Whole programs that damage starts from."""
PROGRESS = 30.0
"""Seconds of processor time between two lines of progress."""


@dataclass
class Tally:
    """Counts of one dialect."""

    name: str
    whole: int = 0
    identical: int = 0
    undone: int = 0
    unwritten: int = 0
    targets: int = 0
    damaged: int = 0
    read: int = 0
    refused: int = 0
    slowest: float = 0.0
    slowest_case: Files = ()
    begun: float = field(default_factory=time.process_time)
    printed: float = 0.0
    broken: list[tuple[str, Files]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Processor time since it was begun."""
        return time.process_time() - self.begun

    def add_broken(self, case: str, fault: Exception, files: Files) -> None:
        """Keeps a case, and prints it: a run that is cut has told of it."""
        said = f"{case}: {type(fault).__name__}: {fault}".replace("\n", " ")[:300]
        self.broken.append((said, files))
        sys.stderr.write(f"{self.name}: {said}\n")

    def print_progress(self) -> None:
        """One line, no more often than every ``PROGRESS`` seconds."""
        if self.seconds >= self.printed + PROGRESS:
            self.printed = self.seconds
            sys.stderr.write(
                f"{self.name}: {self.whole} whole, {self.damaged} damaged, "
                f"{len(self.broken)} failures, {self.seconds:.0f} s\n"
            )


def whole_programs(
    name: str, language: Language, count: int, undone: int, seed: int, tally: Tally
) -> None:
    """Writes programs and checks that zero is the identity and a correction can be undone."""
    for k in range(count):
        job = language.writer(Pen.of([seed, k]))
        tally.whole += 1
        try:
            programs = read(name, job.files, job.frames)
            require_identity(name, job.files, programs)
            tally.identical += 1
            if k >= undone:
                continue
            tally.targets += require_undone(
                name, job, programs, np.random.default_rng([seed, k, 1])
            )
            tally.undone += 1
        except ConfigurationError:  # neighbours moved a millimetre apart leave some arcs no circle
            tally.unwritten += 1
        except Exception as fault:
            tally.add_broken(f"whole {k}", fault, job.files)
        tally.print_progress()


def damaged_programs(
    name: str, language: Language, seeds: Sequence[Files], count: int, seconds: float, seed: int,
    limit: float, tally: Tally,
) -> None:  # fmt: skip
    """Damages programs and checks that each is read or refused."""
    rng = np.random.default_rng([seed, 7])
    other = [LANGUAGES[each].sample for each in LANGUAGES]
    end = time.process_time() + (seconds or np.inf)
    for k in range(count):
        if time.process_time() > end:
            break
        files = list(seeds[int(rng.integers(len(seeds)))])
        which = int(rng.integers(len(files)))
        strange = other[int(rng.integers(len(other)))]
        file, data = files[which]
        files[which] = (file, damaged(rng, data, language.pieces, strange))
        tally.damaged += 1
        start = time.process_time()
        try:
            was_read = survives(name, tuple(files), frames_of(name), k, limit)
            tally.read += was_read
            tally.refused += not was_read
        except Exception as fault:
            tally.add_broken(f"damaged {k}", fault, tuple(files))
        took = time.process_time() - start
        if took > tally.slowest:
            tally.slowest, tally.slowest_case = took, tuple(files)
        tally.print_progress()


def seeds_of(name: str, language: Language, seed: int, samples: Path | None) -> list[Files]:
    """Whole programs to damage: generated ones, the sample of the tests, files of a folder."""
    out = [language.writer(Pen.of([seed, 3, k])).files for k in range(POOL)]
    out += [((language.name, language.sample),)] * (POOL // 10)
    for path in sorted(samples.rglob("*")) if samples else ():
        if path.is_file() and path.suffix.lower() in find_language(name).suffixes:
            out += [((path.name, path.read_bytes()),)] * (POOL // 30)
    return out


def smaller(name: str, files: Files, said: str, limit: float) -> Files:
    """The files with lines and then bytes left out while the same fault shows."""

    def fails(candidate: Files) -> bool:
        try:
            survives(name, candidate, frames_of(name), 0, limit)
        except Exception as fault:
            return type(fault).__name__ == said.split(": ")[1]
        return False

    for mark in (b"\n", b""):
        for k in range(len(files)):
            size = max(len(files[k][1]) // 2, 1)
            tries = 0
            while size >= 1 and tries < 400:
                parts = files[k][1].split(mark) if mark else [bytes([b]) for b in files[k][1]]
                size = min(size, max(len(parts) - 1, 1))
                at = 0
                while at < len(parts) and tries < 400:
                    less = mark.join(parts[:at] + parts[at + size :])
                    trial = (*files[:k], (files[k][0], less), *files[k + 1 :])
                    tries += 1
                    if len(parts) > 1 and fails(trial):
                        files, parts = trial, parts[:at] + parts[at + size :]
                    else:
                        at += size
                size //= 2
    return files


HEAD = ("dialect", "whole", "identical", "undone", "no arc", "targets", "damaged", "read",
        "refused", "slowest ms", "failures", "CPU s")  # fmt: skip


def print_row(first: object, *cells: object) -> None:
    """One line of the table, at once."""
    sys.stdout.write("  ".join((f"{first!s:12}", *(f"{cell!s:>10}" for cell in cells))) + "\n")
    sys.stdout.flush()


def keep(folder: Path, name: str, broken: list[tuple[str, Files]], limit: float) -> None:
    """Writes the first case of every fault, made smaller."""
    seen: set[str] = set()
    for said, files in broken:
        kind = "".join(c for c in said.split(": ", 1)[1] if not c.isdigit())[:60]
        if kind in seen:
            continue
        seen.add(kind)
        place = folder / name / str(len(seen))
        place.mkdir(parents=True, exist_ok=True)
        (place / "fault.txt").write_text(said + "\n")
        least = smaller(name, files, said, limit) if said.startswith("damaged") else files
        for file, data in least:
            (place / file).write_bytes(data)


def one_dialect(name: str, options: argparse.Namespace, tally: Tally) -> None:
    """Whole and damaged programs of one dialect; its row is printed, broken cases are kept."""
    language = LANGUAGES[name]
    try:
        whole_programs(name, language, options.whole, options.undone, options.seed, tally)
        seeds = seeds_of(name, language, options.seed, options.samples)
        damaged_programs(
            name, language, seeds, options.damaged, options.seconds, options.seed, options.limit,
            tally,
        )  # fmt: skip
    finally:
        t = tally
        print_row(name, t.whole, t.identical, t.undone, t.unwritten, t.targets, t.damaged, t.read,
                  t.refused, round(1e3 * t.slowest), len(t.broken), round(t.seconds))  # fmt: skip
        if options.keep is not None:
            options.keep.mkdir(parents=True, exist_ok=True)
            keep(options.keep, name, tally.broken, options.limit)
            for file, data in tally.slowest_case:
                (options.keep / f"{name}_slowest_{file}").write_bytes(data)


def main() -> int:
    """Runs what the options ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dialects", default="")
    parser.add_argument("--whole", type=int, default=10_000)
    parser.add_argument("--damaged", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--undone", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=0.0)
    parser.add_argument("--samples", type=Path)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--limit", type=float, default=5.0)
    options = parser.parse_args()
    names = [n for n in options.dialects.split(",") if n] or [
        n for n in language_names() if n in LANGUAGES
    ]
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    print_row(*HEAD)
    failures = 0
    try:
        for name in names:
            tally = Tally(name)
            try:
                one_dialect(name, options, tally)
            finally:
                failures += len(tally.broken)
    except KeyboardInterrupt:  # the row of what was done is printed
        sys.stderr.write("stopped\n")
        return 1
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
