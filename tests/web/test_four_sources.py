"""The table of the four sources is true: commands exist, pages answer, CI runs each how-to."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from web_shop import Client

from robotrue.app.registry import listings

ROOT = Path(__file__).resolve().parents[2]
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs/reference/four-sources.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| ")
][1:]


def pages_that_run() -> set[str]:
    """How-to pages whose commands or code a test of the documentation runs."""
    found: set[str] = set()
    for path in (ROOT / "tests/docs").glob("test_*_pages.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and node.targets[0].id == "PAGES":  # type: ignore[attr-defined]
                found |= set(ast.literal_eval(node.value))
    for path in (ROOT / "tests/docs").glob("test_*.py"):
        text = path.read_text(encoding="utf-8")
        found |= set(re.findall(r'check_answers\("([a-z-]+)"', text))
        if "exec(compile(" in text:
            found |= set(re.findall(r"([a-z-]+)\.md\"", text))
    return found


def test_there_is_a_row_for_each_of_the_eighteen() -> None:
    assert len(ROWS) == 18
    assert all(len(row) == 5 and all(row) for row in ROWS)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_row_is_true(row: list[str], client: Client) -> None:
    _, _, commands, pages, guides = row
    words = {each.words: each for each in listings()}
    named = re.findall(r"`([^`]+)`", commands)
    assert named
    assert set(named) <= set(words)
    here = client()
    addresses = re.findall(r"`([^`]+)`", pages)
    for address in addresses:
        shown = here.get(address, headers={"accept-language": "en"})
        assert shown.status_code == 200, address
        assert 'data-testid="fault"' not in shown.text, address
        assert ('data-testid="tool-form"' in shown.text) is address.startswith("/tools/"), address
    offered = {f"/tools/{words[each].name}" for each in named if each != "sense run"}
    assert offered == {each for each in addresses if each.startswith("/tools/")}
    linked = re.findall(r"\(\.\./howto/([a-z-]+)\.md\)", guides)
    assert linked
    assert set(linked) <= pages_that_run()
