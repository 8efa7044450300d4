"""The pages about the dynamic error answer as printed. SIMULATED data, made by their first line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from page_answers import ROOT, check_answers

PAGES = ("multiply-response-and-force", "jin-regression", "sense-the-deviation")


@pytest.mark.parametrize("page", PAGES)
def test_the_answers_of_a_page_are_current(page: str) -> None:
    check_answers(page)


def test_gravity_comes_off_as_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = ROOT / "docs/howto/take-gravity-off.md"
    text = page.read_text(encoding="utf-8")
    code, printed = (
        re.findall(rf"^```{kind}\n(.*?)^```$", text, re.S | re.M)[0] for kind in ("python", "text")
    )
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(page), "exec"), {})  # noqa: S102  our own page
    assert capsys.readouterr().out == printed
