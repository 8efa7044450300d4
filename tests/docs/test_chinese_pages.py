"""The pages in Chinese print the numbers and the commands of the English pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import pytest

DOCS: Final = Path(__file__).resolve().parents[2] / "docs"
ENGLISH: Final = {
    "first-calibration": "tutorial/first-calibration.md",
    "compensate-a-program": "howto/compensate-a-program.md",
    "register-a-part": "howto/register-a-part.md",
    "check-for-drift": "howto/check-for-drift.md",
    "workbench": "howto/workbench.md",
}
"""Page in Chinese, and the page in English whose answers the tests compare with the commands."""
NUMBER: Final = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.]*\.\d)|(?<![\w.-])\d{2,}(?![\w.-])")
BLOCK: Final = re.compile(r"^```console\n.*?^```$", re.DOTALL | re.MULTILINE)
COMMAND: Final = re.compile(r"^(?:robotrue|cp|pip) .*$", re.MULTILINE)


def read_pages(name: str) -> tuple[str, str]:
    """Returns the text of a page in Chinese and in English."""
    chinese = (DOCS / "zh" / f"{name}.md").read_text(encoding="utf-8")
    return chinese, (DOCS / ENGLISH[name]).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ENGLISH)
def test_every_number_stands_in_the_english_page(name: str) -> None:
    chinese, english = read_pages(name)
    assert set(NUMBER.findall(chinese)) <= set(NUMBER.findall(english))


@pytest.mark.parametrize("name", ENGLISH)
def test_answers_of_commands_are_those_of_the_english_page(name: str) -> None:
    chinese, english = read_pages(name)
    assert set(BLOCK.findall(chinese)) <= set(BLOCK.findall(english))


@pytest.mark.parametrize("name", ENGLISH)
def test_every_command_stands_in_the_english_page(name: str) -> None:
    chinese, english = read_pages(name)
    for command in COMMAND.findall(chinese):
        assert command.partition("  #")[0] in english, command


def test_every_page_in_chinese_is_compared() -> None:
    pages = {path.stem for path in (DOCS / "zh").glob("*.md")}
    assert pages == {*ENGLISH, "index", "glossary"}
