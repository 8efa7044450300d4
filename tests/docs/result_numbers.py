"""Finds where each number printed on a page comes from.

Numbers are decimals, whole numbers with a unit, "N of M" and cells of tables. Each is in a block of
code of its page (console blocks are run, those of another language are input), in a record, or
listed in ``docs/records/sources.toml`` as a quotation or a setting. A record holds what a
benchmark printed, with its command, date and machine, or a test that asserts the number. ``tests``
of a page names tests that compare the page: numbers, or ``text`` for its blocks of that kind.

    python tests/docs/result_numbers.py            # counts by page and class
    python tests/docs/result_numbers.py PAGE ...   # each number of the pages
"""

from __future__ import annotations

import functools
import json
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
SOURCES: Final = ROOT / "docs" / "records" / "sources.toml"
CLASSES: Final = ("run", "record", "quoted", "setting", "unbound")
BLOCK: Final = re.compile(r"^ *```(\{?[\w-]*).*?^ *```$", re.DOTALL | re.MULTILINE)
CODE: Final = re.compile(
    r"`[^`\n]*`|\]\([^)\n]*\)|<!--.*?-->|^ {4,}[^|\n]*$|\$[^$\n]+\$", re.MULTILINE
)
UNIT: Final = (
    r"(?:%|mm|[unmk]?m\b|deg|[mu]?rad|[mun]?s\b|min\b|minutes|seconds|h\b|k?Hz|Nm?\b|kg|g\b"
    r"|[MGKk]i?B|M\b|times|sigma|of \d|CPU)"
)
WHOLE: Final = r"(?:\d{1,3}(?:,\d{3})+|\d+)"
NUMBER: Final = re.compile(
    rf"(?<![\w.^])(?:{WHOLE}\.\d+(?:e-?\d+)?|\.\d+|{WHOLE}(?= ?{UNIT})"
    rf"|(?<=\d of )\d+|(?<=\| ){WHOLE}(?= \|))(?![\w.]*\.\d)"
)
SCALES: Final = {".txt": (1, 100), ".md": (1,), ".py": (1, 100, 1000, 1_000_000)}
"""What a number of a record is multiplied by: pages print percent, mm and um; tests are in SI."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A number of a page, its line and where it comes from: one of :data:`CLASSES`."""

    line: int
    text: str
    source: str


def pages() -> list[Path]:
    """Returns the pages in English and the notebooks; a decision keeps the figures of its day."""
    top = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CONVENTIONS.md")]
    docs = ROOT / "docs"
    notebooks = list((docs / "notebooks").glob("*.ipynb"))
    made = {path.with_suffix(".md") for path in notebooks}  # by a build of the documentation
    found = [*notebooks, *(path for path in docs.rglob("*.md") if path not in made)]
    return [*top, *sorted(p for p in found if not {"_build", "zh", "adr"} & set(p.parts))]


def page_text(page: Path, *, text_is_run: bool) -> tuple[str, str]:
    """Returns prose and code; blocks without a language are prose unless a test compares them."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        prose = ["".join(c["source"]) for c in cells if c["cell_type"] == "markdown"]
        return CODE.sub(" ", "\n".join(prose)), json.dumps(
            [c for c in cells if c["cell_type"] != "markdown"]
        )
    shown = () if text_is_run else ("", "text", "diff")
    code = "\n".join(b[0] for b in BLOCK.finditer(text) if b[1] not in shown)
    prose = BLOCK.sub(lambda b: b[0] if b[1] in shown else "\n" * b[0].count("\n"), text)
    return CODE.sub(" ", prose), code


def value(text: str) -> Decimal:
    """Returns a printed number; commas group thousands."""
    return Decimal(text.replace(",", ""))


@functools.cache
def numbers_of(record: str) -> tuple[Decimal, ...]:
    """Returns all numbers of a record: a file in ``docs/records``, or a path from the root."""
    path = ROOT / record if "/" in record else SOURCES.parent / record
    text = path.read_text(encoding="utf-8")
    found = {value(n) for n in re.findall(r"(?<![\w.])(?:\d[\d,]*)?\.?\d+(?:e-?\d+)?", text)}
    return tuple(number * scale for number in found for scale in SCALES[path.suffix])


def is_in(printed: str, record: str) -> bool:
    """Returns whether a record has the number, rounded to the printed digits."""
    number = value(printed)
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    half = Decimal("0.5001").scaleb(exponent)
    return any(abs(other - number) <= half for other in numbers_of(record))


def find_sources(page: Path) -> Iterator[Printed]:
    """Yields every number of a page."""
    listed = tomllib.loads(SOURCES.read_text(encoding="utf-8"))
    entry = listed.get(page.relative_to(ROOT).as_posix(), {})
    compared = " ".join(entry.get("tests", {}).values()).split()
    prose, code = page_text(page, text_is_run="text" in compared)
    in_code = set(re.findall(r"\d[\d,]*\.?\d*|\.\d+", code))
    for number, line in enumerate(prose.splitlines(), 1):
        for text in NUMBER.findall(line):
            if text in in_code or text in compared:
                source = "run"
            elif any(is_in(text, name) for name in entry.get("records", ())):
                source = "record"
            elif text in entry.get("quoted", "").split():
                source = "quoted"
            elif text in entry.get("settings", "").split():
                source = "setting"
            else:
                source = "unbound"
            yield Printed(number, text, source)
    if page.suffix == ".md":
        for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
            if block[1] == "console":
                yield from (Printed(0, text, "run") for text in NUMBER.findall(block[0]))


def write_counts(count: Counter[str], name: str) -> None:
    """Prints how many numbers each class has."""
    sys.stdout.write(" ".join(f"{count[each]:5d} {each}" for each in CLASSES) + f"  {name}\n")


def main(names: list[str]) -> None:
    """Prints the counts of all pages, or the numbers of some."""
    total: Counter[str] = Counter()
    for page in [Path(name).resolve() for name in names] or pages():
        printed = list(find_sources(page))
        count = Counter(each.source for each in printed)
        total += count
        write_counts(count, str(page.relative_to(ROOT)))
        if names:
            for each in printed:
                sys.stdout.write(f"  {each.line}: {each.text} {each.source}\n")
    write_counts(total, "all pages")


if __name__ == "__main__":
    main(sys.argv[1:])
