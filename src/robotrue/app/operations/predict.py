"""Predict the error (actual minus commanded) and its standard deviation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import CalibratedModel, Columns, table_output
from robotrue.core.provenance import Provenance, mark_line
from robotrue.errors import ModelMismatchError

if TYPE_CHECKING:
    from robotrue.calibration.model import Prediction
    from robotrue.measurement.formats.measured_files import QueryTable


class PredictRequest(Request):
    """Model, and the poses at which to predict."""

    model: CalibratedModel
    queries: Annotated[Path, InputFile(argument="QUERIES")]
    """CSV of joints, wrenches, temperatures."""
    output: Annotated[Path, table_output()]
    """CSV to write."""
    mapping: Columns = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictions:
    """Predicted errors.

    Attributes:
        queries: The query, one row each.
        prediction: Error and covariance of each row.
        n: Predictions.
        mean_mm: Mean length of the predicted error.
        max_mm: Largest length of the predicted error.
        mean_sigma_mm: Mean standard deviation along an axis.
        output: CSV that was written.
        provenance: Of the model.
    """

    queries: QueryTable
    prediction: Prediction
    n: int
    mean_mm: float
    max_mm: float
    mean_sigma_mm: float
    output: Path
    provenance: Provenance | None

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return {
            "n": self.n,
            "mean_mm": self.mean_mm,
            "max_mm": self.max_mm,
            "mean_sigma_mm": self.mean_sigma_mm,
            "output": str(self.output),
        }

    def blocks(self) -> Iterable[Block]:
        """Returns one line."""
        plural = "" if self.n == 1 else "s"
        yield Note(
            f"{self.n} prediction{plural}, mean error {self.mean_mm:.3f} mm, "
            f"written to {self.output}"
        )


@operation()
def run(request: PredictRequest, context: Context) -> Predictions:
    """Writes ``ex_mm, ey_mm, ez_mm, sx_mm, sy_mm, sz_mm`` (base axes), one row per query.

    Raises:
        ModelMismatchError: Another number of joints than the model's.
    """
    import numpy as np

    from robotrue.calibration.model import Query, provenance_of
    from robotrue.core.units import MM
    from robotrue.measurement.formats.mapping import read_mapping
    from robotrue.measurement.formats.measured_files import read_queries
    from robotrue.robot.configuration import axis_relation

    stored = context.model(request.model)
    layout = None if request.mapping is None else read_mapping(request.mapping)
    relation = axis_relation(stored.model.robot)
    queries = read_queries(request.queries, mapping=layout, relation=relation)
    if queries.joints.shape[1] != stored.model.robot.dof:
        raise ModelMismatchError(
            f"{queries.joints.shape[1]} joint columns, {stored.model.robot.name} has "
            f"{stored.model.robot.dof} joints.",
            source=request.queries,
            hint="one column j1_deg, j2_deg, ... per joint.",
        )
    load = stored.cell.payload.fill_rows(queries.payload_mass, queries.wrench)
    prediction = stored.model.predict(
        Query(
            joints=queries.joints,
            load=load,
            approach=queries.approach,
            conditions=queries.conditions,
        )
    )
    sigma = np.sqrt(np.diagonal(prediction.covariance, axis1=1, axis2=2))
    origin = provenance_of(stored.model)
    lines = ["ex_mm,ey_mm,ez_mm,sx_mm,sy_mm,sz_mm"]
    rows = np.hstack([prediction.error, sigma]) / MM
    lines += [",".join(f"{value:.6f}" for value in row) for row in rows]
    output = context.write(request.output, mark_line(origin) + "\n".join(lines) + "\n")
    size = np.linalg.norm(prediction.error, axis=1) / MM
    return Predictions(
        queries=queries,
        prediction=prediction,
        n=len(queries),
        mean_mm=float(size.mean()),
        max_mm=float(size.max()),
        mean_sigma_mm=float((sigma / MM).mean()),
        output=output,
        provenance=origin,
    )
