"""``robotrue workspace empty-bin``: the one command that removes anything for good."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from robotrue.cli.console import count, emit_facts, emit_json, say
from robotrue.cli.workspace import opened
from robotrue.errors import ConfigurationError
from robotrue.store.bin import Bin, Discarded, empty_bin, in_bin

SHOWN: Final = 20
"""Items named before it is asked."""


def run_empty_bin(folder: Path, days: float, *, yes: bool, as_json: bool) -> None:
    """Shows what would go, asks, and removes it.

    Raises:
        ConfigurationError: Nobody can be asked and ``--yes`` was not given, or the answer was no.
    """
    with opened(folder) as workspace:
        found = in_bin(workspace, days=days)
        if found.items and not yes:
            _ask(found, folder)
        if found.items:
            found = empty_bin(workspace, days=days)
    if as_json:
        emit_json(_document(found))
        return
    emit_facts(
        "bin is empty" if found.items else "nothing in the bin is to go",
        [
            ("items removed for good", str(len(found.items))),
            ("files", f"{found.files}, {found.bytes / 2**20:.1f} MiB"),
            ("kept, something rests on them", str(len(found.needed))),
        ],
    )


def _ask(found: Bin, folder: Path) -> None:
    for each in found.items[:SHOWN]:
        day = each.deleted.astimezone().strftime("%Y-%m-%d %H:%M")
        say(f"{each.noun} {each.id[:8]} {each.name!r}, deleted {day}")
    if len(found.items) > SHOWN:
        say(f"and {len(found.items) - SHOWN} more")
    size = f"{count(found.files, 'file')} of {found.bytes / 2**20:.1f} MiB"
    if not sys.stdin.isatty():
        raise ConfigurationError(
            f"{count(len(found.items), 'item')} and {size} would be removed for good from "
            f"{folder.name or folder}, and nobody can be asked.",
            hint="--yes, after an export.",
        )
    say(f"this and {size} cannot be brought back; type yes to remove them")
    if sys.stdin.readline().strip().lower() != "yes":
        raise ConfigurationError("nothing was removed.", hint="type yes, or give --yes.")


def _document(found: Bin) -> dict[str, Any]:
    def listed(items: Sequence[Discarded]) -> list[dict[str, str]]:
        return [
            {"noun": e.noun, "id": e.id, "name": e.name, "deleted": e.deleted.isoformat()}
            for e in items
        ]

    return {
        "removed": listed(found.items),
        "needed": listed(found.needed),
        "files": found.files,
        "bytes": found.bytes,
    }
