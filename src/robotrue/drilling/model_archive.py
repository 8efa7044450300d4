"""A drilling model as a file: JSON and arrays, nothing else."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.archive import Archive, archive_reader, read_archive, write_archive
from robotrue.core.archive_tables import pack_table, unpack_table
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import provenance_from
from robotrue.drilling.campaign import Conditions
from robotrue.drilling.correction import ReadingCorrection
from robotrue.drilling.drill_defaults import Kind, Position
from robotrue.drilling.foot import Foot, Skin, SkinKind, TakenZero
from robotrue.drilling.foot_model import Envelope, Frozen, NormalModel
from robotrue.drilling.head import AxisOrder, Head
from robotrue.drilling.physics import PhysicsCorrection
from robotrue.drilling.refinement import Refinement, Watch
from robotrue.drilling.regression import LinearCorrection
from robotrue.errors import ArchiveError

KIND: Final = "drilling-normal"
SCHEMA: Final = 1
_LATER: Final = ("inputs", "corrects")
"""Of a correction; models written before corrected readings, by tilt, force and height alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SkinDocument:
    """A :class:`Skin`; curvature in 1/m, None where it is to be found from the readings."""

    kind: SkinKind
    curvature: float | None
    axis: float


@dataclass(frozen=True, slots=True, kw_only=True)
class NormalModelDocument:
    """The document of a model file; attributes as in :class:`NormalModel` and its parts (SI).

    Parts that are tables state what of them is no array.
    """

    kind: Kind
    order: AxisOrder
    sense: tuple[float, float]
    skin: SkinDocument
    reading_sigma: float
    reading_range: tuple[float, float] | None
    max_tilt: float
    envelope: dict[str, object]
    left: float
    stretch: float
    campaign_sha256: str
    refinement: dict[str, object]
    monitor: dict[str, object]
    version: int
    frozen: Frozen | None
    provenance: object = None
    own: dict[str, object]
    patent: dict[str, object] | None = None


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
    envelope, arrays = pack_table(model.envelope)
    refinement, refined = pack_table(model.refinement, prefix="refinement_")
    monitor, watched = pack_table(model.monitor, prefix="monitor_")
    own, learned = _pack_correction("own", model.correction)
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
        envelope=envelope,
        left=model.left,
        stretch=model.stretch,
        campaign_sha256=model.campaign,
        refinement=refinement,
        monitor=monitor,
        version=model.version,
        frozen=model.frozen,
        provenance=model.provenance.to_document(),
        own=own,
    )
    document = asdict(stated)
    del document["patent"]
    arrays |= {**refined, **watched, **learned}
    arrays |= {
        "radius": model.foot.radius,
        "angle": model.foot.angle,
        "p_pivot_tip": model.head.p_pivot_tip,
    }
    if model.patent is not None:
        document["patent"], learned = _pack_correction("patent", model.patent)
        arrays |= learned
    if model.zero is not None:
        arrays |= {"zero": model.zero.readings, "zero_tilt_sigma": model.zero.tilt_sigma}
    return Archive(kind=KIND, schema=SCHEMA, document=document, arrays=arrays)


@archive_reader
def from_archive(archive: Archive) -> NormalModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: An array or an entry is missing, or cannot be.
    """
    stated = decode(NormalModelDocument, dict(archive.document))
    refinement = unpack_table(
        Refinement, archive, stated.refinement, key="refinement", prefix="refinement_"
    )
    monitor = unpack_table(Watch, archive, stated.monitor, key="monitor", prefix="monitor_")
    _check_numbers(stated, refinement, monitor)
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
        refinement=refinement,
        monitor=monitor,
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


def _check_numbers(stated: NormalModelDocument, refinement: Refinement, monitor: Watch) -> None:
    """Passes if the numbers are possible."""
    if min(refinement.records, monitor.records, stated.version - 1) < 0:
        raise ArchiveError("counts below 0.")
    left, stretch = stated.left, stated.stretch
    if not 0.0 <= left < 1.6 or not 1.0 <= stretch < 1e9:
        raise ArchiveError(f"a tilt left of {left:g} rad, or a stretch of {stretch:g}.")


def _read_envelope(stated: dict[str, object], archive: Archive) -> Envelope:
    envelope = unpack_table(Envelope, archive, stated, key="envelope", later=("positions",))
    force, height = envelope.force, envelope.height
    if force[0] > force[1] or height[0] > height[1] or not 0.0 < envelope.tilt < 1.6:
        raise ArchiveError("an envelope whose lowest is above its highest, or of no tilt.")
    return envelope


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


def _pack_correction(
    name: str, correction: ReadingCorrection
) -> tuple[dict[str, object], dict[str, Array]]:
    """Returns the document and the arrays of a correction."""
    prefix = f"{name}_"
    if isinstance(correction, LinearCorrection):
        values, arrays = pack_table(correction, prefix=prefix)
        return {"form": "linear", **values}, arrays
    if not isinstance(correction, PhysicsCorrection):
        raise ArchiveError(f"a correction of type {type(correction).__name__} has no file form.")
    values, arrays = pack_table(correction, prefix=prefix, leave=("causes", "theta"))
    learned, causes = np.isfinite(correction.theta), correction.causes
    return {"form": "process", **values}, arrays | {
        prefix + "causes": np.column_stack([causes.table, causes.positions(correction.inputs)]),
        prefix + "theta": np.where(learned, correction.theta, 0.0),
        prefix + "learned": learned.astype(np.float64),
    }


def _read_correction(name: str, stated: dict[str, object], archive: Archive) -> ReadingCorrection:
    prefix = f"{name}_"
    if stated["form"] == "linear":
        return unpack_table(
            LinearCorrection, archive, stated, key=name, prefix=prefix, later=_LATER
        )
    causes, theta, learned = (
        archive.array(prefix + each) for each in ("causes", "theta", "learned")
    )
    inputs = decode(tuple[Position, ...], stated.get("inputs", ()), key=f"{name}.inputs")
    a, b, force, height, *positions = causes.T
    names = {"X": "x", "Y": "y", "A": "axis_a", "B": "axis_b"}
    recorded = {names[axis]: column for axis, column in zip(inputs, positions, strict=True)}
    return unpack_table(
        PhysicsCorrection,
        archive,
        stated,
        key=name,
        prefix=prefix,
        later=_LATER,
        causes=Conditions(a=a, b=b, force=force, height=height, **recorded),
        theta=np.where(learned > 0.0, theta, -np.inf),
    )
