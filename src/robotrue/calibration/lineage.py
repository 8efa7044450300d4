"""Lineage of a model: its steps, oldest first, and its hash."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.training_summary import read_step
from robotrue.core.archive import archive_bytes
from robotrue.core.files import sha256
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.provenance import Provenance, merge, provenance_from
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import nominal_identity

RANGES: Final = ("joint_range_rad", "position_range_m")
"""What a summary says of the region its rows cover."""
_HASHES: Final[dict[int, str]] = {}
"""By the identity of models that exist."""


def model_hash(model: ErrorModel) -> str:
    """Returns the SHA-256 of everything in the model's archive, its summary included.

    Packing takes .6 s, and each held-out fit of a transfer names the same parents.
    """
    key = id(model)
    if key not in _HASHES:
        _HASHES[key] = sha256(archive_bytes(model.to_archive()))
        weakref.finalize(model, _HASHES.pop, key)
    return _HASHES[key]


def data_hash(measurements: MeasurementSet) -> str:
    """Returns the SHA-256 of joints and positions, as fits record it."""
    return sha256(measurements.joints.tobytes() + measurements.position.tobytes())


def describe_rows(measurements: MeasurementSet) -> dict[str, object]:
    """Returns how many rows a fit had, from where, and the ranges they cover; JSON values, SI."""
    joints, position = measurements.joints, measurements.position
    return {
        "rows": len(measurements),
        "data_sha256": data_hash(measurements),
        "sources": list(measurements.sources),
        "provenance": measurements.provenance.to_document(),
        "joint_range_rad": [joints.min(axis=0).tolist(), joints.max(axis=0).tolist()],
        "position_range_m": [position.min(axis=0).tolist(), position.max(axis=0).tolist()],
    }


def widen_region(summary: Mapping[str, object], measurements: MeasurementSet) -> dict[str, object]:
    """Returns the ranges of a summary, widened to the rows that a model was given later.

    Without stated ranges there is nothing to widen, and empty ranges come back. Positions of rows
    in another frame than the base's say nothing of the region.
    """
    ranges: dict[str, object] = {}
    joint_range, position_range = RANGES
    later = {joint_range: measurements.joints}
    if measurements.frame == "base":
        later[position_range] = measurements.position
    for name, values in later.items():
        stated = np.asarray(summary.get(name, ()), dtype=np.float64)
        if len(values) and stated.shape == (2, values.shape[1]):
            both = np.vstack([stated, values])
            ranges[name] = [both.min(axis=0).tolist(), both.max(axis=0).tolist()]
    return ranges


def provenance_of(model: ErrorModel) -> Provenance:
    """Returns where everything a model was fitted to comes from.

    Raises:
        ArchiveError: The model's summary holds something else in its place.
    """
    recorded = [source for step in history(model) for source in read_step(step).sources]
    return provenance_from(model.training_summary().provenance, before=recorded)


def merged_document(models: Sequence[ErrorModel], *data: Provenance) -> dict[str, object]:
    """Returns the JSON values of the provenance of a model made of other models and of data."""
    return merge([*map(provenance_of, models), *data]).to_document()


def history(model: ErrorModel) -> list[dict[str, object]]:
    """Returns the steps that made the model, oldest first; a plain fit is one step."""
    summary = model.training_summary()
    if summary.lineage:
        return [dict(step) for step in summary.lineage]
    return [
        {
            "step": "fit",
            "method": summary.method or "unknown",
            "rows": summary.rows,
            "data_sha256": summary.data_sha256,
            "sources": list(summary.sources),
        }
    ]


def record_step(
    step: str,
    parents: Sequence[ErrorModel],
    measurements: MeasurementSet | None,
    settings: Mapping[str, object],
    screened: Sequence[int],
) -> dict[str, object]:
    """Returns the step that adds measurements to its parents.

    Args:
        step: ``"update"`` or ``"transfer"``.
        parents: The models it started from.
        measurements: What was added; None adds no rows.
        settings: What decided the result besides the data.
        screened: Rows that got no weight.
    """
    none = measurements is None
    return {
        "step": step,
        "parents_sha256": [model_hash(parent) for parent in parents],
        "rows": 0 if measurements is None else len(measurements),
        "data_sha256": "" if measurements is None else data_hash(measurements),
        "sources": [] if measurements is None else list(measurements.sources),
        "screened_rows": [] if none else [int(i) for i in screened],
        "settings": dict(settings),
    }


def identity_of(model: ErrorModel) -> ModelIdentity:
    """Returns which description of the arm this is.

    Everything in an error model's archive counts; the cell in its file does not. A nominal arm is
    its geometry.
    """
    if not model.calibrated:
        return nominal_identity(model.robot)
    return ModelIdentity(kind="calibrated", robot=model.robot.name, sha256=model_hash(model))
