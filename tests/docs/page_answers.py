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

from printed_numbers import assert_answers_agree

from robotrue.app.operation import Result
from robotrue.cli import terminal
from robotrue.cli.main import run

ROOT = Path(__file__).resolve().parents[2]
OWN: Final = re.compile(
    r"(?:cd (?P<into>\w+) && )?(?P<words>(?:robotrue|python -m robotrue_reproductions)\b[^|<>&;]*?)"
    r"(?:(?P<out> >\s*/dev/null)| > (?P<log>\w+\.log))?"
    r"(?P<err> 2>\s*/dev/null| 2>&1)?(?P<filter> \|[^<>]*)?"
)


@dataclass(frozen=True)
class Ran:
    """What a command printed, what it showed as a result, the files it wrote or changed."""

    answer: str
    results: list[Result]
    files: dict[str, bytes]


_RAN: dict[str, Ran] = {}


def check_answers(page: str, folder: Path | None = None, *, guide: str = "howto") -> list[Result]:
    """Compares the answers printed on a page with those of its commands.

    Args:
        page: Name of the page.
        folder: Empty; takes the files. None: a temporary one.
        guide: Folder of the page below ``docs``.

    Returns:
        The results that the commands showed, in order.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as temporary:
            return check_answers(page, Path(temporary), guide=guide)
    text = (ROOT / "docs" / guide / f"{page}.md").read_text(encoding="utf-8")
    results: list[Result] = []

    def print_answer(command: str, folder: Path) -> str:
        ran = _run_once(command, folder)
        results.extend(ran.results)
        return ran.answer

    renewed = _page_runner().with_answers(text, folder, print_answer)
    assert_answers_agree(text, renewed)
    return results


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


def _run_once(command: str, folder: Path) -> Ran:
    """Runs a command; repeats nothing that began with the same files."""
    before = _read_files(folder)
    digest = hashlib.sha256(command.encode())
    for name, content in before.items():
        digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
    key = digest.hexdigest()
    if key not in _RAN:
        results: list[Result] = []
        printed = _print_here(command, folder, results)
        after = _read_files(folder)
        assert before.keys() <= after.keys(), "a command of a page deleted a file"
        written = {name: text for name, text in after.items() if before.get(name) != text}
        _RAN[key] = Ran(printed, results, written)
    for name, content in _RAN[key].files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return _RAN[key]


def _print_here(command: str, folder: Path, results: list[Result]) -> str:
    own = OWN.fullmatch(command)
    if own is None:
        return str(_page_runner().print_in_shell(command, folder))
    answer = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    dropped = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    piped = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    out = dropped if own["out"] else piped if own["filter"] or own["log"] else answer
    err = {" 2>&1": out, None: answer}.get(own["err"], dropped)
    with _process(folder / (own["into"] or ""), out, err), _results_shown(results):
        _run(shlex.split(own["words"]))
    if own["log"]:
        (folder / own["log"]).write_text(_text(piped), encoding="utf-8")
    if own["filter"]:
        answer.write(_filter(own["filter"].strip(" |"), _text(piped)))
    return _text(answer)


@contextlib.contextmanager
def _results_shown(results: list[Result]) -> Iterator[None]:
    show = terminal.show_result

    def keep_and_show(result: Result, *, as_json: bool) -> None:
        results.append(result)
        show(result, as_json=as_json)

    with mock.patch.object(terminal, "show_result", keep_and_show):
        yield


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
    if words[0] == "robotrue":
        sys.argv = words
        run()
        return
    sys.argv = words[2:]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*found in sys.modules", RuntimeWarning)
        runpy.run_module(words[2], run_name="__main__", alter_sys=True)
