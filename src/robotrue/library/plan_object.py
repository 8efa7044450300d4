"""Planned poses to measure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
import numpy.typing as npt

from robotrue.app.operations.plan import Planned
from robotrue.app.plan_request import OF_HIERARCHY
from robotrue.app.presentation import Block
from robotrue.app.reporting import Message
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.library.measurement_object import CellSource, place_cell
from robotrue.library.model_object import ModelSource, model_of
from robotrue.library.operation_call import call_operation, open_context, with_options_of
from robotrue.library.option_types import PlanOptions
from robotrue.library.presented import Presented
from robotrue.planning.plan_defaults import INFORMATION

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PosesToMeasure(Presented):
    """Chosen poses in measuring order, and the expected accuracy.

    Attributes:
        robot: Name of the robot.
        result: Of the operation ``plan``.
        messages: Messages of the operation.
    """

    robot: str
    result: Planned
    messages: tuple[Message, ...]

    def __len__(self) -> int:
        return len(self.result.plan)

    @property
    def joints_deg(self) -> npt.NDArray[np.float64]:
        """(n, dof) deg, of the robot model."""
        return self.result.plan.joints / DEG

    @property
    def expected_mm(self) -> float:
        """Expected mean error of an arm of this type after calibration with all poses."""
        return float(self.result.plan.expected.mean[len(self)]) / MM

    @property
    def provenance(self) -> Provenance:
        """Provenance of the model to improve."""
        return self.result.provenance

    def save(self, path: str | Path) -> None:
        """Writes the CSV of the poses; the measured points go into its blank columns."""
        from robotrue.planning.plan_sheets import plan_sheet

        write_atomic(Path(path), plan_sheet(self.result.plan, self.result.robot))

    def blocks(self) -> Iterable[Block]:
        """Returns the expected error against the number of poses."""
        return self.result.blocks()

    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per pose: deg, and mm of the measured point as commanded."""
        import pandas as pd

        plan = self.result.plan
        joints = {f"j{k + 1}_deg": column for k, column in enumerate(self.joints_deg.T)}
        points = {f"{a}_mm": c for a, c in zip("xyz", plan.position.T / MM, strict=True)}
        return pd.DataFrame({**joints, **points, "rank": plan.rank + 1})

    def plot(self) -> Picture:
        """Returns the expected error against the number of poses, and the pose positions."""
        from robotrue.app.report_pages import draw_accuracy_curve
        from robotrue.library.pictures import draw_places, make_picture
        from robotrue.report.words import ENGLISH

        plan = self.result.plan
        curve = draw_accuracy_curve(plan)
        drawings = [curve.make_drawing(ENGLISH), draw_places(plan.position, "base, commanded")]
        return make_picture(drawings, title=curve.title)

    def _describe(self) -> str:
        return f"plan for {self.robot}: {len(self)} poses, expected {self.expected_mm:.3f} mm"


@with_options_of("plan", "cell", "model", "output", "method", *OF_HIERARCHY)
def plan(
    cell: CellSource, *, model: ModelSource | None = None, **options: Unpack[PlanOptions]
) -> PosesToMeasure:
    """Returns the poses that improve the accuracy most.

    Args:
        cell: The cell, or the path of its cell.toml.
        model: Calibration to improve.
        options: See below.

    Raises:
        ReachError: No pose can be measured, or the program is out of reach.
        ConfigurationError: An option that is not allowed; the hierarchical method, which
            ``run("plan", ...)`` does.
    """
    if options.get("method", INFORMATION) != INFORMATION:
        raise ConfigurationError(
            "rt.plan returns one list of poses; a hierarchical plan has two, of the source and of "
            "its sub-spaces.",
            hint='rt.run("plan", cell=..., output="poses.csv", method="hierarchical", ...)',
        )
    with open_context() as context:
        place = place_cell(context, cell)
        fields = {
            "cell": place,
            "model": None if model is None else model_of(model).place(context),
            "output": context.new_file("poses.csv"),
            **options,
        }
        call = call_operation(context, "plan", Planned, fields)
        robot = context.cell(place).robot.name
    return PosesToMeasure(robot=robot, result=call.result, messages=call.messages)
