"""Learn the robot's error from lengths: draw wire, ball bar, gauge bar."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block, Facts, Note, Table
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import CellFile, model_output
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM

if TYPE_CHECKING:
    from robotrue.calibration.calibrated_model import CalibratedModel
    from robotrue.calibration.length_estimate import LengthEstimate


class CalibrateLengthsRequest(Request):
    """What to calibrate, and from which lengths."""

    cell: CellFile
    lengths: Annotated[
        Path,
        InputFile(
            argument="LENGTHS",
            help="CSV: j1_deg ..., length_mm, anchor with ax_mm, ay_mm, az_mm, or k1_deg ...",
        ),
    ]
    output: Annotated[Path, model_output(help="Model file to write.")]
    method: Annotated[
        Literal["nominal", "geometric", "elastic"],
        Option(help="nominal, geometric or elastic."),
    ] = "elastic"
    points: Annotated[
        Path | None,
        InputFile(help="Measured points beside the lengths: they know the base."),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthCalibration:
    """A calibration from lengths.

    Attributes:
        model: The error model.
        estimate: What the lengths said.
        output: Its file.
        provenance: Of the model.
    """

    model: CalibratedModel
    estimate: LengthEstimate
    output: Path
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns the training summary and the anchors as JSON values."""
        names, places = self.estimate.lengths.anchor_names, self.estimate.anchors
        anchors = {name: (place / MM).tolist() for name, place in zip(names, places, strict=True)}
        summary = self.model.training_summary()
        return {"model": str(self.output), **summary, "anchors_mm": anchors}

    def blocks(self) -> Iterable[Block]:
        """Returns what was learned, where the anchors are, and what lengths do not show."""
        from robotrue.report.model_view import remarks, result_facts

        summary = self.model.training_summary()
        yield Facts(
            title=f"calibration of {self.model.robot.name} from lengths",
            rows=tuple(result_facts(summary)),
        )
        places = zip(self.estimate.lengths.anchor_names, self.estimate.anchors, strict=True)
        if len(self.estimate.anchors):
            yield Table(
                title="anchors in base",
                columns=("", "x mm", "y mm", "z mm"),
                rows=tuple((name, *(f"{v / MM:.3f}" for v in place)) for name, place in places),
            )
        for line in remarks(self.model):
            yield Note(line)


def run(request: CalibrateLengthsRequest, context: Context) -> LengthCalibration:
    """Fits the model and writes it.

    Raises:
        ObservabilityError: Too few lengths for what is asked.
    """
    from robotrue.app.measured_rows import read_together
    from robotrue.calibration.length_estimate import estimate_lengths, model_of_lengths
    from robotrue.calibration.lineage import provenance_of
    from robotrue.measurement.length_set import read_lengths
    from robotrue.planning.information import settings_of
    from robotrue.store.model_file import write_model

    cell = context.cell(request.cell)
    lengths = read_lengths(request.lengths)
    points = None
    if request.points is not None:  # a file in jobs, too
        points = read_together(cell, [request.points], None, reporter=context)
    settings = settings_of(cell)
    context.step(request.method, 0, 1)
    found = estimate_lengths(cell.measured_robot, lengths, settings, request.method, points)
    model = model_of_lengths(found, settings, request.method)
    output = context.output(request.output)
    write_model(output, model, cell)
    context.wrote("model", output)
    return LengthCalibration(
        model=model, estimate=found, output=output, provenance=provenance_of(model)
    )


OPERATION: Final = Operation(request=CalibrateLengthsRequest, run=run)
