"""Error models: calibrated, transferred, loaded; and what they predict."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, Union, Unpack

import numpy as np
import numpy.typing as npt

from robotrue.app.operations.calibrate import Calibrated, model_blocks
from robotrue.app.operations.predict import Predictions
from robotrue.app.operations.transfer import Transferred
from robotrue.app.presentation import Block
from robotrue.app.reporting import Message
from robotrue.calibration.model import identity_of, provenance_of
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.library.cell_object import RobotCell
from robotrue.library.measurement_object import (
    CellSource,
    MeasuredSource,
    Measurements,
    TableSource,
    cell_of,
    joint_columns_deg,
    named_columns,
    place_cell,
    place_columns,
    place_measured,
    place_table,
)
from robotrue.library.objects_context import ObjectsContext
from robotrue.library.operation_call import call_operation, open_context, with_options_of
from robotrue.library.option_types import CalibrateOptions, TransferOptions
from robotrue.library.prediction_object import PredictedErrors
from robotrue.library.presented import Presented
from robotrue.store.model_file import ModelFile, read_model, write_model

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture

WRENCH: tuple[str, ...] = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
ModelSource: TypeAlias = Union[str, Path, "Model"]
"""A model, or the path of its file."""
KnownSource: TypeAlias = Union[str, Path, "Model", Measurements]
"""What is known before a transfer: a model or measured poses, or a file of either."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Model(Presented):
    """An error model and its cell.

    Attributes:
        stored: Model, cell and archive.
        shown: Output of its operation.
        messages: Messages of its operation.
        path: Source file; None for a model made in this session.
    """

    stored: ModelFile
    shown: tuple[Block, ...]
    messages: tuple[Message, ...] = ()
    path: Path | None = None

    @property
    def cell(self) -> RobotCell:
        """Cell of the measurements."""
        return RobotCell(cell=self.stored.cell)

    @property
    def training(self) -> TrainingSummary:
        """Method, rows, held-out result, parameters with standard deviations; SI."""
        return self.stored.model.training_summary()

    @property
    def method(self) -> str:
        """Method of the fit."""
        return self.training.method

    @property
    def provenance(self) -> Provenance:
        """Provenance of the training poses."""
        return provenance_of(self.stored.model)

    def predict(
        self,
        queries: TableSource | None = None,
        *,
        joints_deg: npt.ArrayLike | None = None,
        payload_kg: npt.ArrayLike | None = None,
        wrench: npt.ArrayLike | None = None,
        mapping: str | Path | None = None,
    ) -> PredictedErrors:
        """Returns the error and its standard deviation at every query.

        Args:
            queries: A file, or a table with the columns of one.
            joints_deg: (n, dof) or (dof,), instead of queries.
            payload_kg: Of each row, or one for all; default: the payload of the cell.
            wrench: (n, 6) or (6,) N and N m on the tool, base axes.
            mapping: Column mapping (TOML) of a file of another layout.

        Raises:
            ConfigurationError: Neither queries nor joints, or both.
            ModelMismatchError: Another number of joints than the model's.
        """
        with open_context() as context:
            if queries is not None and joints_deg is None:
                if payload_kg is not None or wrench is not None:
                    raise ConfigurationError("payload_kg and wrench are columns of the queries.")
                place = place_table(context, queries)
            else:
                place = _place_queries(context, queries, joints_deg, payload_kg, wrench)
            fields = {
                "model": self.place(context),
                "queries": place,
                "output": context.new_file("predictions.csv"),
                "mapping": mapping,
            }
            call = call_operation(context, "predict", Predictions, fields)
        return PredictedErrors(model=self.stored.model, result=call.result, messages=call.messages)

    def save(self, path: str | Path) -> None:
        """Writes the model file, as ``robotrue calibrate -o`` does."""
        write_model(path, self.stored.model, self.stored.cell)

    def place(self, context: ObjectsContext, name: str = "model") -> Path:
        """Writes the model for a context and returns its path."""
        return context.add_model(self.stored, f"{name}.robotrue")

    def require_file(self, why: str) -> Path:
        """Returns its source file, for files that name it.

        Raises:
            ConfigurationError: It was not loaded from a file.
            ModelMismatchError: The file now contains another model.
        """
        if self.path is None:
            raise ConfigurationError(
                f"{why}; this model has no file.",
                hint='model.save("arm.robotrue"), then "arm.robotrue" in place of the model.',
            )
        ours = identity_of(self.stored.model)
        held = identity_of(read_model(self.path).model)
        if not ours.same(held):
            raise ModelMismatchError(
                f"the file holds {held}, the model that was loaded from it is {ours}.",
                source=self.path,
                hint="load it again, or save the model under another name.",
            )
        return self.path

    def blocks(self) -> Iterable[Block]:
        """Returns the determined and the undetermined parameters."""
        return self.shown

    def to_dataframe(self) -> pd.DataFrame:
        """Returns the identified errors: value, sd, unit and class of each."""
        import pandas as pd

        from robotrue.report.model_view import list_geometric_errors

        rows = list_geometric_errors(self.stored.model)
        frame = pd.DataFrame(list(rows.values()), columns=["value", "sd", "unit", "known"])
        frame.insert(0, "parameter", list(rows))
        return frame

    def plot(self) -> Picture:
        """Returns the identified errors with intervals of plus and minus two sd, by unit."""
        from robotrue.library.pictures import draw_intervals, make_picture

        table = self.to_dataframe()
        table = table[table["sd"] > 0.0]
        if table.empty:
            raise ConfigurationError(f"a {self.method} model has no parameters to show.")
        drawings = [
            draw_intervals(
                list(rows["parameter"]), rows["value"].to_numpy(), 2.0 * rows["sd"].to_numpy(),
                str(unit), "actual minus nominal, with plus and minus two standard deviations",
            )
            for unit, rows in table.groupby("unit", sort=False)
        ]  # fmt: skip
        return make_picture(drawings, title=f"{self._mark}identified errors of {self.cell.robot}")

    def _describe(self) -> str:
        summary = self.training
        held_out = summary.held_out_mean
        reached = "" if held_out is None else f", {held_out / MM:.3f} mm on held-out blocks"
        return f"model of {self.cell.robot}: {summary.method}, {summary.rows} poses{reached}"


def load_model(path: str | Path) -> Model:
    """Returns the model of a file that ``save`` or the command line wrote.

    Raises:
        ArchiveError: Not a model file, damaged, or from a newer robotrue.
    """
    stored = read_model(path)
    return Model(stored=stored, shown=tuple(model_blocks(stored.model)), path=Path(path))


def model_of(model: ModelSource) -> Model:
    """Returns the model, loaded if it is a path."""
    return model if isinstance(model, Model) else load_model(model)


@with_options_of("calibrate", "cell", "measurements", "output")
def calibrate(
    cell: CellSource, *data: MeasuredSource, **options: Unpack[CalibrateOptions]
) -> Model:
    """Returns the error model fitted to measured poses.

    Args:
        cell: The cell, or the path of its cell.toml.
        data: Measured poses, files or tables; one or more.
        options: See below.

    Raises:
        ObservabilityError: Too few measurements for the method.
        ImplausibleDataError: Numbers that are impossible for this robot.
    """
    with open_context() as context:
        fields = {
            "cell": place_cell(context, cell),
            "measurements": [place_measured(context, each) for each in data],
            "output": context.new_file("model.robotrue"),
            **options,
        }
        call = call_operation(context, "calibrate", Calibrated, fields)
        stored = read_model(call.result.output)
        shown = tuple(call.result.blocks())
    return Model(stored=stored, shown=shown, messages=call.messages)


@with_options_of("transfer", "cell", "measurements", "output", "source", "fleet")
def transfer(
    cell: CellSource,
    *data: MeasuredSource,
    from_region: KnownSource | None = None,
    from_campaign: KnownSource | None = None,
    from_unit: KnownSource | None = None,
    fleet: ModelSource | Sequence[ModelSource] = (),
    **options: Unpack[TransferOptions],
) -> Model:
    """Returns a model transferred to another region, date or arm, checked on held-out poses.

    Args:
        cell: The target's cell, or the path of its cell.toml.
        data: Poses measured at the target.
        from_region: Sources of another region, the same arm and time.
        from_campaign: Sources of another time, the same arm.
        from_unit: Sources of another arm of the type.
        fleet: Models of other arms of the type, or folders of such models; one or more.
        options: See below.

    Raises:
        ObservabilityError: No data can be used.
    """
    known = {"region": from_region, "campaign": from_campaign, "unit": from_unit}
    with open_context() as context:
        fields = {
            "cell": place_cell(context, cell_of(cell)),
            "measurements": [place_measured(context, each) for each in data],
            "output": context.new_file("model.robotrue"),
            "source": [
                f"{relation}={_place_known(context, each, relation)},{relation}"
                for relation, each in known.items()
                if each is not None
            ],
            "fleet": _place_fleet(context, fleet),
            **options,
        }
        call = call_operation(context, "transfer", Transferred, fields)
        stored = read_model(call.result.output)
        shown = tuple(call.result.blocks())
    return Model(stored=stored, shown=shown, messages=call.messages)


def _place_known(context: ObjectsContext, known: KnownSource, name: str) -> Path:
    if isinstance(known, Model):
        return known.place(context, name)
    return place_measured(context, known)


def _place_fleet(
    context: ObjectsContext, fleet: ModelSource | Sequence[ModelSource]
) -> tuple[Path, ...]:
    """The files of models and the folders of a fleet; an object is named by its number."""
    members = (fleet,) if isinstance(fleet, str | Path | Model) else fleet
    return tuple(
        each.place(context, f"fleet_{number}") if isinstance(each, Model) else Path(each)
        for number, each in enumerate(members, 1)
    )


def _place_queries(
    context: ObjectsContext,
    queries: TableSource | None,
    joints_deg: npt.ArrayLike | None,
    payload_kg: npt.ArrayLike | None,
    wrench: npt.ArrayLike | None,
) -> Path:
    """The file of queries that were given as arrays.

    Raises:
        ConfigurationError: No joints, or joints in addition to a table.
    """
    if joints_deg is None or queries is not None:
        raise ConfigurationError(
            "state either a table of queries or joints_deg.",
            hint="joints_deg=[[0, -90, 90, 0, 0, 0]]",
        )
    columns = joint_columns_deg(joints_deg)
    count = len(np.atleast_2d(np.asarray(joints_deg)))
    if payload_kg is not None:
        columns.append(("payload_kg", np.broadcast_to(np.asarray(payload_kg), (count,))))
    if wrench is not None:
        rows = np.broadcast_to(np.asarray(wrench, dtype=np.float64), (count, 6))
        columns += named_columns(rows, WRENCH, "wrench")
    return place_columns(context, "queries.csv", columns)
