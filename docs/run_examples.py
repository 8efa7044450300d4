"""Runs the commands of a page and writes what they answer below them.

Every block ```` ```console ```` of a page is run in order, in one new folder per page; lines that
begin with ``$ `` are the commands, everything else in the block is replaced by their output. A
comment ``<!-- keep 12 -->`` before a block keeps the first 12 lines of each answer.

    python docs/run_examples.py docs/tutorial/first-calibration.md [...]
    python docs/run_examples.py --check docs/tutorial/first-calibration.md

With ``--check`` nothing is written; exit 1 says that a page is out of date.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

BLOCK: Final = re.compile(
    r"(?P<open>(?:<!-- keep (?P<keep>\d+) -->\n)?```console\n)(?P<body>.*?)(?P<close>^```$)",
    re.DOTALL | re.MULTILINE,
)


def print_in_shell(command: str, folder: Path) -> str:
    """Returns stdout and stderr of one command, as a terminal would mix them."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "100"}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"
    done = subprocess.run(  # noqa: S603  the commands stand in our own pages
        ["/bin/sh", "-c", command],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.stdout


def shorten(printed: str, keep: int | None) -> str:
    """Returns the lines of an answer that a page shows: not the empty ones, ``keep`` at most."""
    lines = [line.rstrip() for line in printed.splitlines()]
    lines = [line for line in lines if line]
    if keep is not None and len(lines) > keep:
        lines = [*lines[:keep], "..."]
    return "".join(f"{line}\n" for line in lines)


def with_answers(
    text: str, folder: Path, print_answer: Callable[[str, Path], str] = print_in_shell
) -> str:
    """Returns the page with every answer renewed.

    Args:
        text: The page.
        folder: Empty; the commands run there, in order.
        print_answer: Runs a command in a folder and returns what it prints.
    """

    def renewed(block: re.Match[str]) -> str:
        keep = None if block["keep"] is None else int(block["keep"])
        out = block["open"]
        for line in block["body"].splitlines():
            if line.startswith("$ "):
                out += f"{line}\n{shorten(print_answer(line[2:], folder), keep)}"
        return out + block["close"]

    return BLOCK.sub(renewed, text)


def main(arguments: list[str]) -> int:
    """Renews or checks the pages named."""
    check = "--check" in arguments
    stale = []
    for name in (a for a in arguments if a != "--check"):
        page = Path(name)
        text = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            new = with_answers(text, Path(folder))
        if new != text:
            stale.append(name)
            if not check:
                page.write_text(new, encoding="utf-8")
    for name in stale:
        sys.stderr.write(f"{'out of date' if check else 'renewed'}: {name}\n")
    return 1 if check and stale else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
