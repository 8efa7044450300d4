"""Collection of the data for a model's certificate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotrue.calibration.model import ErrorModel, Query, history, provenance_of
from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.core.arrays import Array
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.provenance import Provenance, merge
from robotrue.errors import ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.tracker import DEFAULT_RANGE
from robotrue.report.certificate import CertificateFacts, Parameter, check_regions
from robotrue.report.labels import fact
from robotrue.report.model_view import list_geometric_errors, stiffness
from robotrue.report.report_files import file_fact
from robotrue.report.words import Lang, ReportTexts
from robotrue.validation.budget import (
    Budget,
    Contribution,
    stated_line,
    tracker_lines,
    uncertainty_budget,
)
from robotrue.validation.error_map import KnownPlaces, known_places
from robotrue.validation.evaluation import Evaluation, evaluate, row_loads
from robotrue.validation.iso9283 import repeated_poses
from robotrue.validation.metrics import ErrorStatistics, error_statistics
from robotrue.validation.validate import validate


def certificate_facts(
    model: ErrorModel,
    cell: Cell,
    check: MeasurementSet | None,
    *,
    part: str | None = None,
    force_sigma: float = 0.0,
    simulated: bool = False,
    files: Sequence[tuple[str, Path]] = (),
    lang: Lang = DEFAULT_LANG,
) -> CertificateFacts:
    """Returns the data of a certificate.

    Args:
        model: The error model.
        cell: Of the model file; with its part frames, if a registered cell was given.
        check: Poses that the fit did not use; None without.
        part: Which part frame counts; the only one if None.
        force_sigma: N per axis.
        simulated: Whether the data are; also taken from the provenance of model and check.
        files: Catalog key and path of each file to name with its hash.
        lang: Language of the names of regions.

    Raises:
        ObservabilityError: No check, and a model that keeps no joint range.
    """
    summary = model.training_summary()
    places = known_places(model, load=cell.payload)
    seen = None if check is None else evaluate(model, check, payload=cell.payload)
    sources = summary.sources
    held_out = summary.held_out_mean
    t = ReportTexts(lang=lang)
    regions: tuple[tuple[str, ErrorStatistics], ...] = ()
    if check is not None and seen is not None:
        rows = check_regions(seen.measured.position, check.group, check.group_names, lang=lang)
        regions = tuple((name, error_statistics(seen.after[index])) for name, index in rows)
    return CertificateFacts(
        robot=model.robot.name,
        method=summary.method or "-",
        simulated=simulated or origin_of(model, check).simulated,
        budget=_budget(model, cell, check, seen, places, part, force_sigma),
        places=places,
        check=None if check is None else validate(model, check, payload=cell.payload),
        regions=regions,
        repeats=()
        if seen is None
        else repeated_poses(model.robot.nominal(), seen.measured, seen.after),
        parameters=_parameters(model),
        lineage=tuple(history(model)),
        unseen=tuple(f"{d.name}: {d.cure}" for d in summary.unseen if d.cure and not d.harmless),
        doubts=summary.warnings,
        held_out=held_out,
        provenance=(
            *(fact(t, key, file_fact(path)) for key, path in files),
            fact(t, "fact.cell", f"{cell.source} sha256:{cell.digest}"),
            fact(t, "fact.training", summary.data_sha256 or "-"),
            *(fact(t, "fact.measured", source) for source in sources),
            fact(t, "fact.instrument", cell.tracker.name),
            fact(t, "fact.payload", f"{float(cell.payload.mass[0]):g} kg"),
        ),
    )


def origin_of(model: ErrorModel, check: MeasurementSet | None) -> Provenance:
    """Returns where a model and the poses that check it come from."""
    return merge([provenance_of(model), *([] if check is None else [check.provenance])])


def _budget(
    model: ErrorModel,
    cell: Cell,
    check: MeasurementSet | None,
    seen: Evaluation | None,
    places: KnownPlaces | None,
    part: str | None,
    force_sigma: float,
) -> Budget:
    if seen is not None:
        measured_rows = seen.measured
        query = Query(
            joints=measured_rows.joints,
            load=row_loads(measured_rows, cell.payload),
            approach=measured_rows.approach,
            conditions=measured_rows.conditions,
        )
    elif places is not None:
        query = Query(joints=places.joints, load=cell.payload)
    else:
        raise ObservabilityError(
            "no poses to state an uncertainty for: the model keeps no joint range.",
            hint="add a file of measured poses after the model.",
        )
    frame = None if cell.part is None else cell.part.frame(part)
    return uncertainty_budget(
        model,
        query,
        repeatability=cell.repeatability,
        instrument=_instrument(cell, check),
        T_base_part=None if frame is None else frame.T_base_part,
        part_covariance=None if frame is None else frame.covariance,
        force_sigma=force_sigma,
    )


def _instrument(cell: Cell, check: MeasurementSet | None) -> tuple[Contribution, ...]:
    """Range and angle of the tracker; one line where the file stated its own covariance."""
    if check is None:
        return tracker_lines(cell.tracker, np.array([DEFAULT_RANGE]))
    expected = tracker_covariance(cell, check.position)
    if check.frame != cell.frame or not np.allclose(check.covariance, expected, rtol=1e-6, atol=0):
        return stated_line(check.covariance)
    place = cell.tracker_position
    distance: Array = (
        np.full(len(check), DEFAULT_RANGE)
        if place is None
        else np.linalg.norm(check.position - place, axis=1)
    )
    return tracker_lines(cell.tracker, distance)


def _parameters(model: ErrorModel) -> tuple[Parameter, ...]:
    rows = [
        Parameter(name=name, value=p["value"], sd=p["sd"], unit=p["unit"], known=p["known"])
        for name, p in list_geometric_errors(model).items()
    ]
    rows += [
        Parameter(
            name=f"compliance{joint.removeprefix('joint ')}",
            value=p["compliance_rad_per_Nm"] * 1e6,
            sd=p["compliance_sd_rad_per_Nm"] * 1e6,
            unit="1e-6 rad/(N m)",
            known=p["known"],
        )
        for joint, p in stiffness(model).items()
    ]
    return tuple(rows)
