"""Score of the tests on planted faults: a seeded sample of mutants of src, nearest tests first.

    python scripts/mutants.py --sample 300 --seed 1 [--rooms robot,store] [--out mutants.jsonl]

A mutant is one small change that Cosmic Ray knows: an operator, a comparison, a number, a branch.
Files are drawn in proportion to their length, then a line, then one of the changes that fit there.
The tree is copied; nothing in the checkout changes. For each mutant the test files that import its
module run first, then the test folder of its room. The first failure kills. A survivor is a change
without effect or shows a missing assertion: a reader decides. Survivors are printed as diffs.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numba  # noqa: F401 - imported once, for all runs of tests
import pytest
import scipy.optimize
import scipy.stats  # noqa: F401
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

HOME: Final = Path(__file__).resolve().parents[1]
PARTS: Final = ("src", "tests", "docs", "examples", "benchmarks", "scripts")
SKIPPED: Final = ("NoOp", "BitOr", "RemoveDecorator", "ExceptionReplacer")
"""Types are written with |; decorators (slots, frozen) are left alone: they change no result."""
FOLDERS: Final = ("properties", "contracts", "cli", "truths", "online", "web", "simulation")
"""Of tests, after the folder of a room itself; the quick ones first."""
ALSO: Final = {"app": ("cli", "web")}
"""Folders of tests that ask for a room through its shells; its own has few."""
NEAREST: Final = 5
"""Test files that import a module and run before the folder of its room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One change and its outcome: killed, timeout, survived, or untested (no tests found)."""

    room: str
    file: str
    line: int
    operator: str
    diff: str
    outcome: str
    seconds: float


def find_mutations(code: str) -> list[tuple[int, str, int]]:
    """Returns line, operator and occurrence of each change that fits."""
    tree, lines, found = get_ast(code), code.split("\n"), []
    for name in operator_names():
        operator = get_operator(name)
        if operator.arguments() or any(word in name for word in SKIPPED):
            continue
        spots = (spot for node in ast_nodes(tree) for spot in operator().mutation_positions(node))
        found += [(start[0], name, k) for k, (start, _) in enumerate(spots)]
    return [mutation for mutation in found if not lines[mutation[0] - 1].lstrip().startswith("@")]


def draw_mutants(
    tree: Path, rooms: list[str], count: int, seed: int
) -> Iterator[tuple[Path, int, str, str]]:
    """Yields file, line, operator and the changed code."""
    files = [f for room in rooms for f in sorted((tree / "src/robotrue" / room).rglob("*.py"))]
    lengths = [f.read_text(encoding="utf-8").count("\n") for f in files]
    generator = random.Random(seed)  # noqa: S311
    drawn: set[tuple[Path, str, int]] = set()
    while len(drawn) < count:
        (file,) = generator.choices(files, lengths)
        code = file.read_text(encoding="utf-8")
        mutations = find_mutations(code)
        if not mutations:
            continue
        line = generator.choice(sorted({mutation[0] for mutation in mutations}))
        _, name, occurrence = generator.choice([m for m in mutations if m[0] == line])
        changed = mutate_code(code, get_operator(name)(), occurrence)
        if changed not in (None, code) and (file, name, occurrence) not in drawn:
            drawn.add((file, name, occurrence))
            yield file, line, name.split("/")[-1], changed


def nearest_tests(tree: Path, file: Path) -> list[list[str]]:
    """Returns the test files that import a module, and the test folder of its room."""
    dotted = ".".join(file.relative_to(tree / "src").with_suffix("").parts)
    package, _, stem = dotted.rpartition(".")
    imports = re.compile(rf"{re.escape(dotted)}\b|from {re.escape(package)} import .*\b{stem}\b")
    room = dotted.split(".")[1]
    order = {name: k for k, name in enumerate((room, *FOLDERS))}
    hits = [
        test
        for test in (tree / "tests").rglob("test_*.py")
        if imports.search(test.read_text(encoding="utf-8"))
    ]
    hits.sort(key=lambda test: (order.get(test.relative_to(tree / "tests").parts[0], 99), test))
    folders = [tree / "tests" / name for name in (room, *ALSO.get(room, ()))]
    stages = [
        [str(test) for test in hits[:NEAREST]],
        *([str(folder)] for folder in folders if folder.is_dir()),
    ]
    return [stage for stage in stages if stage]


def run_tests(tree: Path, tests: list[str], seconds: float) -> str:
    """Runs tests in a child process; returns survived, killed or timeout."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setsid()
            os.chdir(tree)
            sys.path.insert(0, str(tree / "src"))
            os.environ["PYTHONPATH"] = str(tree / "src")
            with open(os.devnull, "w") as nothing:
                os.dup2(nothing.fileno(), 1)
                os.dup2(nothing.fileno(), 2)
            words = ["-x", "-q", "-p", "no:cacheprovider", "--assert=plain", *tests]
            code = int(pytest.main(words))
        finally:
            os._exit(code)
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return "survived" if os.waitstatus_to_exitcode(status) == 0 else "killed"
        time.sleep(0.05)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "timeout"


def try_mutant(tree: Path, file: Path, changed: str, seconds: float) -> str:
    """Returns the outcome of a mutant; the file is as it was afterwards."""
    before, outcome = file.read_bytes(), "untested"
    file.write_text(changed, encoding="utf-8")
    try:
        for tests in nearest_tests(tree, file):
            outcome = run_tests(tree, tests, seconds)
            if outcome != "survived":
                break
    finally:
        file.write_bytes(before)
    return outcome


def main() -> None:
    """Draws, runs, and prints the score of each room."""
    rooms = sorted(p.parent.name for p in (HOME / "src/robotrue").glob("*/__init__.py"))
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--sample", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", default=",".join(rooms))
    parser.add_argument("--seconds", type=float, default=900.0, help="limit of one run of tests")
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"))
    asked = parser.parse_args()
    outcomes: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, asked.out.open("a") as out:
        tree = Path(folder)
        shutil.copy2(HOME / "pyproject.toml", tree)
        for part in PARTS:
            shutil.copytree(HOME / part, tree / part)
        drawn = draw_mutants(tree, asked.rooms.split(","), asked.sample, asked.seed)
        for file, line, operator, changed in drawn:
            code, begun = file.read_text(encoding="utf-8").split("\n"), time.monotonic()
            diff = list(difflib.unified_diff(code, changed.split("\n"), n=1, lineterm=""))[3:]
            outcome = try_mutant(tree, file, changed, asked.seconds)
            name, seconds = str(file.relative_to(tree / "src/robotrue")), time.monotonic() - begun
            room = name.split("/")[0]
            mutant = Mutant(
                room=room, file=name, line=line, operator=operator, diff="\n".join(diff),
                outcome=outcome, seconds=round(seconds, 1),
            )  # fmt: skip
            outcomes[room, outcome] += 1
            out.write(json.dumps(asdict(mutant)) + "\n")
            out.flush()
            told = "" if outcome in ("killed", "timeout") else f"\n{mutant.diff}"
            sys.stdout.write(f"{outcome:9} {name}:{line} {operator} {seconds:.0f} s{told}\n")
            sys.stdout.flush()
    for (room, outcome), count in sorted(outcomes.items()):
        sys.stdout.write(f"{room:14} {outcome:9} {count}\n")
    noticed = sum(n for (_, outcome), n in outcomes.items() if outcome in ("killed", "timeout"))
    sys.stdout.write(f"{noticed} of {outcomes.total()} noticed; seed {asked.seed}\n")


if __name__ == "__main__":
    main()
