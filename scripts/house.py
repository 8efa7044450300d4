"""The state of the house: sizes of rooms, files and functions, circles, names, as one table.

``python scripts/house.py`` prints it. ``--against REV`` prints before -> after, ``--json`` all of
it with every place, ``--places MEASURE`` the places of one measure.
``--check`` fails where a circle between files is not one of :data:`KNOWN_CIRCLES`, or a file is
too long.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from house_measures import LONGEST_FILE, LONGEST_FUNCTION, MOST_OF_A_NAME, House, measure_house
from house_tree import read_tree

KNOWN_CIRCLES: Final[frozenset[tuple[str, ...]]] = frozenset()
"""Groups of modules that are allowed to import each other until they are mended."""
PLACES: Final = (
    "circles", "double_classes", "frequent_files", "long_files", "long_functions", "participles",
    "same_defaults", "different_defaults",
)  # fmt: skip
ROWS: Final[Sequence[tuple[str, Callable[[House], int | float]]]] = (
    ("files", lambda h: h.files),
    ("lines", lambda h: h.lines),
    ("import lines, %", lambda h: round(100.0 * h.import_lines / max(h.lines, 1), 1)),
    ("docstrings", lambda h: h.docstrings),
    ("docstring lines", lambda h: h.docstring_lines),
    ("comment lines", lambda h: h.comment_lines),
    ("files with compiled kernels", lambda h: h.kernel_files),
    ("lines in them", lambda h: h.kernel_lines),
    ("uses of Any", lambda h: h.any_uses),
    ("functions", lambda h: h.functions),
    *(
        (f"function lines, {name}", lambda h, name=name: h.function_lengths[name])
        for name in ("p50", "p90", "p99", "max")
    ),
    (f"functions over {LONGEST_FUNCTION} lines", lambda h: len(h.long_functions)),
    (f"files over {LONGEST_FILE} lines", lambda h: len(h.long_files)),
    ("circles between files", lambda h: len(h.circles)),
    ("public class names used twice or more", lambda h: len(h.double_classes)),
    (f"file names used more than {MOST_OF_A_NAME} times", lambda h: len(h.frequent_files)),
    ("functions named by a participle", lambda h: len(h.participles)),
    ("defaults spelled in several places", lambda h: len(h.same_defaults)),
    ("defaults that differ under one name", lambda h: len(h.different_defaults)),
)


def print_table(today: House, before: House | None) -> Iterator[str]:
    """Yields the lines of the table; with another state, before -> after."""

    def cell(now: float, then: float | None) -> str:
        return f"{now:>9,}" if then is None else f"{then:>9,} -> {now:>9,}   {now - then:+,g}"

    rooms = sorted({*today.rooms, *(before.rooms if before else {})})
    yield f"{'room':<23}{'files':>6}  lines"
    for room in rooms:
        files, lines = today.rooms.get(room, (0, 0))
        then = before.rooms.get(room, (0, 0))[1] if before else None
        yield f"{room or '(beside rooms)':<23}{files:>6}  {cell(lines, then)}"
    yield ""
    for name, value in ROWS:
        yield f"{name:<40}{cell(value(today), value(before) if before else None)}"


CURES: Final = {
    "double_classes": "name them by what each is.",
    "frequent_files": "name files by what they hold.",
    "same_defaults": "state the default once, or its reason in defaults_allowed.toml.",
    "different_defaults": "state the default once, or its reason in defaults_allowed.toml.",
}
"""Measures that have to be empty, and what to do otherwise."""


def failures(house: House) -> Iterator[str]:
    """Yields what must not be: circles, files that are too long, names and defaults twice."""
    for circle in house.circles:
        if circle not in KNOWN_CIRCLES:
            yield f"circle: {' <-> '.join(circle)}; move what both need to a third file."
    for known in sorted(KNOWN_CIRCLES - set(house.circles)):
        yield f"the circle {' <-> '.join(known)} is gone; take it out of KNOWN_CIRCLES."
    for place in house.long_files:
        yield f"{place} lines, allowed are {LONGEST_FILE}; split it by what its parts are about."
    document = house.document()
    for measure, cure in CURES.items():
        for name, places in document[measure].items():
            yield f"{name}: {'  '.join(places)}; {cure}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the state of the house; returns 1 where ``--check`` finds what must not be."""
    parser = argparse.ArgumentParser(description="The state of the house.")
    parser.add_argument("--against", metavar="REV", help="also of a commit, before -> after")
    parser.add_argument("--json", action="store_true", help="all measures with their places")
    parser.add_argument("--places", choices=PLACES, help="where one of the measures is")
    parser.add_argument("--check", action="store_true", help="fail at what must not be")
    asked = parser.parse_args(arguments)
    today = measure_house(read_tree())
    before = measure_house(read_tree(asked.against)) if asked.against else None
    if asked.json:
        state = {"today": today.document(), "before": before.document() if before else None}
        sys.stdout.write(json.dumps(state, indent=1) + "\n")
    elif asked.places:
        found = today.document()[asked.places]
        pairs = found.items() if isinstance(found, dict) else ((each, ()) for each in found)
        for name, places in pairs:
            shown = " <-> ".join(name) if isinstance(name, tuple) else name
            sys.stdout.write(f"{shown}  {'  '.join(places)}".rstrip() + "\n")
    else:
        sys.stdout.write("".join(f"{line}\n" for line in print_table(today, before)))
    wrong = list(failures(today)) if asked.check else []
    sys.stderr.write("".join(f"{line}\n" for line in wrong))
    return bool(wrong)


if __name__ == "__main__":
    raise SystemExit(main())
