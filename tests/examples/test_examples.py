from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
sys.path.insert(0, str(ROOT / "tests" / "docs"))

from printed_numbers import assert_answers_agree  # noqa: E402

PRINTED = {"10_register": "howto/register-a-part.md"}
"""Examples whose output is the text block of a page that names them."""
SCRIPTS = sorted(EXAMPLES.glob("[0-9][0-9]_*.py"))


def test_there_are_examples():
    assert [s.name[:2] for s in SCRIPTS] == [f"{k + 1:02d}" for k in range(len(SCRIPTS))]
    assert len(SCRIPTS) >= 5


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda s: s.stem)
def test_an_example_ends_in_a_number_with_its_uncertainty_and_a_figure(
    script, tmp_path, monkeypatch, capsys
):
    assert len(script.read_text().splitlines()) < 80
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path)])
    runpy.run_path(str(script), run_name="__main__")
    printed = capsys.readouterr().out
    assert "+-" in printed.splitlines()[-1]
    if script.stem in PRINTED:
        text = (ROOT / "docs" / PRINTED[script.stem]).read_text(encoding="utf-8")
        block = re.search(rf"{script.name}.*?```text\n(.*?)```", text, re.DOTALL)
        assert block is not None
        assert_answers_agree(block[1], printed)
    assert (tmp_path / f"{script.stem}.png").stat().st_size > 5000
