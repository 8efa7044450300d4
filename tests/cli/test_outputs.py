"""Names of files to write: what is written under a name is what the name says."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

import robotrue.cli.main
from robotrue.app.outputs import FORMATS
from robotrue.cli.app import app
from robotrue.program.lang import find_language, language_names

Command = Callable[..., Any]
OWN = {  # refused by the command itself, in its own tests
    ("compensate", "-o"),
    ("dynamics frf", "-o"),
    ("dynamics frf", "--report"),
    ("dynamics predict", "--report"),
    ("map", "-o"),
    ("program", "-o"),
    ("drill report", "-o"),
    ("report calibration", "-o"),
    ("report program", "-o"),
    ("report registration", "-o"),
}
FOLDERS = {("demo", "--out"), ("reproduce", "-o"), ("reproduce", "--data"),
           ("workspace show", "-o"), ("simulate drill", "--write"),
           ("wrap", "--wrap-computed")}  # fmt: skip
READ = {("program", "--post")}
"""Files that are read; their help speaks of what is written."""


def written() -> Iterator[tuple[str, str]]:
    """Every option that names a file or folder to write, with its command."""
    assert robotrue.cli.main.app is app

    def below(command: Any, words: list[str]) -> Iterator[tuple[str, str]]:
        for name, each in getattr(command, "commands", {}).items():
            yield from below(each, [*words, name])
        for option in getattr(command, "params", []):
            says = re.search(
                r"\b(?:Also )?(?:[Ww]rites?|draw)\b", getattr(option, "help", "") or ""
            )
            if option.param_type_name == "option" and ("-o" in option.opts or says):
                if "path" in repr(vars(option)).lower():
                    yield " ".join(words), "-o" if "-o" in option.opts else option.opts[0]

    yield from below(typer.main.get_command(app), [])


CHECKED = sorted({*written()} - OWN - FOLDERS - READ)


def test_every_command_is_looked_at() -> None:
    assert {*written()} >= OWN
    assert len(CHECKED) > 30


@pytest.mark.parametrize(("command", "option"), CHECKED)
def test_a_name_of_another_format_is_refused_before_any_work(
    cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, option: str
) -> None:
    monkeypatch.chdir(tmp_path)
    got = cli(*command.split(), option, "job.JBI")
    assert got.code == 1
    assert "ends in .JBI, as a Yaskawa job does" in got.err
    assert "is written" in got.err
    assert "Try: name it job." in got.err
    assert not list(tmp_path.iterdir())


def test_an_archive_of_a_workspace_is_no_table(cli: Command) -> None:
    assert "an archive is written (.zip)" in cli("workspace", "export", "all.csv").err


def test_a_program_has_the_suffix_of_a_language(
    cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, message in (
        ("job", "no program in any language has the suffix (none); allowed are .ls, "),
        ("job.txt", "no program in any language has the suffix .txt"),
        ("job.dat", "as a KRL point file does; a robot program is written (.src, "),
    ):
        got = cli("program", "cell.toml", "path.csv", "-o", name)
        assert got.code == 1
        assert message in got.err
        assert "Try: name it job." in got.err
    assert not list(tmp_path.iterdir())


def test_a_compensated_program_keeps_its_language(
    cli: Command, shelf: Path, tmp_path: Path
) -> None:
    def at(name: str) -> tuple[int, str]:
        got = cli("compensate", shelf / "model.rtm", shelf / "part.src", "-o", tmp_path / name,
                  "--allow-steps")  # fmt: skip
        return got.code, got.err

    for name in ("part.JBI", "part.html", "part.csv"):
        code, err = at(name)
        assert code == 1
        assert "a program in krl, as part.src is, is written (.src, " in err
        assert not list(tmp_path.iterdir())
    code, err = at("part.new")  # an ending that says nothing
    assert code == 0, err
    assert (tmp_path / "part.new").is_file()


def test_suffixes_of_programs_are_known() -> None:
    own = {suffix for name in language_names() for suffix in find_language(name).suffixes}
    assert own <= set(FORMATS)
