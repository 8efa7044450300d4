"""Remove for good what was deleted long ago and nothing rests on, with its files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts, count
from robotrue.app.request import Option, Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.store.bin import Discarded, RecycleBin

SHOWN: Final = 20
"""Items named before it is asked."""


class WorkspaceEmptyBinRequest(Request):
    """What is old enough."""

    days: Annotated[
        float, Option(names=("--older-than-days",), help="Since it was deleted.", least=0.0)
    ] = 30.0
    yes: Annotated[bool, Option(help="Do not ask.")] = False
    folder: WorkspaceFolder = HERE


def run(request: WorkspaceEmptyBinRequest, context: Context) -> PlainResult:
    """Shows what would go, asks, and removes it.

    Raises:
        ConfigurationError: Nobody can be asked and ``--yes`` was not given, or the answer was no.
    """
    from robotrue.store.bin import empty_bin, in_bin
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        removed = in_bin(workspace, days=request.days)
        if removed.items and not request.yes:
            _confirm(removed, request.folder, context)
        if removed.items:
            removed = empty_bin(workspace, days=request.days)
    return PlainResult(
        values={
            "removed": _list_items(removed.items),
            "needed": _list_items(removed.needed),
            "files": removed.files,
            "bytes": removed.bytes,
        },
        shown=(
            Facts(
                title="bin is empty" if removed.items else "nothing in the bin is to go",
                rows=(
                    ("items removed for good", str(len(removed.items))),
                    ("files", f"{removed.files}, {removed.bytes / 2**20:.1f} MiB"),
                    ("kept, something rests on them", str(len(removed.needed))),
                ),
            ),
        ),
    )


def _confirm(found: RecycleBin, folder: Path, context: Context) -> None:
    for item in found.items[:SHOWN]:
        day = item.deleted.astimezone().strftime("%Y-%m-%d %H:%M")
        context.inform(f"{item.noun} {item.id[:8]} {item.name!r}, deleted {day}")
    if len(found.items) > SHOWN:
        context.inform(f"and {len(found.items) - SHOWN} more")
    size = f"{count(found.files, 'file')} of {found.bytes / 2**20:.1f} MiB"
    answer = context.shell.confirm(
        f"this and {size} cannot be brought back; type yes to remove them", "yes"
    )
    if answer is None:
        raise ConfigurationError(
            f"{count(len(found.items), 'item')} and {size} would be removed for good from "
            f"{folder.name or folder}, and there is no terminal to confirm it.",
            hint="--yes, after an export.",
        )
    if not answer:
        raise ConfigurationError("nothing was removed.", hint="type yes, or give --yes.")


def _list_items(items: Sequence[Discarded]) -> list[dict[str, str]]:
    return [
        {"noun": e.noun, "id": e.id, "name": e.name, "deleted": e.deleted.isoformat()}
        for e in items
    ]


OPERATION: Final = Operation(request=WorkspaceEmptyBinRequest, run=run)
