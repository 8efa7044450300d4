"""README, guides, pages, notebooks, help, catalogues and source use plain technical English."""

from __future__ import annotations

import ast
import io
import json
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from robotrue.app.registry import listings, operation_of
from robotrue.app.request import fields_of

ROOT = Path(__file__).resolve().parents[2]
PAGES: Final = sorted(
    [
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CONVENTIONS.md")),
        *(
            page
            for folder in ("tutorial", "howto", "explanation", "reference", "adr")
            for page in (ROOT / "docs" / folder).glob("*.md")
        ),
    ]
)
CATALOGUES: Final = sorted(
    [
        *(ROOT / "src/robotrue/web/languages/en").glob("*.toml"),
        ROOT / "src/robotrue/report/languages/en.toml",
    ]
)
INSTEAD: Final = {
    r"of (its|their|your) own\b": "its own NOUN, separate, another",
    r"\b(is|are|was|were) (told|said)\b": "is reported, is shown",
    r"\basked for\b": "requested, queued",
    r"\bnobody\b": "un-..., not ...",
    r"\b(is|are) believed\b": "is used, is trusted, prior",
    r"\btaken in\b": "imported",
    r"\bwhoever\b": "the customer, the operator",
    r"\bdoubts? (is|names?|says?|of)\b": "warning",
    r"\bcame of it\b": "result",
    r"\bsay(s)? of (it|them)(self|selves)\b": "state",
    r"\b(tells?|told|begun|stood)\b": "reports, determines; started; was",
    r"\b(somebody|anew)\b": "another user, the operator; again",
    r"\b(becomes? of|found out|passed over|left open)\b": "result, detected, ignored, undetermined",
    r"\bcannot say\b": "does not determine, cannot hold",
    r"\b(how far off|a matter of)\b": "error, depends on",
    r"\bthe other way round\b": "reversed, in reverse order",
    r"\bstands? (still|there|twice|beside|behind)\b": "is at rest, is in, occurs",
    r"\b(does not mind|goes on|knows nothing)\b": "does not affect, continues, ignores",
    r"\bjudge[sd]?\b": "checks, checked",
    r"\bstands? (in|for|at|with|on|out|apart|here)\b": "is in, replaces, is",
    r"\bworth\b": "information gain, benefit",
    r"\b(smooth|learned) rest\b": "smooth residual",
    r"\bsays? (which|what|how|so|that|where|whether)\b": "states, shows, reports",
    r"\b(how|what) (good|far|well|much|many) (it|they|the)\b": "accuracy, distance, number",
    r"\b(put in|taken (off|out|over))\b": "inserted, subtracted",
    r"\b(unless stated|gives? way|all the same|left whole|on paper)\b": "by default; compliant",
}
"""A phrase that is not plain technical English, and what to write instead."""
ROOMS: Final = sorted(
    folder
    for package in ("robotrue", "robotrue_reproductions")
    for folder in (ROOT / "src" / package, *(ROOT / "src" / package).iterdir())
    if folder.is_dir() and any(folder.glob("*.py"))
)
"""Packages below ``src``, and the folder of each with its own files."""
NAMES: Final = re.compile(r"`+[^`\n]*`+|^\s+\**\w+: ", re.MULTILINE)
"""Code in a docstring: names in backticks, and the names of arguments and attributes."""
FENCE: Final = re.compile(r"^ *```.*?^ *```$|`[^`\n]*`|^ {4}[^\n]*$", re.DOTALL | re.MULTILINE)


def find_phrases(text: str) -> list[str]:
    """Returns each phrase of the list with some words around it, and what to write instead."""
    return [
        f"...{text[max(0, hit.start() - 40) : hit.end() + 30]!r}: write {better}"
        for phrase, better in INSTEAD.items()
        for hit in re.finditer(phrase, text, re.IGNORECASE)
    ]


def help_texts() -> Iterator[tuple[str, str]]:
    """Yields the help of every operation and of every option, by name."""
    for listing in listings():
        yield listing.name, listing.help
        for field in fields_of(operation_of(listing.name).request):
            yield f"{listing.name} {field.name}", field.entry.help


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_uses_plain_words(page: Path) -> None:
    assert not find_phrases(FENCE.sub("", page.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    "notebook", sorted((ROOT / "docs/notebooks").glob("*.ipynb")), ids=lambda path: path.stem
)
def test_the_prose_of_a_notebook_uses_plain_words(notebook: Path) -> None:
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    prose = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    assert prose
    assert not find_phrases(FENCE.sub("", "\n\n".join(prose)))


def test_every_help_uses_plain_words() -> None:
    found = {name: phrases for name, text in help_texts() if (phrases := find_phrases(text))}
    assert not found


@pytest.mark.parametrize("catalogue", CATALOGUES, ids=lambda path: f"{path.parts[-4]}-{path.stem}")
def test_the_texts_of_pages_and_reports_use_plain_words(catalogue: Path) -> None:
    texts = re.findall(r'^[\w."\s]+ = "(.*)"$', catalogue.read_text(encoding="utf-8"), re.MULTILINE)
    assert texts
    assert not find_phrases("\n\n".join(texts))


def texts_of(source: str) -> Iterator[tuple[int, str]]:
    """Yields line and text of each comment, docstring and literal of more than one word."""
    parts: set[int] = set()
    for node in ast.walk(ast.parse(source)):  # a formatted string comes before its parts
        if isinstance(node, ast.JoinedStr):
            parts.update(id(each) for each in node.values)
            words = [each.value for each in node.values if isinstance(each, ast.Constant)]
            yield node.lineno, "0".join(map(str, words))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in parts and " " in node.value.strip():
                yield node.lineno, node.value
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


@pytest.mark.parametrize(
    "room", ROOMS, ids=lambda room: room.relative_to(ROOT / "src").as_posix().replace("/", "-")
)
def test_docstrings_comments_and_messages_use_plain_words(room: Path) -> None:
    top = room.parent == ROOT / "src"
    found = [
        f"{path.relative_to(ROOT)}:{line}: {phrase}"
        for path in sorted(room.glob("*.py") if top else room.rglob("*.py"))
        for line, text in texts_of(path.read_text(encoding="utf-8"))
        for phrase in find_phrases(NAMES.sub("", text))
    ]
    assert not found, "\n".join(found)


def test_texts_are_taken_from_source_and_names_are_not() -> None:
    source = """x = "told"  # nobody
def f(told: str) -> str:
    \"""Is told.

    Args:
        told: Nobody, as ``told``.
    \"""
    return f"{told} taken in"
"""
    found = [find_phrases(NAMES.sub("", text)) for _, text in texts_of(source)]
    assert [len(phrases) for phrases in found] == [3, 1, 1]


def test_a_phrase_of_the_list_is_found_in_text_and_not_in_code() -> None:
    text = "The part has a frame of its own.\n```text\nnobody\n```\n`is told`\n    told\nTold.\n"
    assert len(find_phrases(FENCE.sub("", text))) == 2
