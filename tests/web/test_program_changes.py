"""What compensation changed, line by line, and the file under a name of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from web_shop import Client, Shop

from robotrue.web.parts.changed_lines import list_changed_lines


@pytest.mark.parametrize(
    ("before", "after", "changed"),
    [
        ("A\nLIN 1\nB\n", "A\nLIN 2\nB\n", [(2, "LIN 1", "LIN 2")]),
        ("A\nLIN 1\nB\n", "A\nLIN 1\nLIN 2\nB\n", [(3, "", "LIN 2")]),
        ("A\nB\n", "A\nB\n", []),
    ],
)
def test_changed_lines_stand_beside_what_they_were(
    tmp_path: Path, before: str, after: str, changed: list[tuple[int, str, str]]
) -> None:
    paths = [tmp_path / "before.src", tmp_path / "after.src"]
    for path, text in zip(paths, (before, after), strict=True):
        path.write_text(text)
    assert list_changed_lines(*paths) == changed


def test_a_file_comes_with_a_suffix_on_wish(client: Client, filled: Shop) -> None:
    file = filled.program.files("program")[0]
    address = f"/api/items/program/{filled.program.id}/files/{file.sha256}"
    here = client()
    assert 'filename="part.src"' in here.get(address).headers["content-disposition"]
    named = here.get(f"{address}?suffix=_compensated").headers["content-disposition"]
    assert 'filename="part_compensated.src"' in named
    assert here.get(f"{address}?suffix=../x").status_code == 422
