"""Dockerfile and conda recipe agree with the package and its commands."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from typer.main import get_command

from robotrue.cli.main import app

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA = {"matplotlib": "matplotlib-base", "uvicorn": "uvicorn-standard", "npTDMS": "nptdms"}
"""Names that conda-forge spells otherwise."""


def of_extra(name: str) -> set[tuple[str, str]]:
    """Names and versions of an extra, those of the extras it names included."""
    listed = PROJECT["optional-dependencies"][name] if name else PROJECT["dependencies"]
    found: set[tuple[str, str]] = set()
    for requirement in map(Requirement, listed):
        if requirement.name == "robotrue":
            found |= set().union(*map(of_extra, requirement.extras))
        else:
            name = CONDA.get(requirement.name, requirement.name)
            found.add((name, str(requirement.specifier)))
    return found


def test_the_conda_recipe_needs_what_the_package_needs() -> None:
    recipe = (ROOT / "packaging/conda/meta.yaml").read_text(encoding="utf-8")
    run = recipe.partition("  run:\n")[2].partition("\n\n")[0]
    stated = dict(re.findall(r"^    - (\S+) (\S+)$", run, re.MULTILINE))
    assert stated.pop("python") == PROJECT["requires-python"]
    wanted: dict[str, str] = {}
    for name, version in sorted(of_extra("") | of_extra("all")):
        # Two extras may state a library; the stricter one counts.
        larger = max(wanted.get(name, version), version, key=_numbers)
        wanted[name] = larger
    assert stated == wanted


def _numbers(version: str) -> list[int]:
    return [int(each) for each in re.findall(r"\d+", version)]


@pytest.mark.parametrize("line", ["CMD", "RUN robotrue"])
def test_the_image_runs_commands_that_exist(line: str) -> None:
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    (found,) = (each for each in text.splitlines() if each.startswith(line))
    words = json.loads(found[4:]) if line == "CMD" else shlex.split(found[4:])
    assert words[0] == "robotrue"
    command = get_command(app).get_command(None, words[1])  # type: ignore[attr-defined]
    options = {name for parameter in command.params for name in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options


def test_the_image_installs_an_extra_that_exists() -> None:
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    (extra,) = re.findall(r'"/src\[(\w+)\]"', text)
    assert extra in PROJECT["optional-dependencies"]
