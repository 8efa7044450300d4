"""Rewrite a program so that the robot lands where it says."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block
from robotrue.app.request import (
    IN_JOBS,
    ON_COMMAND_LINE,
    InputFile,
    Item,
    Option,
    Output,
    Reference,
    Request,
)
from robotrue.core.provenance import Provenance, marked_document
from robotrue.program.compensation_defaults import MAX_SHIFT_MM, MAX_STEP_MM, SPLIT_LIMIT

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.store.workspace import Transaction

COUNTS: Final = ("targets", "compensated", "unchanged", "simulated")
"""What the result of a job says of its program."""
GONE: Final = ("output", "identity")
"""Paths in the folder of a job, which is gone when it is over."""

MAX_STEP: Final = Option(
    names=("--max-step",),
    metavar="MM",
    help="Refuse (exit 2) a larger step between a target left alone and its compensated "
    "neighbours on a line, arc or spline.",
)
ALLOW_STEPS: Final = Option(help="Write a program with larger steps all the same.")


class CompensateRequest(Request):
    """Which program to compensate, with what, and how far it may be altered."""

    model: Annotated[
        Reference | None,
        Item(
            noun="model",
            argument="MODEL|CELL",
            needed_in=ON_COMMAND_LINE,
            help="Model file, or a cell registered with one; another cell.toml changes nothing.",
        ),
    ] = None
    program: Annotated[
        tuple[Reference, ...],
        Item(
            noun="program",
            argument="PROGRAM...",
            single=True,
            help="Program to compensate; several files or a folder: one job.",
        ),
    ]
    output: Annotated[
        Path,
        Output(
            names=("--output", "-o"),
            folder=True,
            saved_as="after",
            help="Program to write; for a job a folder, too.",
        ),
    ]
    cell: Annotated[
        Reference | None,
        Item(
            noun="cell", help="Cell whose part frame the program runs in, or that knows its frames."
        ),
    ] = None
    registration: Annotated[
        Reference | None,
        Item(
            noun="registration",
            shells=IN_JOBS,
            help="Registration whose part frame the program runs in.",
        ),
    ] = None
    part: Annotated[str | None, Option(help="Which part or side, where the cell has several.")] = (
        None
    )
    wrench: Annotated[
        str | None,
        Option(help="Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m."),
    ] = None
    force: Annotated[
        Path | None,
        InputFile(help="Process force along the path: TOML of rules, or CSV by line or path."),
    ] = None
    cutter: Annotated[
        str | None,
        Option(help="Axis of the tool from spindle to tip: x, y, z, -x, -y, -z; default z."),
    ] = None
    start: Annotated[
        str | None,
        Option(help="A1,..,A6 in deg before the first target; default: start_deg of the cell."),
    ] = None
    free_spin: Annotated[
        bool,
        Option(
            help="Choose the rotation about the axis of a rotating tool for stiffness and room."
        ),
    ] = False
    axis_targets: Annotated[
        bool, Option(paired=True, help="Compensate axis targets too (PTP {A1 ..}).")
    ] = False
    max_shift_mm: Annotated[
        float, Option(help="Leave a target alone if it would move further than this.")
    ] = MAX_SHIFT_MM
    max_step_mm: Annotated[float, MAX_STEP] = MAX_STEP_MM
    allow_steps: Annotated[bool, ALLOW_STEPS] = False
    workers: Annotated[
        int | None,
        Option(
            shells=ON_COMMAND_LINE,
            help="Processes for a long program; default: as many as help; 1: only this.",
        ),
    ] = None
    dask: Annotated[
        str | None,
        Option(
            shells=ON_COMMAND_LINE, help="Dask scheduler whose workers do a long program, tcp://..."
        ),
    ] = None
    split_um: Annotated[
        float | None,
        Option(
            names=("--split",),
            metavar="UM",
            help="Put targets into lines and arcs that bow by more than UM micrometres.",
        ),
    ] = None
    split_limit: Annotated[
        int, Option(shells=ON_COMMAND_LINE, help="With --split: targets put in at most.")
    ] = SPLIT_LIMIT
    deviation: Annotated[
        bool, Option(help="Report how far lines and arcs are off between their targets.")
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensatedProgram:
    """A compensated program.

    Attributes:
        counts: What became of its targets, JSON values; lengths and angles with their unit.
        provenance: Of the model and the part frame.
    """

    counts: Mapping[str, Any]
    provenance: Provenance

    def document(self) -> Mapping[str, Any]:
        """Returns JSON values."""
        return self.counts

    def blocks(self) -> Iterable[Block]:
        """Returns nothing: what became of the targets was said file by file."""
        return ()


def run(request: CompensateRequest, context: Context) -> CompensatedProgram:
    """Writes the compensated program and says what became of each target.

    Raises:
        ConfigurationError: Options that do not go together, or a limit that is none.
        ModelMismatchError: A program or a part frame of another model.
        StepError: Steps in the path are too large and not allowed; nothing is written.
    """
    from robotrue.app.compensated_files import compensate_files

    counts, provenance = compensate_files(request, context)
    return CompensatedProgram(counts=counts, provenance=provenance)


def save(
    request: CompensateRequest,
    result: CompensatedProgram,
    into: Transaction,
    context: WorkspaceContext,
) -> Mapping[str, Any]:
    """Leaves the program after, tied to the program before and to what it was made with."""
    from robotrue.app.workspace_context import ref_document
    from robotrue.program.identity import SUFFIX
    from robotrue.store import programs
    from robotrue.store.nouns import CELL, MODEL, PROGRAM, REGISTRATION

    before = context.record(PROGRAM, request.program[0])
    folder = context.program_output(request.output)
    files = [folder / each.name for each in before.files(programs.FILE)]
    detail = marked_document(result.document(), result.provenance)
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


def _without_paths(detail: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in detail.items() if key not in GONE}
    if "files" in kept:
        kept["files"] = [_without_paths(each) for each in kept["files"]]
    return kept


OPERATION: Final = Operation(request=CompensateRequest, run=run, save=save)
