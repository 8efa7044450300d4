"""The way of one calibration and of one compensation through the code: files, functions, changes.

It runs ``calibrate cell.toml calibration.csv --method elastic`` and ``compensate model
flange_hole.src`` on what ``robotrue demo`` makes (virtual robot, 80 poses, 5,252 targets), each
twice in one process, and follows the second run of each: nothing is imported or compiled any more.
Counted are calls of named functions of the package in their order, on the main thread. A change of
file is a call in another file than the call before, a change of room likewise. Lambdas,
comprehensions and bodies of modules are not counted, and what runs compiled is invisible.

    python scripts/hops.py                 # about two minutes; the demo is most of it
    python scripts/hops.py --demo demo-out # on the folder of an earlier ``robotrue demo``
    python scripts/hops.py --files         # also the files in the order they are reached
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, Final

MODEL: Final = "hops_model.robotrue"
WAYS: Final = {
    "calibrate": ("calibrate", "cell.toml", "calibration.csv", "--method", "elastic", "-o", MODEL),
    "compensate": ("compensate", MODEL, "flange_hole.src", "-o", "hops_program.src"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Hops:
    """The way of one command.

    Attributes:
        files: Reached, in this order, below the package.
        functions: Number of functions that are called.
        changes_of_file: Between a call and the next one.
        changes_of_room: Likewise.
    """

    files: tuple[str, ...]
    functions: int
    changes_of_file: int
    changes_of_room: int


def follow_command(arguments: Sequence[str]) -> Hops:
    """Returns the way of a command that has run in this process before.

    Raises:
        SystemExit: The command fails.
    """
    import robotrue

    package = str(Path(robotrue.__file__).parent) + os.sep
    called: list[CodeType] = []

    def note(frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(package) and code.co_name[0] != "<":
            called.append(code)

    run_command(arguments)
    sys.setprofile(note)
    try:
        run_command(arguments)
    finally:
        sys.setprofile(None)
    return count_hops([(code.co_filename.removeprefix(package), code) for code in called])


def count_hops(calls: Sequence[tuple[str, object]]) -> Hops:
    """Returns the way through calls, each a file below the package and what is called in it."""
    files = [file for file, _ in calls]
    rooms = [file.split(os.sep)[0] for file in files]
    return Hops(
        files=tuple(dict.fromkeys(files)),
        functions=len({called for _, called in calls}),
        changes_of_file=_changes(files),
        changes_of_room=_changes(rooms),
    )


def _changes(names: Sequence[str]) -> int:
    return sum(one != other for one, other in pairwise(names))


def run_command(arguments: Sequence[str]) -> None:
    """Runs ``robotrue`` in this process, silently.

    Raises:
        SystemExit: It fails.
    """
    from robotrue.cli.main import run

    before, sys.argv = sys.argv, ["robotrue", *arguments]
    told = io.StringIO()
    try:
        with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
            run()
    except SystemExit as ended:
        if ended.code:
            raise SystemExit(f"robotrue {' '.join(arguments)}: {told.getvalue()}") from None
    finally:
        sys.argv = before


@contextlib.contextmanager
def _workplace(demo: Path | None) -> Iterator[Path]:
    """A folder with the files of the demo, which is run where none is given."""
    with tempfile.TemporaryDirectory(prefix="robotrue-hops-") as folder:
        if demo is None:
            run_command(["demo", "--out", folder])
        else:
            for name in ("cell.toml", "calibration.csv", "flange_hole.src"):
                (Path(folder) / name).write_bytes((demo / name).read_bytes())
        yield Path(folder)


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the way of both commands."""
    parser = argparse.ArgumentParser(description="The way of two commands through the code.")
    parser.add_argument("--demo", type=Path, help="folder of an earlier `robotrue demo`")
    parser.add_argument("--files", action="store_true", help="the files in order, too")
    asked = parser.parse_args(arguments)
    sys.stdout.write(f"{'':<12}{'files':>6}{'functions':>11}{'changes of file':>17}  of room\n")
    with _workplace(asked.demo and asked.demo.resolve()) as folder, contextlib.chdir(folder):
        for name, command in WAYS.items():
            way = follow_command(command)
            sys.stdout.write(
                f"{name:<12}{len(way.files):>6}{way.functions:>11}"
                f"{way.changes_of_file:>17}{way.changes_of_room:>9}\n"
            )
            if asked.files:
                sys.stdout.write("".join(f"    {file}\n" for file in way.files))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
