"""A drilling model as a file: JSON and arrays, nothing else."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from robotrue.core.archive import Archive, archive_reader, read_archive, write_archive
from robotrue.core.arrays import Array
from robotrue.core.provenance import provenance_from
from robotrue.drilling.correction import ReadingCorrection
from robotrue.drilling.drill_defaults import Kind
from robotrue.drilling.foot import Foot
from robotrue.drilling.foot_model import Envelope, Frozen, NormalModel
from robotrue.drilling.head import Head
from robotrue.drilling.monitor import Watch
from robotrue.drilling.physics import PhysicsCorrection
from robotrue.drilling.refinement import Refinement
from robotrue.drilling.regression import LinearCorrection
from robotrue.drilling.skin import Skin
from robotrue.drilling.terms import Conditions
from robotrue.errors import ArchiveError

KIND: Final = "drilling-normal"
SCHEMA: Final = 1


def write_model(path: str | Path, model: NormalModel) -> None:
    """Writes a model whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    write_archive(path, to_archive(model))


def read_model(path: str | Path) -> NormalModel:
    """Returns the model in a file.

    Raises:
        ArchiveError: Not a drilling model, damaged, or written by a newer robotrue.
        FormatError: The file cannot be read.
    """
    archive = read_archive(path)
    archive.expect(KIND, SCHEMA, hint="pass a model that robotrue drill fit wrote.", source=path)
    return from_archive(archive)


def to_archive(model: NormalModel) -> Archive:
    """Returns a model as document and arrays (SI)."""
    skin, refinement, monitor = model.foot.skin, model.refinement, model.monitor
    low, high = (float(v) for v in model.foot.reading_range)
    document: dict[str, Any] = {
        "kind": model.kind,
        "order": model.head.order,
        "sense": list(model.head.sense),
        "skin": {
            "kind": skin.kind,
            "curvature": None if np.isnan(skin.radius) else 1.0 / skin.radius,
            "axis": skin.axis,
        },
        "reading_sigma": model.foot.reading_sigma,
        "reading_range": [low, high] if np.isfinite([low, high]).all() else None,
        "max_tilt": model.foot.max_tilt,
        "envelope": {"tilt": model.envelope.tilt, "approach": list(model.envelope.approach)},
        "left": model.left,
        "stretch": model.stretch,
        "campaign_sha256": model.campaign,
        "refinement": {
            "sigma": refinement.sigma,
            "forgetting": refinement.forgetting,
            "records": refinement.records,
            "truths": list(refinement.truths),
        },
        "monitor": {
            "records": monitor.records,
            "allowance": monitor.allowance,
            "limit": monitor.limit,
        },
        "version": model.version,
        "frozen": None if model.frozen is None else asdict(model.frozen),
        "provenance": model.provenance.to_document(),
    }
    arrays = {
        "radius": model.foot.radius,
        "angle": model.foot.angle,
        "p_pivot_tip": model.head.p_pivot_tip,
        "force": model.envelope.force,
        "height": model.envelope.height,
        "refinement_coefficients": refinement.coefficients,
        "refinement_covariance": refinement.covariance,
        "monitor_sums": monitor.sums,
        "monitor_since": monitor.since,
        "monitor_spread": monitor.spread,
        **_correction_arrays("own", model.correction, document),
    }
    if model.patent is not None:
        arrays |= _correction_arrays("patent", model.patent, document)
    return Archive(kind=KIND, schema=SCHEMA, document=document, arrays=arrays)


@archive_reader
def from_archive(archive: Archive) -> NormalModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: An array or an entry is missing, or cannot be.
    """
    d, a = archive.document, archive.array
    foot = _foot(d, archive)
    watch, kept = d["monitor"], d["refinement"]
    kind: Kind = d["kind"]
    if kind not in get_args(Kind):
        raise ArchiveError(f"a correction of kind {kind!r}, expected {get_args(Kind)}.")
    force, height, tilt = a("force"), a("height"), float(d["envelope"]["tilt"])
    if force[0] > force[1] or height[0] > height[1] or not 0.0 < tilt < 1.6:
        raise ArchiveError("an envelope whose lowest is above its highest, or of no tilt.")
    counts = (int(kept["records"]), int(watch["records"]), int(d["version"]) - 1)
    if min(counts) < 0:
        raise ArchiveError("counts below 0.")
    left, stretch = float(d["left"]), float(d["stretch"])
    if not 0.0 <= left < 1.6 or not 1.0 <= stretch < 1e9:
        raise ArchiveError(f"a tilt left of {left:g} rad, or a stretch of {stretch:g}.")
    return NormalModel(
        foot=foot,
        head=Head(
            order=d["order"],
            p_pivot_tip=a("p_pivot_tip", finite=False),
            sense=(float(d["sense"][0]), float(d["sense"][1])),
        ),
        kind=kind,
        correction=_correction("own", archive),
        patent=_correction("patent", archive) if "patent" in d else None,
        envelope=Envelope(
            force=force,
            height=height,
            tilt=tilt,
            approach=tuple(d["envelope"]["approach"]),
        ),
        left=left,
        stretch=stretch,
        campaign=str(d["campaign_sha256"]),
        refinement=Refinement(
            coefficients=a("refinement_coefficients"),
            covariance=a("refinement_covariance"),
            sigma=float(kept["sigma"]),
            forgetting=float(kept["forgetting"]),
            records=int(kept["records"]),
            truths=tuple(kept["truths"]),
        ),
        monitor=Watch(
            sums=a("monitor_sums"),
            since=a("monitor_since"),
            spread=a("monitor_spread"),
            records=int(watch["records"]),
            allowance=float(watch["allowance"]),
            limit=float(watch["limit"]),
        ),
        version=int(d["version"]),
        frozen=None if d["frozen"] is None else Frozen(**d["frozen"]),
        provenance=provenance_from(d.get("provenance"), before=kept["truths"]),
    )


def _foot(d: Any, archive: Archive) -> Foot:
    skin, limits = d["skin"], d["reading_range"]
    curvature = skin["curvature"]
    radius = np.nan if curvature is None else (1.0 / curvature if curvature else np.inf)
    return Foot(
        radius=archive.array("radius"),
        angle=archive.array("angle"),
        skin=Skin(kind=skin["kind"], radius=float(radius), axis=float(skin["axis"])),
        reading_sigma=float(d["reading_sigma"]),
        reading_range=np.array(limits if limits is not None else [-np.inf, np.inf]),
        max_tilt=float(d["max_tilt"]),
    )


def _correction_arrays(
    name: str, correction: ReadingCorrection, document: dict[str, Any]
) -> dict[str, Array]:
    """Adds what a correction is to the document; returns its arrays under its name."""
    if isinstance(correction, LinearCorrection):
        document[name] = {"form": "linear", "family": correction.family}
        kept = {k: getattr(correction, k) for k in ("coefficients", "covariance", "sigma")}
    elif isinstance(correction, PhysicsCorrection):
        learned = np.isfinite(correction.theta)
        document[name] = {"form": "process", "widening": correction.widening}
        kept = {
            "causes": correction.causes.table,
            "errors": correction.errors,
            "theta": np.where(learned, correction.theta, 0.0),
            "learned": learned.astype(np.float64),
        }
    else:
        raise ArchiveError(f"a correction of type {type(correction).__name__} has no file form.")
    return {f"{name}_{key}": value for key, value in kept.items()}


def _correction(name: str, archive: Archive) -> ReadingCorrection:
    stated = archive.document[name]
    values = {
        key: archive.array(f"{name}_{key}")
        for key in (
            ("coefficients", "covariance", "sigma")
            if stated["form"] == "linear"
            else ("causes", "errors", "theta", "learned")
        )
    }
    if stated["form"] == "linear":
        return LinearCorrection(family=stated["family"], **values)
    causes = values["causes"]
    return PhysicsCorrection(
        causes=Conditions(a=causes[:, 0], b=causes[:, 1], force=causes[:, 2], height=causes[:, 3]),
        errors=values["errors"],
        theta=np.where(values["learned"] > 0.0, values["theta"], -np.inf),
        widening=float(stated["widening"]),
    )
