"""Check a model on measured poses that it was not fitted to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, Table
from robotrue.app.request import Item, Reference, Request
from robotrue.app.request_fields import CalibratedModel, Columns, SavedPage
from robotrue.core.provenance import Provenance, marked_document, merge
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.store.workspace import Transaction
    from robotrue.validation.metrics import ErrorStatistics
    from robotrue.validation.report import ValidationReport

TITLE: Final = "Held-out validation"
STEPS: Final = 3


class ValidateRequest(Request):
    """Model to check, and the measured poses."""

    model: CalibratedModel
    measurements: Annotated[
        tuple[Reference, ...], Item(noun="measurement", argument="MEAS...", sent=True)
    ]
    """Held-out poses."""
    mapping: Columns = None
    report: SavedPage = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Validated:
    """Error statistics of a model on poses that its fit did not use.

    Attributes:
        report: The numbers.
        poses: Rows.
        page: Report page that was written, if requested.
        provenance: Of the model and the poses.
    """

    report: ValidationReport
    poses: int
    page: Path | None
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return self.report.to_json()

    def blocks(self) -> Iterable[Block]:
        """Returns the statistics before and after, and the coverage."""
        raw, aligned, after = (
            self.report.before, self.report.before_aligned, self.report.after,
        )  # fmt: skip
        stated = _row("base and tool as stated", raw)
        yield Table(
            title=f"{self.poses} pose{'' if self.poses == 1 else 's'}, {self.report.robot}",
            columns=("", "mean mm", "p95 mm", "max mm", "std mm"),
            rows=(
                stated,
                *([] if aligned is None else [_row("before: base and tool corrected", aligned)]),
                _row("after", after),
            ),
        )
        coverage = self.report.coverage
        yield Note(
            f"{100 * coverage.share:.1f} % of the points lie in their stated 95 % region"
            f" (95 % interval {100 * coverage.low:.1f} to {100 * coverage.high:.1f} %)"
        )
        for part in self.report.parts:
            if not part.is_honest:
                yield Note(
                    f"by {part.by}, {part.part}: {100 * part.share:.1f} % of {part.n} points (95 %"
                    f" interval {100 * part.low:.1f} to {100 * part.high:.1f} %)"
                )


def _row(name: str, statistics: ErrorStatistics) -> tuple[str, ...]:
    values = (statistics.mean, statistics.p95, statistics.max, statistics.std)
    return (name, *(f"{value / MM:.3f}" for value in values))


@operation()
def run(request: ValidateRequest, context: Context) -> Validated:
    """Predicts the poses and compares; writes the report page if requested."""
    from robotrue.app.data_doctor import find_warnings
    from robotrue.calibration.model import provenance_of
    from robotrue.report.model_view import harmless_remark
    from robotrue.report.warning_groups import group_warnings
    from robotrue.validation.validate import validate

    context.step("reading", 0, STEPS)
    stored = context.model(request.model)
    rows = context.measurements(stored.cell, request.measurements, request.mapping, minimum=1)
    context.step("predicting", 1, STEPS)
    result = validate(stored.model, rows, payload=stored.cell.payload)
    result = replace(result, doubts=(*find_warnings(stored.cell, rows), *result.doubts))
    for warning in group_warnings(stored.model, result.doubts):
        context.note(warning)
    for line in harmless_remark(stored.model.training_summary()):
        context.inform(line)
    page = None
    if request.report is not None:
        from robotrue.app.report_pages import write_calibration_page

        context.step("writing the report", 2, STEPS)
        page = context.output(request.report)
        write_calibration_page(page, stored.model, result, title=TITLE, measured=rows.provenance)
        context.wrote("report", page)
    origin = merge([provenance_of(stored.model), rows.provenance])
    return Validated(report=result, poses=len(rows), page=page, provenance=origin)


@run.saves
def save(
    request: ValidateRequest, result: Validated, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a document ``validation`` with its page, linked to the model and the poses."""
    from robotrue.store.nouns import MODEL
    from robotrue.store.records import links_to

    model = context.record(MODEL, request.model)
    cell = next(iter(model.refs("cell")), None)
    data = context.keep_measured(into, request.measurements, cell, request.mapping)
    links = list(links_to(model=model.ref, data=data))
    detail = marked_document(result.document(), result.provenance)
    files = [] if result.page is None else [result.page]
    return context.leave_document(into, "validation", model.name, files, links, detail)
