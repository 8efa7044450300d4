"""The inventory of features: what a user can see, as sorted text, and what of it is missing.

``python scripts/inventory.py`` prints it; ``--check`` compares with ``inventory_before.txt`` and
fails where a line is gone; ``--write`` renews that file, whose change shows in review what a user
loses or gets. Commands, options and defaults, routes, HTTP operations with their fields, kinds of
jobs with their parameters, formats, reports, methods, sources and sinks, robots, exports,
scenarios, papers, keys of ``cell.toml``: :mod:`inventory_probes` says where each is seen.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from inventory_probes import PROBES, ROOT, texts

BEFORE: Final = Path(__file__).with_name("inventory_before.txt")


def read_inventory() -> tuple[list[str], list[str]]:
    """Returns the sorted lines of the package as it is, and a message for each failed probe."""
    lines: set[str] = set()
    failures = []
    for section, probe in PROBES.items():
        try:
            lines |= {f"{section} | {line}" for line in probe()}
        except Exception as cause:  # whatever a moved registry makes of it, the others are read
            failures.append(f"the probe of {section!r} fails: {type(cause).__name__}: {cause}")
    return sorted(lines), failures


def missing_of(before: Sequence[str], today: Sequence[str]) -> list[str]:
    """Returns the lines of before that are gone.

    A mark or a field of a page that a template or a loop builds today counts as there while its
    word stands in any file of the package.
    """
    gone = sorted(set(before) - set(today))
    words: set[str] = set()
    if any(line.startswith("page | ") for line in gone):
        words = {word for text in texts() for word in re.findall(r"[A-Za-z][\w-]*", text)}
    return [
        line
        for line in gone
        if not (line.startswith("page | ") and line.split()[-1].removesuffix("[]") in words)
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints, compares or renews the inventory; returns 1 where something is missing."""
    parser = argparse.ArgumentParser(description="The inventory of features.")
    parser.add_argument("--check", action="store_true", help="compare with inventory_before.txt")
    parser.add_argument("--write", action="store_true", help="renew inventory_before.txt")
    asked = parser.parse_args(arguments)
    today, failures = read_inventory()
    for failure in failures:
        sys.stderr.write(f"{failure}\n  Move the probe with its registry: inventory_probes.py\n")
    if asked.write and not failures:
        BEFORE.write_text("".join(f"{line}\n" for line in today), encoding="utf-8")
    if not asked.check:
        sys.stdout.write("".join(f"{line}\n" for line in today))
        return bool(failures)
    before = BEFORE.read_text(encoding="utf-8").splitlines()
    missing, new = missing_of(before, today), sorted(set(today) - set(before))
    sys.stdout.write("".join(f"missing  {line}\n" for line in missing))
    sys.stdout.write("".join(f"new      {line}\n" for line in new))
    sys.stdout.write(f"{len(today)} features, {len(missing)} missing, {len(new)} new\n")
    if missing:
        sys.stderr.write(
            f"Bring them back, or renew {BEFORE.relative_to(ROOT)} (scripts/inventory.py --write) "
            "where a user is meant to lose them.\n"
        )
    return bool(missing or failures)


if __name__ == "__main__":
    raise SystemExit(main())
