"""Runs the commands of a how-to page and compares what they answer with what is printed there.

Our own commands run in this process, which has imported the package and its kernels already;
everything else runs in a shell. A command that found the same files before is not repeated.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import re
import runpy
import shlex
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Final
from unittest import mock

ROOT = Path(__file__).resolve().parents[2]
OWN: Final = re.compile(
    r"(?:cd (?P<into>\w+) && )?(?P<words>(?:robotrue|python -m robotrue_reproductions)\b[^|<>]*?)"
    r"(?P<out> >\s*/dev/null)?(?P<err> 2>\s*/dev/null| 2>&1)?(?P<filter> \|[^<>]*)?"
)


@dataclass(frozen=True)
class Ran:
    """What a command printed and the files it wrote or changed."""

    answer: str
    files: dict[str, bytes]


_RAN: dict[str, Ran] = {}


def check_answers(page: str) -> None:
    """Compares the answers printed on a page of the how-to with those of its commands."""
    text = (ROOT / "docs" / "howto" / f"{page}.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        assert _page_runner().with_answers(text, Path(folder), _print_once) == text


@functools.cache
def _page_runner() -> ModuleType:
    names = runpy.run_path(str(ROOT / "docs" / "run_examples.py"))
    runner = ModuleType("run_examples")
    runner.__dict__.update(names)
    return runner


def _read_files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _print_once(command: str, folder: Path) -> str:
    """Returns what a command prints; repeats nothing that began with the same files."""
    before = _read_files(folder)
    digest = hashlib.sha256(command.encode())
    for name, content in before.items():
        digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
    key = digest.hexdigest()
    if key not in _RAN:
        printed = _print_here(command, folder)
        after = _read_files(folder)
        assert before.keys() <= after.keys(), "a command of a page deleted a file"
        written = {name: text for name, text in after.items() if before.get(name) != text}
        _RAN[key] = Ran(printed, written)
    for name, content in _RAN[key].files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return _RAN[key].answer


def _print_here(command: str, folder: Path) -> str:
    own = OWN.fullmatch(command)
    if own is None:
        return str(_page_runner().print_in_shell(command, folder))
    answer = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    dropped = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    piped = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    out = dropped if own["out"] else piped if own["filter"] else answer
    err = {" 2>&1": out, None: answer}.get(own["err"], dropped)
    with _process(folder / (own["into"] or ""), out, err):
        _run(shlex.split(own["words"]))
    if own["filter"]:
        answer.write(_filter(own["filter"].strip(" |"), _text(piped)))
    return _text(answer)


def _text(stream: io.TextIOWrapper) -> str:
    stream.flush()
    content = stream.buffer
    assert isinstance(content, io.BytesIO)
    return content.getvalue().decode()


def _filter(command: str, text: str) -> str:
    return subprocess.run(  # noqa: S603  the commands stand in our own pages
        ["/bin/sh", "-c", command], input=text, stdout=subprocess.PIPE, text=True, check=False
    ).stdout


@contextlib.contextmanager
def _process(folder: Path, out: io.TextIOWrapper, err: io.TextIOWrapper) -> Iterator[None]:
    """What a process of its own would have: a folder, a width, streams, arguments."""
    with (
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, COLUMNS="100"),
        mock.patch.object(sys, "argv", list(sys.argv)),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        contextlib.suppress(SystemExit),
    ):
        yield


def _run(words: list[str]) -> None:
    from robotrue.cli.main import run

    if words[0] == "robotrue":
        sys.argv = words
        run()
        return
    sys.argv = words[2:]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*found in sys.modules", RuntimeWarning)
        runpy.run_module(words[2], run_name="__main__", alter_sys=True)
