from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
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
    last = capsys.readouterr().out.splitlines()[-1]
    assert "+-" in last
    assert (tmp_path / f"{script.stem}.png").stat().st_size > 5000
