"""Generated and damaged programs by the thousand: ``make fuzz``.

    python tests/fuzz/run.py [--dialects krl,rapid] [--whole 10000] [--damaged 100000] [--seed 1]
                             [--undone 10000] [--seconds 0] [--samples DIR] [--keep DIR]
                             [--limit 5]

Prints a table, one row per dialect, and leaves with 1 if a law was broken: whole programs, those
given back byte for byte at zero correction, those (of the first ``--undone``) that a correction and
its undoing leave within half a digit, those refused because a corrected arc is none, targets moved;
damaged programs, those read and those refused; the slowest of them. ``--seconds`` ends the damage
of a dialect after so much processor time, Ctrl-C everything; the table is of what was done. Each
kind of broken case is made smaller and kept in ``--keep``.
"""

from __future__ import annotations

import argparse
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


@dataclass
class Tally:
    """Counts of one dialect."""

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
    seconds: float = 0.0
    broken: list[tuple[str, Files]] = field(default_factory=list)


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
            tally.targets += require_undone(name, job, np.random.default_rng([seed, k, 1]))
            tally.undone += 1
        except ConfigurationError:  # neighbours moved a millimetre apart leave some arcs no circle
            tally.unwritten += 1
        except Exception as fault:
            tally.broken.append((f"whole {k}: {_said(fault)}", job.files))


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
            tally.broken.append((f"damaged {k}: {_said(fault)}", tuple(files)))
        took = time.process_time() - start
        if took > tally.slowest:
            tally.slowest, tally.slowest_case = took, tuple(files)


def _said(fault: Exception) -> str:
    return f"{type(fault).__name__}: {fault}".replace("\n", " ")[:300]


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


def table(tallies: dict[str, Tally]) -> str:
    """One row per dialect."""
    head = ("dialect", "whole", "identical", "undone", "no arc", "targets", "damaged", "read",
            "refused", "slowest ms", "failures", "CPU s")  # fmt: skip
    rows = [
        (name, t.whole, t.identical, t.undone, t.unwritten, t.targets, t.damaged, t.read, t.refused,
         f"{1e3 * t.slowest:.0f}", len(t.broken), f"{t.seconds:.0f}")
        for name, t in tallies.items()
    ]  # fmt: skip
    text = [[str(cell) for cell in row] for row in (head, *rows)]
    width = [max(len(row[k]) for row in text) for k in range(len(head))]
    return "\n".join(
        "  ".join(c.ljust(w) if k == 0 else c.rjust(w)
                  for k, (c, w) in enumerate(zip(row, width, strict=True)))
        for row in text
    )  # fmt: skip


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
    """Whole and damaged programs of one dialect; what was broken is said and kept."""
    language = LANGUAGES[name]
    start = time.process_time()
    try:
        whole_programs(name, language, options.whole, options.undone, options.seed, tally)
        seeds = seeds_of(name, language, options.seed, options.samples)
        damaged_programs(
            name, language, seeds, options.damaged, options.seconds, options.seed, options.limit,
            tally,
        )  # fmt: skip
    finally:
        tally.seconds = time.process_time() - start
    for said, _ in tally.broken[:10]:
        sys.stderr.write(f"{name}: {said}\n")
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
    tallies: dict[str, Tally] = {}
    try:
        for name in names:
            tallies[name] = Tally()
            one_dialect(name, options, tallies[name])
            sys.stderr.write(table({name: tallies[name]}) + "\n")
    except KeyboardInterrupt:  # what was done so far is worth a table
        sys.stderr.write("stopped\n")
    sys.stdout.write(table(tallies) + "\n")
    return 1 if any(t.broken for t in tallies.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
