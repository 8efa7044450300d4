"""Compensate a program so that the robot reaches the programmed targets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from robotrue.app.compensation_request import CompensateRequest
from robotrue.app.context import Context
from robotrue.app.job_files import BLOCKS
from robotrue.app.operation import operation
from robotrue.app.presentation import PlainResult
from robotrue.core.provenance import marked_document

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.store.workspace import Transaction

COUNTS: Final = ("targets", "compensated", "unchanged", "simulated")
"""Keys of a program in the result of a job."""
GONE: Final = ("output", "identity")
"""Paths in the folder of a job, which is gone when it is over."""


@operation()
def run(request: CompensateRequest, context: Context) -> PlainResult:
    """Writes the compensated program and reports the status of each target.

    Raises:
        ConfigurationError: Options that do not go together, or an invalid limit.
        ModelMismatchError: A program or a part frame of another model.
        StepError: Steps in the path are too large and not allowed; nothing is written.
    """
    from robotrue.app.compensated_files import compensate_files

    return compensate_files(request, context)


@run.saves
def save(
    request: CompensateRequest,
    result: PlainResult,
    into: Transaction,
    context: WorkspaceContext,
) -> Mapping[str, object]:
    """Leaves the program after, tied to the program before and to what it was made with."""
    from robotrue.app.job_places import plain_block
    from robotrue.app.workspace_context import ref_document
    from robotrue.program.identity import SUFFIX
    from robotrue.store import programs
    from robotrue.store.nouns import CELL, MODEL, PROGRAM, REGISTRATION

    before = context.record(PROGRAM, request.program[0])
    folder = context.program_output(request.output)
    files = [folder / each.name for each in before.files(programs.FILE)]
    detail = marked_document(result.document(), result.provenance)
    detail |= {BLOCKS: [plain_block(each, folder) for each in result.blocks()]}
    after = programs.add_after(
        into,
        [each for each in files if each.is_file()],
        before=before.ref,
        model=context.ref(MODEL, request.model),
        cell=context.ref(CELL, request.cell),
        registration=context.ref(REGISTRATION, request.registration),
        identities=sorted(folder.glob(f"*{SUFFIX}")),
        name=context.naming.name or f"{before.name}, compensated",
        note=context.naming.note,
        job=context.work.job.id,
        detail=_without_paths(detail),
    )
    return {"program": ref_document(after.ref), **{key: detail[key] for key in COUNTS}}


def _without_paths(detail: Mapping[str, object]) -> dict[str, object]:
    kept = {key: value for key, value in detail.items() if key not in GONE}
    files = kept.get("files")
    if isinstance(files, list):
        kept["files"] = [_without_paths(file) for file in files]
    return kept
