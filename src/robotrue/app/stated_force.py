"""Conditions that a stored program was compensated for: force, start posture and part."""

from __future__ import annotations

from dataclasses import dataclass

from robotrue.core.document_decoder import decode
from robotrue.store import jobs
from robotrue.store.nouns import ProgramRecord
from robotrue.store.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceParameters:
    """Parameters of a job ``compensate``.

    Attributes:
        wrench: Force on the tool, as the option has it; None: none.
        cutter: The tool's cutting edge; None: none.
        start: Start posture; None: that of the cell.
        part: Which part or side of the cell; None: its only one.
    """

    wrench: str | None = None
    cutter: str | None = None
    start: str | None = None
    part: str | None = None


def force_parameters(workspace: Workspace, program: ProgramRecord) -> ForceParameters:
    """Returns what the job of a compensated program stated; nothing where no job made it."""
    job = str(program.detail.get("job", ""))
    if not job:
        return ForceParameters()
    stated = {k: v for k, v in jobs.status(workspace, job).parameters.items() if v}
    return decode(ForceParameters, stated)
