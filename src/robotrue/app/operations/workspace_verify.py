"""Read every file and compare it with its hash; exit 1 if anything is wrong."""

from __future__ import annotations

from typing import Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts, count
from robotrue.app.request import Request
from robotrue.app.workspace_fields import HERE, WorkspaceFolder


class WorkspaceVerifyRequest(Request):
    """Which workspace."""

    folder: WorkspaceFolder = HERE


def run(request: WorkspaceVerifyRequest, context: Context) -> PlainResult:
    """Reads every file and compares it with its hash.

    Raises:
        ArchiveError: Something is wrong.
    """
    from robotrue.errors import ArchiveError
    from robotrue.store.verify import verify
    from robotrue.store.workspace import Workspace

    with Workspace.open(request.folder) as workspace:
        found = verify(workspace)
    for fault in found.faults:
        context.inform(fault)
    for name in found.unnamed:
        context.note(f"{name} is a file that no row names")
    if found.faults:
        raise ArchiveError(
            f"{count(len(found.faults), 'fault')} in {count(found.items, 'item')} and "
            f"{count(found.files, 'file')}: {found.faults[0]}",
            source=request.folder,
            hint="fetch what is missing from a backup; what is not named above is whole.",
        )
    size = ("MiB", f"{found.bytes / 2**20:.1f}")
    facts = (("items", str(found.items)), ("files", str(found.files)), size)
    return PlainResult(
        values={
            "items": found.items,
            "files": found.files,
            "bytes": found.bytes,
            "faults": list(found.faults),
            "unnamed": list(found.unnamed),
        },
        shown=(Facts(title="workspace is whole", rows=facts),),
    )


OPERATION: Final = Operation(request=WorkspaceVerifyRequest, run=run)
