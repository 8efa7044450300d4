"""Parts of a calibrated robot that a format cannot express, and their size.

The size of a loss is measured on poses spread over the training range, with the cell's payload: the
distance between the model's tool points with and without that part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, TypedDict

import numpy as np

from robotrue.calibration.model import ErrorModel, Query, model_hash, provenance_of
from robotrue.calibration.terms.term import MeanTables
from robotrue.calibration.terms.term_registry import export_parts
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import Provenance
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import NO_LOAD, Load, deflect_arm
from robotrue.validation.error_map import known_places


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """One omitted part.

    Attributes:
        name: As in ``--lossy``.
        rms: m, root mean square over the sample poses.
        largest: m.
    """

    name: str
    rms: float
    largest: float

    @property
    def sizes(self) -> str:
        """The two sizes in words."""
        return f"{self.rms / MM:.4f} mm rms, {self.largest / MM:.4f} mm at most"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportableModel(Columns):
    """A model as something to export.

    Attributes:
        tables: Its mean.
        digest: SHA-256 of the model.
        joints: (n, dof) rad, sample poses.
        position: (n, 3) m in base, the model's tool point there.
        turn: (n, 3) rad, left rotation vector of the tool against the nominal one; NaN where the
            model does not know it.
        load: The payload.
        provenance: Of the model.
    """

    tables: MeanTables
    digest: str
    joints: Annotated[Array, Column("n dof", unit="rad")]
    position: Annotated[Array, Column("n 3", unit="m")]
    turn: Annotated[Array, Column("n 3", unit="rad", nan=True)]
    load: Load
    provenance: Provenance

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the parts this model really holds."""
        return tuple(name for name in export_parts() if _holds(self.tables, name))


def prepare_export(
    model: ErrorModel, load: Load = NO_LOAD, *, T_flange_tool: Array | None = None
) -> ExportableModel:
    """Returns a model ready for export.

    Args:
        model: Any error model with a mean in tables.
        load: Payload under which losses are measured.
        T_flange_tool: (4, 4) tool point; the measured one if None. The errors of the measured tool
            do not carry over to another.

    Raises:
        ModelMismatchError: A model without tables, or without a training range.
    """
    tables = model.mean_tables()
    places = known_places(model, load=load)
    if tables is None or places is None:
        raise ModelMismatchError(
            f"a {type(model).__name__} has no parameters that another program could take.",
            hint="calibrate with a method of `robotrue calibrate`.",
        )
    nominal = model.robot.nominal()
    if T_flange_tool is not None:
        nominal = nominal.with_tool(T_flange_tool)
        tables = replace(tables, robot=tables.robot.with_tool(T_flange_tool))
    seen = model.predict(Query(joints=places.joints, load=load, T_flange_tool=T_flange_tool))
    return ExportableModel(
        tables=tables,
        digest=model_hash(model),
        joints=places.joints,
        position=forward(nominal, places.joints)[:, :3, 3] + seen.error,
        turn=seen.rotation_error,
        load=load,
        provenance=provenance_of(model),
    )


def require_named(found: ExportableModel, cannot: Sequence[str], lossy: Sequence[str]) -> None:
    """Passes if every part that would be lost was named.

    Args:
        found: The model.
        cannot: Parts the format cannot hold.
        lossy: Parts the user gave up by name.

    Raises:
        ConfigurationError: A part is not named (the message states the size of each), or a name no
            part has.
    """
    parts = export_parts()
    unknown = [name for name in lossy if name not in parts]
    if unknown:
        raise ConfigurationError(
            f"no part {unknown[0]!r} to leave out; parts are {', '.join(parts)}.",
            hint="--lossy compliance,residual",
        )
    lost = [name for name in found.held if name in cannot]
    missing = [name for name in lost if name not in lossy]
    if not missing:
        return
    sizes = ", ".join(
        f"{loss.name} ({loss.largest / MM:.3f} mm at most)" for loss in losses(found, missing)
    )
    raise ConfigurationError(
        f"this format cannot hold {sizes} of the calibrated robot.",
        hint=f"--lossy {','.join(lost)} leaves it out and states it in the file.",
    )


def losses(found: ExportableModel, names: Sequence[str]) -> tuple[Loss, ...]:
    """Returns the size of each named part, alone."""
    whole = mean_position(found.tables, found.joints, found.load)
    out = []
    for name in names:
        rest = mean_position(without(found.tables, (name,)), found.joints, found.load)
        out.append(_loss(name, whole - rest))
    return tuple(out)


def measure_loss(found: ExportableModel, robot: RobotModel) -> Loss:
    """Returns what a rigid robot, as another program will compute it, misses of the model.

    Args:
        found: The model.
        robot: What was exported.
    """
    at = forward(robot, found.joints)[:, :3, 3]
    return _loss("all", found.position - at)


def part_left_over(found: ExportableModel, names: Sequence[str]) -> Loss:
    """Returns what the model's own mean without some parts misses, all together."""
    rest = mean_position(without(found.tables, names), found.joints, found.load)
    return _loss("all", found.position - rest)


def without(tables: MeanTables, names: Sequence[str]) -> MeanTables:
    """Returns the tables without some parts."""
    parts = export_parts()
    for name in names:
        tables = parts[name](tables)
    return tables


def _holds(tables: MeanTables, name: str) -> bool:
    """True if tables change when a part is omitted."""
    rest = without(tables, (name,))
    return not np.array_equal(rest.robot.errors, tables.robot.errors) or any(
        not np.array_equal(getattr(rest, field), getattr(tables, field))
        for field in ("ripple_sin", "ripple_cos", "backlash", "weights")
    )


def mean_position(tables: MeanTables, joints: Array, load: Load) -> Array:
    """Returns the tool point (n, 3) m of the tables; joints approached from below (sign +1)."""
    phase = joints[:, :, None] * tables.harmonics
    ripple = np.sum(np.sin(phase) * tables.ripple_sin + np.cos(phase) * tables.ripple_cos, axis=2)
    position = deflect_arm(tables.robot, joints, load, ripple + tables.backlash)[0].position
    if len(tables.centres):
        features = tables.scale * np.concatenate([np.sin(joints), np.cos(joints)], axis=1)
        away = np.sum((features[:, None, :] - tables.centres[None]) ** 2, axis=2)
        position = position + np.exp(-0.5 * away) @ tables.weights
    return np.asarray(position)


class LeftOutRow(TypedDict):
    """A part of a model that an export leaves out, alone; mm."""

    part: str
    rms_mm: float
    largest_mm: float


class LossDocument(TypedDict):
    """Parts that an export omits, see :func:`loss_document`."""

    left_out: list[LeftOutRow]
    together_rms_mm: float
    together_largest_mm: float
    measured_on: str


def loss_document(lost: Sequence[Loss], total: Loss) -> LossDocument:
    """Returns JSON values: what was left out, mm."""
    return {
        "left_out": [
            {"part": x.name, "rms_mm": x.rms / MM, "largest_mm": x.largest / MM} for x in lost
        ],
        "together_rms_mm": total.rms / MM,
        "together_largest_mm": total.largest / MM,
        "measured_on": "poses spread evenly over the joint ranges of the training data, with the "
        "cell's payload, backlash at one side",
    }


def loss_sentences(lost: Sequence[Loss], total: Loss) -> list[str]:
    """Returns the same as lines of text."""
    if not lost:
        return ["The export contains the whole model."]
    return [
        *(f"Left out: {x.name}, {x.sizes}." for x in lost),
        f"Misses the model by {total.sizes}, over poses spread evenly over the training range.",
    ]


def _loss(name: str, off: Array) -> Loss:
    length = np.linalg.norm(off, axis=1)
    return Loss(name=name, rms=float(np.sqrt(np.mean(length**2))), largest=float(length.max()))
