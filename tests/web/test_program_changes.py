"""What compensation changed, line by line, and the file under a name of its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from web_shop import Client, Shop

from robotrue.web.parts.changed_lines import SHOWN, ChangedLines, list_changed_lines


@pytest.mark.parametrize(
    ("before", "after", "changed"),
    [
        ("A\nLIN 1\nB\n", "A\nLIN 2\nB\n", [(2, "LIN 1", "LIN 2")]),
        ("A\nLIN 1\nB\n", "A\nLIN 1\nLIN 2\nB\n", [(3, "", "LIN 2")]),
        ("A\nB\n", "A\nB\n", []),
        ("A\nLIN 1\nB\n", "A\nB\n", [(2, "LIN 1", "")]),
        ("A\r\nLIN 1\r\n", "A\r\nLIN 2", [(2, "LIN 1", "LIN 2")]),
    ],
)
def test_changed_lines_stand_beside_what_they_were(
    tmp_path: Path, before: str, after: str, changed: list[tuple[int, str, str]]
) -> None:
    paths = [tmp_path / "before.src", tmp_path / "after.src"]
    for path, text in zip(paths, (before, after), strict=True):
        path.write_text(text)
    assert list_changed_lines(*paths) == ChangedLines(rows=changed)


def _write(folder: Path, *texts: list[str]) -> tuple[Path, Path]:
    before, after = folder / "before.src", folder / "after.src"
    for path, lines in zip((before, after), texts, strict=True):
        path.write_text("".join(f"{line}\n" for line in lines))
    return before, after


def test_changes_far_apart_keep_their_numbers_after_an_insertion(tmp_path: Path) -> None:
    old = [f"LIN {k}" for k in range(2000)]
    new = [*old[:150], "HALT", *old[150:]]
    new[901], new[1901] = "LIN 900.1", "LIN 1900.1"
    found = list_changed_lines(*_write(tmp_path, old, new))
    assert found.rows == [
        (151, "", "HALT"),
        (902, "LIN 900", "LIN 900.1"),
        (1902, "LIN 1900", "LIN 1900.1"),
    ]


def test_the_first_changes_of_many_are_listed(tmp_path: Path) -> None:
    old = [f"LIN {k}" for k in range(1000)]
    found = list_changed_lines(*_write(tmp_path, old, [f"{line}.5" for line in old]))
    assert found == ChangedLines(rows=[(k + 1, f"LIN {k}", f"LIN {k}.5") for k in range(SHOWN)])


def test_a_long_program_is_compared_as_far_as_pages_draw(tmp_path: Path) -> None:
    old = [f"LIN {k}" for k in range(2000)]
    paths = _write(tmp_path, old, [*old[:-1], "LIN 0.5"])
    assert list_changed_lines(*paths).rows == [(2000, "LIN 1999", "LIN 0.5")]
    assert list_changed_lines(*paths, 5000) == ChangedLines(rows=[], whole=False)


def test_a_file_comes_with_a_suffix_on_wish(client: Client, filled: Shop) -> None:
    file = filled.program.files("program")[0]
    address = f"/api/items/program/{filled.program.id}/files/{file.sha256}"
    here = client()
    assert 'filename="part.src"' in here.get(address).headers["content-disposition"]
    named = here.get(f"{address}?suffix=_compensated").headers["content-disposition"]
    assert 'filename="part_compensated.src"' in named
    assert here.get(f"{address}?suffix=../x").status_code == 422
