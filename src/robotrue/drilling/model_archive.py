"""A drilling model as a file: JSON and arrays, nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from robotrue.core.archive import Archive, archive_reader, read_archive, write_archive
from robotrue.core.arrays import Array
from robotrue.core.provenance import provenance_from
from robotrue.drilling.campaign import Conditions
from robotrue.drilling.correction import ReadingCorrection
from robotrue.drilling.drill_defaults import CORRECTS, Corrects, Kind, Position
from robotrue.drilling.foot import Foot, Skin, TakenZero
from robotrue.drilling.foot_model import Envelope, Frozen, NormalModel
from robotrue.drilling.head import Head
from robotrue.drilling.physics import PhysicsCorrection
from robotrue.drilling.refinement import Refinement, Watch
from robotrue.drilling.regression import LinearCorrection
from robotrue.errors import ArchiveError

KIND: Final = "drilling-normal"
SCHEMA: Final = 1
_ARRAYS: Final = {
    "refinement": ("coefficients", "covariance"),
    "monitor": ("sums", "since", "spread"),
    "linear": ("coefficients", "covariance", "sigma"),
    "process": ("causes", "errors", "theta", "learned"),
}
_NUMBERS: Final = {
    "refinement": ("sigma", "forgetting", "records"),
    "monitor": ("records", "allowance", "limit"),
}


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
        "reading_range": reading_range if np.isfinite(reading_range).all() else None,
        "max_tilt": model.foot.max_tilt,
        "envelope": {"tilt": model.envelope.tilt, "approach": list(model.envelope.approach)},
        "left": model.left,
        "stretch": model.stretch,
        "campaign_sha256": model.campaign,
        "refinement": {"truths": list(model.refinement.truths)},
        "monitor": {},
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
        "positions": model.envelope.positions,
    }
    if model.zero is not None:
        arrays |= {"zero": model.zero.readings, "zero_tilt_sigma": model.zero.tilt_sigma}
    for name, state in (("refinement", model.refinement), ("monitor", model.monitor)):
        document[name] |= {key: getattr(state, key) for key in _NUMBERS[name]}
        arrays |= {f"{name}_{key}": getattr(state, key) for key in _ARRAYS[name]}
    for name, correction in (("own", model.correction), ("patent", model.patent)):
        if correction is not None:
            document[name], values = _store_correction(correction)
            arrays |= {f"{name}_{key}": value for key, value in values.items()}
    return Archive(kind=KIND, schema=SCHEMA, document=document, arrays=arrays)


@archive_reader
def from_archive(archive: Archive) -> NormalModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: An array or an entry is missing, or cannot be.
    """
    d = archive.document
    _check_document(d)
    return NormalModel(
        foot=_read_foot(d, archive),
        head=Head(
            order=d["order"],
            p_pivot_tip=archive.array("p_pivot_tip", finite=False),
            sense=(float(d["sense"][0]), float(d["sense"][1])),
        ),
        kind=d["kind"],
        correction=_read_correction("own", archive),
        patent=_read_correction("patent", archive) if "patent" in d else None,
        envelope=_read_envelope(d["envelope"], archive),
        left=float(d["left"]),
        stretch=float(d["stretch"]),
        campaign=str(d["campaign_sha256"]),
        refinement=Refinement(
            **_read_state("refinement", archive), truths=tuple(d["refinement"]["truths"])
        ),
        monitor=Watch(**_read_state("monitor", archive)),
        version=int(d["version"]),
        frozen=None if d["frozen"] is None else Frozen(**d["frozen"]),
        provenance=provenance_from(d.get("provenance"), before=d["refinement"]["truths"]),
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


def _check_document(d: Mapping[str, Any]) -> None:
    """Passes if kind and numbers are possible."""
    if d["kind"] not in get_args(Kind):
        raise ArchiveError(f"a correction of kind {d['kind']!r}, expected {get_args(Kind)}.")
    counts = (d["refinement"]["records"], d["monitor"]["records"], d["version"] - 1)
    if min(map(int, counts)) < 0:
        raise ArchiveError("counts below 0.")
    left, stretch = float(d["left"]), float(d["stretch"])
    if not 0.0 <= left < 1.6 or not 1.0 <= stretch < 1e9:
        raise ArchiveError(f"a tilt left of {left:g} rad, or a stretch of {stretch:g}.")


def _read_state(name: str, archive: Archive) -> dict[str, Any]:
    """Numbers and arrays of the refinement or the monitor."""
    stated = archive.document[name]
    numbers = {key: float(stated[key]) for key in _NUMBERS[name]}
    arrays = {key: archive.array(f"{name}_{key}") for key in _ARRAYS[name]}
    for key, array in arrays.items():  # an empty one would be filled as one that is left out
        if not array.size:
            raise ArchiveError(f"{name}_{key} is empty.")
    return {**numbers, **arrays, "records": int(stated["records"])}


def _read_envelope(stated: Mapping[str, Any], archive: Archive) -> Envelope:
    force, height, tilt = archive.array("force"), archive.array("height"), float(stated["tilt"])
    if force[0] > force[1] or height[0] > height[1] or not 0.0 < tilt < 1.6:
        raise ArchiveError("an envelope whose lowest is above its highest, or of no tilt.")
    known = "positions" in archive.arrays
    positions = archive.array("positions", finite=False) if known else np.full((4, 2), np.nan)
    return Envelope(
        force=force,
        height=height,
        tilt=tilt,
        approach=tuple(stated["approach"]),
        positions=positions,
    )


def _read_foot(d: Mapping[str, Any], archive: Archive) -> Foot:
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


def _store_correction(correction: ReadingCorrection) -> tuple[dict[str, Any], dict[str, Array]]:
    """What a correction is, for the document, and its arrays."""
    used = {"inputs": list(correction.inputs), "corrects": correction.corrects}
    if isinstance(correction, LinearCorrection):
        stated = {"form": "linear", "family": correction.family, **used}
        return stated, {key: getattr(correction, key) for key in _ARRAYS["linear"]}
    if not isinstance(correction, PhysicsCorrection):
        raise ArchiveError(f"a correction of type {type(correction).__name__} has no file form.")
    learned = np.isfinite(correction.theta)
    causes = correction.causes
    positions = causes.positions(correction.inputs)
    return {"form": "process", "widening": correction.widening, **used}, {
        "causes": np.concatenate([causes.table, positions], axis=1),
        "errors": correction.errors,
        "theta": np.where(learned, correction.theta, 0.0),
        "learned": learned.astype(np.float64),
    }


def _read_correction(name: str, archive: Archive) -> ReadingCorrection:
    stated = archive.document[name]
    form = "linear" if stated["form"] == "linear" else "process"
    inputs, corrects = _read_use(stated)
    values = {key: archive.array(f"{name}_{key}") for key in _ARRAYS[form]}
    if form == "linear":
        return LinearCorrection(family=stated["family"], inputs=inputs, corrects=corrects, **values)
    a, b, force, height, *positions = values["causes"].T
    names = {"X": "x", "Y": "y", "A": "axis_a", "B": "axis_b"}
    recorded = {names[name]: column for name, column in zip(inputs, positions, strict=True)}
    return PhysicsCorrection(
        causes=Conditions(a=a, b=b, force=force, height=height, **recorded),
        errors=values["errors"],
        theta=np.where(values["learned"] > 0.0, values["theta"], -np.inf),
        widening=float(stated["widening"]),
        inputs=inputs,
        corrects=corrects,
    )


def _read_use(stated: Mapping[str, Any]) -> tuple[tuple[Position, ...], Corrects]:
    """Inputs and what is corrected; models written before had none and corrected readings."""
    inputs, corrects = tuple(stated.get("inputs", ())), stated.get("corrects", CORRECTS)
    if not set(inputs) <= set(get_args(Position)) or corrects not in get_args(Corrects):
        raise ArchiveError(f"a correction of {corrects!r} with the inputs {inputs}.")
    return inputs, corrects
