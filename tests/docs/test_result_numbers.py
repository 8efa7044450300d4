"""Every number of a page comes from a run block, a record, a test, a quotation or a setting."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from result_numbers import ROOT, SOURCES, find_sources, is_in, pages

LISTED = tomllib.loads(SOURCES.read_text(encoding="utf-8"))


def test_every_printed_number_has_a_source() -> None:
    unbound = [
        f"{page.relative_to(ROOT)}:{each.line}: {each.text}"
        for page in pages()
        for each in find_sources(page)
        if each.source == "unbound"
    ]
    assert not unbound, (
        "\n".join(unbound) + "\nTry: a console block, or benchmarks/record.py and docs/records."
    )


def test_listed_numbers_are_on_their_page() -> None:
    for name, entry in LISTED.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        for kind in ("quoted", "settings"):
            missing = [n for n in entry.get(kind, "").split() if n not in text]
            assert not missing, f"{name}: {kind}"


def test_every_record_is_used_and_states_command_date_and_machine() -> None:
    used = {name for entry in LISTED.values() for name in entry.get("records", ())}
    records = {path.name for path in SOURCES.parent.glob("*.txt")}
    assert records == {name for name in used if "/" not in name}
    for name in records:
        command, run = (SOURCES.parent / name).read_text(encoding="utf-8").splitlines()[:2]
        assert command.startswith("$ ")
        assert re.match(r"\d{4}-\d\d-\d\d, \d+ cores, .*python 3", run), f"{name}: no run"


def test_the_tests_that_compare_a_page_name_it() -> None:
    for name, entry in LISTED.items():
        for test in entry.get("tests", {}):
            assert Path(name).stem in (ROOT / test).read_text(encoding="utf-8"), test


@pytest.mark.parametrize(
    ("printed", "same"), [("0.486", True), ("0.49", True), ("0.487", False), ("0.4861", False)]
)
def test_a_number_agrees_with_its_record_in_the_printed_digits(printed: str, same: bool) -> None:
    assert is_in(printed, "real_arms_ur5.txt") is same
