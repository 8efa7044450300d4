"""A drilling model as a file: JSON and arrays, nothing else."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.archive import Archive, archive_reader, read_archive, write_archive
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import provenance_from
from robotrue.drilling.campaign import Conditions
from robotrue.drilling.correction import ReadingCorrection
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Kind, Position
from robotrue.drilling.foot import Foot, Skin, SkinKind, TakenZero
from robotrue.drilling.foot_model import Envelope, Frozen, NormalModel
from robotrue.drilling.head import AxisOrder, Head
from robotrue.drilling.physics import PhysicsCorrection
from robotrue.drilling.refinement import Refinement, Watch
from robotrue.drilling.regression import Family, LinearCorrection
from robotrue.errors import ArchiveError

KIND: Final = "drilling-normal"
SCHEMA: Final = 1
_ARRAYS: Final = {
    "refinement": ("coefficients", "covariance"),
    "monitor": ("sums", "since", "spread"),
    "linear": ("coefficients", "covariance", "sigma"),
    "process": ("causes", "errors", "theta", "learned"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SkinDocument:
    """A :class:`Skin`; curvature in 1/m, None where it is to be found from the readings."""

    kind: SkinKind
    curvature: float | None
    axis: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeDocument:
    """What of an :class:`Envelope` is no array."""

    tilt: float
    approach: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RefinementDocument:
    """What of a :class:`Refinement` is no array."""

    sigma: float
    forgetting: float
    records: int
    truths: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchDocument:
    """What of a :class:`Watch` is no array."""

    records: int
    allowance: float
    limit: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionDocument:
    """What of a correction is no array.

    Attributes:
        form: ``linear`` or ``process``.
        inputs: Causes besides tilt, force and height; models written before had none.
        corrects: What is corrected; models written before corrected readings.
        family: Of a linear correction.
        widening: Of a process.
    """

    form: str
    inputs: tuple[Position, ...] = ()
    corrects: Corrects = CORRECTS
    family: Family | None = None
    widening: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalModelDocument:
    """The document of a model file; attributes as in :class:`NormalModel` and its parts (SI)."""

    kind: Kind
    order: AxisOrder
    sense: tuple[float, float]
    skin: SkinDocument
    reading_sigma: float
    reading_range: tuple[float, float] | None
    max_tilt: float
    envelope: EnvelopeDocument
    left: float
    stretch: float
    campaign_sha256: str
    refinement: RefinementDocument
    monitor: WatchDocument
    version: int
    frozen: Frozen | None
    provenance: object = None
    own: CorrectionDocument
    patent: CorrectionDocument | None = None


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
    skin, reading_range = model.foot.skin, model.foot.reading_range.tolist()
    own, own_arrays = _store_correction(model.correction)
    patent, patent_arrays = (None, {}) if model.patent is None else _store_correction(model.patent)
    refinement, monitor = model.refinement, model.monitor
    stated = NormalModelDocument(
        kind=model.kind,
        order=model.head.order,
        sense=model.head.sense,
        skin=SkinDocument(
            kind=skin.kind,
            curvature=None if np.isnan(skin.radius) else 1.0 / skin.radius,
            axis=skin.axis,
        ),
        reading_sigma=model.foot.reading_sigma,
        reading_range=reading_range if np.isfinite(reading_range).all() else None,
        max_tilt=model.foot.max_tilt,
        envelope=EnvelopeDocument(tilt=model.envelope.tilt, approach=model.envelope.approach),
        left=model.left,
        stretch=model.stretch,
        campaign_sha256=model.campaign,
        refinement=RefinementDocument(
            sigma=refinement.sigma,
            forgetting=refinement.forgetting,
            records=refinement.records,
            truths=refinement.truths,
        ),
        monitor=WatchDocument(
            records=monitor.records, allowance=monitor.allowance, limit=monitor.limit
        ),
        version=model.version,
        frozen=model.frozen,
        provenance=model.provenance.to_document(),
        own=own,
        patent=patent,
    )
    document = asdict(stated)
    for name in ("own", "patent"):  # either form states its own keys
        if document[name] is None:
            del document[name]
        else:
            document[name] = {k: v for k, v in document[name].items() if v is not None}
    arrays = {
        "radius": model.foot.radius,
        "angle": model.foot.angle,
        "p_pivot_tip": model.head.p_pivot_tip,
        "force": model.envelope.force,
        "height": model.envelope.height,
        "positions": model.envelope.positions,
    }
    if model.zero is not None:
        arrays |= {"zero": model.zero.readings, "zero_tilt_sigma": model.zero.tilt_sigma}
    for name, state in (("refinement", refinement), ("monitor", monitor)):
        arrays |= {f"{name}_{key}": getattr(state, key) for key in _ARRAYS[name]}
    for name, values in (("own", own_arrays), ("patent", patent_arrays)):
        arrays |= {f"{name}_{key}": value for key, value in values.items()}
    return Archive(kind=KIND, schema=SCHEMA, document=document, arrays=arrays)


@archive_reader
def from_archive(archive: Archive) -> NormalModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: An array or an entry is missing, or cannot be.
    """
    stated = decode(NormalModelDocument, dict(archive.document))
    _check_document(stated)
    refinement, monitor = stated.refinement, stated.monitor
    return NormalModel(
        foot=_read_foot(stated, archive),
        head=Head(
            order=stated.order,
            p_pivot_tip=archive.array("p_pivot_tip", finite=False),
            sense=stated.sense,
        ),
        kind=stated.kind,
        correction=_read_correction("own", stated.own, archive),
        patent=None
        if stated.patent is None
        else _read_correction("patent", stated.patent, archive),
        envelope=_read_envelope(stated.envelope, archive),
        left=stated.left,
        stretch=stated.stretch,
        campaign=stated.campaign_sha256,
        refinement=Refinement(
            **_read_state("refinement", archive),
            sigma=refinement.sigma,
            forgetting=refinement.forgetting,
            records=refinement.records,
            truths=refinement.truths,
        ),
        monitor=Watch(
            **_read_state("monitor", archive),
            records=monitor.records,
            allowance=monitor.allowance,
            limit=monitor.limit,
        ),
        version=stated.version,
        frozen=stated.frozen,
        provenance=provenance_from(stated.provenance, before=refinement.truths),
        zero=_read_zero(archive),
    )


def _read_zero(archive: Archive) -> TakenZero | None:
    """The zero of the campaign; models written before have none."""
    if "zero" not in archive.arrays:
        return None
    sigma = archive.array("zero_tilt_sigma")
    if (sigma < 0.0).any():
        raise ArchiveError("a deviation of the zero below 0.")
    return TakenZero(readings=archive.array("zero"), tilt_sigma=sigma)


def _check_document(stated: NormalModelDocument) -> None:
    """Passes if the numbers are possible."""
    if min(stated.refinement.records, stated.monitor.records, stated.version - 1) < 0:
        raise ArchiveError("counts below 0.")
    left, stretch = stated.left, stated.stretch
    if not 0.0 <= left < 1.6 or not 1.0 <= stretch < 1e9:
        raise ArchiveError(f"a tilt left of {left:g} rad, or a stretch of {stretch:g}.")


def _read_state(name: str, archive: Archive) -> dict[str, Array]:
    """Arrays of the refinement or the monitor."""
    arrays = {key: archive.array(f"{name}_{key}") for key in _ARRAYS[name]}
    for key, array in arrays.items():  # an empty one would be filled as one that is left out
        if not array.size:
            raise ArchiveError(f"{name}_{key} is empty.")
    return arrays


def _read_envelope(stated: EnvelopeDocument, archive: Archive) -> Envelope:
    force, height, tilt = archive.array("force"), archive.array("height"), stated.tilt
    if force[0] > force[1] or height[0] > height[1] or not 0.0 < tilt < 1.6:
        raise ArchiveError("an envelope whose lowest is above its highest, or of no tilt.")
    known = "positions" in archive.arrays
    positions = archive.array("positions", finite=False) if known else np.full((4, 2), np.nan)
    return Envelope(
        force=force,
        height=height,
        tilt=tilt,
        approach=stated.approach,
        positions=positions,
    )


def _read_foot(stated: NormalModelDocument, archive: Archive) -> Foot:
    skin, limits = stated.skin, stated.reading_range
    curvature = skin.curvature
    radius = np.nan if curvature is None else (1.0 / curvature if curvature else np.inf)
    return Foot(
        radius=archive.array("radius"),
        angle=archive.array("angle"),
        skin=Skin(kind=skin.kind, radius=radius, axis=skin.axis),
        reading_sigma=stated.reading_sigma,
        reading_range=np.array(limits if limits is not None else [-np.inf, np.inf]),
        max_tilt=stated.max_tilt,
    )


def _store_correction(
    correction: ReadingCorrection,
) -> tuple[CorrectionDocument, dict[str, Array]]:
    """What a correction is, for the document, and its arrays."""
    inputs, corrects = correction.inputs, correction.corrects
    if isinstance(correction, LinearCorrection):
        stated = CorrectionDocument(
            form="linear", family=correction.family, inputs=inputs, corrects=corrects
        )
        return stated, {key: getattr(correction, key) for key in _ARRAYS["linear"]}
    if not isinstance(correction, PhysicsCorrection):
        raise ArchiveError(f"a correction of type {type(correction).__name__} has no file form.")
    learned = np.isfinite(correction.theta)
    causes = correction.causes
    positions = causes.positions(correction.inputs)
    stated = CorrectionDocument(
        form="process", widening=correction.widening, inputs=inputs, corrects=corrects
    )
    return stated, {
        "causes": np.concatenate([causes.table, positions], axis=1),
        "errors": correction.errors,
        "theta": np.where(learned, correction.theta, 0.0),
        "learned": learned.astype(np.float64),
    }


def _read_correction(name: str, stated: CorrectionDocument, archive: Archive) -> ReadingCorrection:
    form = "linear" if stated.form == "linear" else "process"
    values = {key: archive.array(f"{name}_{key}") for key in _ARRAYS[form]}
    if form == "linear":
        if stated.family is None:
            raise ArchiveError(f"{name}.family is missing.")
        return LinearCorrection(
            family=stated.family, inputs=stated.inputs, corrects=stated.corrects, **values
        )
    if stated.widening is None:
        raise ArchiveError(f"{name}.widening is missing.")
    a, b, force, height, *positions = values["causes"].T
    names = {"X": "x", "Y": "y", "A": "axis_a", "B": "axis_b"}
    recorded = {names[axis]: column for axis, column in zip(stated.inputs, positions, strict=True)}
    return PhysicsCorrection(
        causes=Conditions(a=a, b=b, force=force, height=height, **recorded),
        errors=values["errors"],
        theta=np.where(values["learned"] > 0.0, values["theta"], -np.inf),
        widening=stated.widening,
        inputs=stated.inputs,
        corrects=stated.corrects,
    )
