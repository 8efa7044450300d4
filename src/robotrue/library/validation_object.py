"""A model on held-out poses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

import numpy as np
import numpy.typing as npt

from robotrue.app.operations.validate import Validated
from robotrue.app.presentation import Block
from robotrue.app.reporting import Message
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.library.measurement_object import MeasuredSource, place_measured
from robotrue.library.model_object import ModelSource, model_of
from robotrue.library.operation_call import call_operation, open_context, with_options_of
from robotrue.library.option_types import ValidateOptions
from robotrue.library.presented import Presented

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Validation(Presented):
    """Errors before and after on held-out poses, and the coverage of the stated uncertainty.

    Attributes:
        result: Of the operation ``validate``.
        messages: Messages of the operation.
    """

    result: Validated
    messages: tuple[Message, ...]

    @property
    def mean_mm(self) -> float:
        """Mean length of measured minus predicted."""
        return self.result.report.after.mean / MM

    @property
    def before_mean_mm(self) -> float:
        """Mean length of measured minus nominal, base and tool as stated."""
        return self.result.report.before.mean / MM

    @property
    def coverage_95(self) -> float:
        """Share of the poses in their stated 95 % regions, 0 to 1."""
        return self.result.report.coverage_95

    @property
    def before_mm(self) -> npt.NDArray[np.float64]:
        """(n, 3) mm, measured minus nominal."""
        return self.result.report.errors_before / MM

    @property
    def after_mm(self) -> npt.NDArray[np.float64]:
        """(n, 3) mm, measured minus predicted."""
        return self.result.report.errors_after / MM

    @property
    def provenance(self) -> Provenance:
        """Provenance of the model and the poses."""
        return self.result.provenance

    def document(self) -> dict[str, object]:
        """Returns the JSON values of ``robotrue validate --json``."""
        return dict(self.result.document())

    def blocks(self) -> Iterable[Block]:
        """Returns the statistics before and after, and the coverage."""
        return self.result.blocks()

    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per pose: mm, and the probability of the region that holds it."""
        import pandas as pd

        report = self.result.report
        sigma = np.sqrt(np.diagonal(report.covariance, axis1=1, axis2=2)) / MM
        blocks = [
            (report.position / MM, ["x_mm", "y_mm", "z_mm"]),
            (self.before_mm, ["before_x_mm", "before_y_mm", "before_z_mm"]),
            (self.after_mm, ["after_x_mm", "after_y_mm", "after_z_mm"]),
            (sigma, ["sx_mm", "sy_mm", "sz_mm"]),
        ]
        frames = [pd.DataFrame(values, columns=names) for values, names in blocks]
        sizes = pd.DataFrame(
            {
                "before_mm": np.linalg.norm(self.before_mm, axis=1),
                "after_mm": np.linalg.norm(self.after_mm, axis=1),
                "probability": report.probability,
            }
        )
        return pd.concat([*frames, sizes], axis=1)

    def plot(self) -> Picture:
        """Returns the drawings of the report: errors by pose, distribution, coverage, arrows."""
        from robotrue.library.pictures import make_picture
        from robotrue.report.calibration_report import calibration_content
        from robotrue.report.content import Plot
        from robotrue.report.words import ENGLISH

        report = self.result.report
        content = calibration_content(report, title="", simulated=self.simulated)
        plots = [
            block for section in content.sections for block in section.blocks
            if isinstance(block, Plot)
        ]  # fmt: skip
        title = f"{self._mark}{report.robot}, {self.result.poses} poses"
        return make_picture([plot.make_drawing(ENGLISH) for plot in plots], title=title)

    def _describe(self) -> str:
        return (
            f"validation: {self.result.poses} poses, mean {self.before_mean_mm:.3f} -> "
            f"{self.mean_mm:.3f} mm, {100 * self.coverage_95:.0f} % in their 95 % regions"
        )


@with_options_of("validate", "model", "measurements")
def validate(
    model: ModelSource, *held_out: MeasuredSource, **options: Unpack[ValidateOptions]
) -> Validation:
    """Returns the prediction error of a model on held-out poses.

    Args:
        model: The model, or the path of its file.
        held_out: Measured poses that were not in the fit; one or more.
        options: See below.

    Raises:
        ModelMismatchError: Poses of another robot.
        ImplausibleDataError: Numbers that are impossible for this robot.
    """
    with open_context() as context:
        fields = {
            "model": model_of(model).place(context),
            "measurements": [place_measured(context, each) for each in held_out],
            **options,
        }
        call = call_operation(context, "validate", Validated, fields)
        return Validation(result=call.result, messages=call.messages)
