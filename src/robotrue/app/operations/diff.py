"""Compare two programs target by target: shift, turn, predicted error before and after."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, Table
from robotrue.app.request import InputFile, Item, Output, Reference, Request
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.compensation.difference import Difference
    from robotrue.compensation.process_force import DescribedForce
    from robotrue.core.arrays import Array

SHOWN: Final = 20
"""Rows of the printed table: those that moved most."""
COLUMNS: Final = (
    "file", "line", "line_after", "status", "shift_x_um", "shift_y_um", "shift_z_um", "shift_um",
    "turn_deg", "error_before_um", "error_after_um", "bound_95_um",
)  # fmt: skip


class DiffRequest(Request):
    """Programs to compare, and the model that predicts their errors."""

    before: Annotated[Reference, Item(noun="program", argument="BEFORE")]
    """Program from CAM."""
    after: Annotated[Reference, Item(noun="program", argument="AFTER")]
    """The compensated program."""
    model: Annotated[Reference | None, Item(noun="model")] = None
    """Model file: also the predicted error of every target, before and after."""
    cell: Annotated[Reference | None, Item(noun="cell", also=("registration",))] = None
    """Registered cell with the part frame."""
    wrench: str | None = None
    """With --model: process force, as for compensate."""
    force: Annotated[Path | None, InputFile()] = None
    """With --model: process force, as for compensate."""
    cutter: str | None = None
    """Axis of the tool from spindle to tip, as for compensate."""
    start: str | None = None
    """With --model: start posture, as for compensate."""
    output: Annotated[
        Path | None, Output(names=("-o", "--output"), what="a CSV table", suffixes=(".csv",))
    ] = None
    """CSV of all targets to write."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramDifference:
    """Changes between two programs.

    Attributes:
        files: Name and difference of each file.
        provenance: Of the model and the part frame; None without them.
    """

    files: tuple[tuple[str, Difference], ...]
    provenance: Provenance | None

    def document(self) -> Mapping[str, object]:
        """Returns JSON values; um and deg."""
        return {"files": [{"file": name, **found.summary()} for name, found in self.files]}

    def rows(self) -> Iterable[Sequence[str]]:
        """Returns the values of ``COLUMNS`` for every target, blank where one is not known."""
        for name, found in self.files:
            yield from _rows(name, found)

    def blocks(self) -> Iterable[Block]:
        """Returns the targets that moved most, and the counts, of each file."""
        for name, found in self.files:
            yield _table(name, found)
            yield from _sentences(name, found)


@operation()
def run(request: DiffRequest, context: Context) -> ProgramDifference:
    """Compares two programs; writes every target as CSV on request.

    Raises:
        ConfigurationError: A process force without a model.
        ModelMismatchError: Jobs of another number of files, or other programs.
    """
    import numpy as np

    from robotrue.app.force_options import read_force_options
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.compensation.difference import compare_jobs
    from robotrue.compensation.stance import start_joints
    from robotrue.core.csv_text import csv_text

    cell = model = origin = None
    force: Array | DescribedForce = np.empty(0)
    home = np.empty(0)
    if request.model is not None:
        place = None if request.cell is None else context.cell_file(request.cell)
        cell, model = open_model(context.model_file(request.model), place)
        force = read_force_options(cell, request.wrench, request.force, request.cutter)
        home = start_joints(cell.robot, cell.controller.start, request.start)
        origin = provenance_used(cell, model)
    elif request.wrench or request.force:
        raise ConfigurationError(
            "a process force without --model: errors are not predicted.", hint="--model MODEL"
        )
    before = context.program_files([request.before])
    after = context.program_files([request.after], folder="after")
    files = compare_jobs(before, after, cell, model, force, home)
    compared = ProgramDifference(files=tuple(files), provenance=origin)
    if request.output is not None:
        rows = list(compared.rows())
        text = mark_line(origin) + csv_text([COLUMNS, *rows])
        context.write(request.output, text, f"{len(rows)} targets")
    return compared


def _rows(name: str, found: Difference) -> Iterable[Sequence[str]]:
    """The values of ``COLUMNS`` for every target."""
    import numpy as np

    from robotrue.compensation.difference import TargetChange

    size = np.linalg.norm(found.shift, axis=1)
    errors = np.column_stack(_errors(found)) / UM
    numbers = np.column_stack([found.shift / UM, size / UM, found.turn / DEG, errors])
    for i, row in enumerate(numbers.tolist()):
        status = TargetChange(int(found.change[i])).name.lower()
        values = (f"{value:.6g}" if np.isfinite(value) else "" for value in row)
        yield (name, str(found.line[i]), str(found.line_after[i]), status, *values)


def _errors(found: Difference) -> tuple[Array, Array, Array]:
    """Length (n,) m of the error before and after, and the radius that holds 95 % about it."""
    import numpy as np

    from robotrue.validation.error_map import radius_95

    if not found.has_errors:
        unknown = np.full(len(found.change), np.nan)
        return unknown, unknown, unknown
    before, after = (np.linalg.norm(e, axis=1) for e in (found.error_before, found.error_after))
    return before, after, radius_95(found.covariance)


def _table(name: str, found: Difference) -> Table:
    import numpy as np

    from robotrue.compensation.difference import TargetChange

    size = np.nan_to_num(np.linalg.norm(found.shift, axis=1))
    errors = np.column_stack(_errors(found)) / MM
    known = found.has_errors
    return Table(
        title=f"{name}: {len(size)} targets, largest changes",
        columns=("line", "shift mm", "x mm", "y mm", "z mm", "turn deg")
        + (("before mm", "after mm", "95 % mm") if known else ()),
        rows=tuple(
            (
                str(int(found.line[i])),
                *(f"{v / MM:.4f}" for v in (size[i], *np.nan_to_num(found.shift[i]))),
                f"{found.turn[i] / DEG:.4f}",
                *((f"{v:.4f}" for v in errors[i]) if known else ()),
            )
            for i in np.argsort(-size, kind="stable")[:SHOWN].tolist()
            if found.change[i] == TargetChange.MOVED
        ),
    )


def _sentences(name: str, found: Difference) -> Iterable[Note]:
    import numpy as np

    from robotrue.compensation.difference import TargetChange

    before, after, bound = _errors(found)
    number = np.bincount(found.change, minlength=len(TargetChange))
    said = ", ".join(f"{number[c]} {c.name.lower()}" for c in TargetChange if number[c])
    yield Note(f"{name}: {said}")
    if found.has_errors and np.isfinite(after).any():
        yield Note(
            f"{name}: predicted error {np.nanmean(before) / UM:.0f} um mean before, "
            f"{np.nanmean(after) / UM:.1f} um after, within {np.nanmax(bound) / UM:.0f} um with "
            "95 % at the worst target"
        )
