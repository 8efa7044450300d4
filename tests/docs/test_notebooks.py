"""The notebooks of the gallery run, and their saved outputs are those of their cells."""

from __future__ import annotations

import shutil
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from printed_numbers import assert_answers_agree

import robotrue as rt
from robotrue.library.practice import write_practice_cell

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS))

from notebook_pages import execute, notebooks, page_of, read_notebook  # noqa: E402


@pytest.fixture(scope="module")
def practice(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rt.write_practice_cell(tmp_path_factory.mktemp("practice"))


def printed_text(output: dict[str, Any]) -> str:
    parts = {"": output.get("text", []), **output.get("data", {})}
    return "".join(f"{kind}\n{''.join(text)}\n" for kind, text in sorted(parts.items()))


def write_or_copy(source: Path, target: str, *, seed: int | None = None) -> Path:
    """Copies the practice cell that is there already; another seed is another cell."""
    if seed is not None:
        return write_practice_cell(target, seed=seed)
    return Path(shutil.copytree(source, target))


def test_there_are_notebooks_and_the_index_lists_them():
    index = (DOCS / "notebooks" / "index.md").read_text()
    assert len(notebooks()) >= 8
    assert all(f"{path.stem}\n" in index for path in notebooks())


@pytest.mark.parametrize("path", notebooks(), ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_it_saved(path, tmp_path, monkeypatch, request, practice):
    saved, again = read_notebook(path), read_notebook(path)
    if any("ROBOTRUE_DATA" in "".join(cell["source"]) for cell in saved["cells"]):
        monkeypatch.setenv("ROBOTRUE_DATA", str(request.getfixturevalue("data_dir")))
    monkeypatch.setattr(rt, "write_practice_cell", partial(write_or_copy, practice))
    monkeypatch.chdir(tmp_path)
    execute(again, draw=False)
    pictures = page_of(saved, path.stem)[1]
    assert pictures
    assert all(data.startswith(b"\x89PNG") for data in pictures.values())
    for before, after in zip(saved["cells"], again["cells"], strict=True):
        assert "traceback" not in str(before)
        for shown, now in zip(before.get("outputs", ()), after.get("outputs", ()), strict=True):
            if "image/png" not in shown.get("data", {}):
                assert_answers_agree(printed_text(shown), printed_text(now))
