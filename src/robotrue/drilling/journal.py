"""Journal of a session: one JSON line per event, on disk before the machine moves.

After a stop of any kind the session continues from it: which clamps wait for a reference, the
number of holes, and which references the model must contain. A last line without its end was cut by
that stop and is left out.

A reference is in the journal before the refined model is written, and without an output file no
refined model is written at all. A stop in between leaves the model behind its journal;
:func:`replay_references` brings it up to it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import UTC, datetime
from io import FileIO
from math import isfinite, nan
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import MEASURED
from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import move_document, surface_document
from robotrue.drilling.campaign import Clamps
from robotrue.drilling.campaign_csv import PLACE
from robotrue.drilling.foot_model import NormalModel, estimate_tilt
from robotrue.drilling.hole_session import SIMULATED, HoleAnswer, MovedHole
from robotrue.drilling.journal_lines import foreign_line, whole_lines
from robotrue.drilling.production import RecordUpdate, record_of, update_model
from robotrue.errors import ArchiveError, FormatError, ModelMismatchError

SAME_TILT: Final = 1e-6 * DEG
"""rad; tilts of one model at one clamp differ by less, after their way through the journal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BookedReference:
    """A reference as the journal holds it, with what it did to the model.

    Attributes:
        hole: As answered.
        moved: The clamp and the tilt by which the spindle moved.
        left: (2,) rad, true normal less spindle axis after the move, as (a, b).
        truth: What measured it.
        sigma: rad, deviation of the reference; None in journals that do not state it.
        simulated: Whether the model rests on simulated data after it.
        version: Of the model after it.
        records: The model's watch has seen after it; None in journals that do not state it.
    """

    hole: str
    moved: MovedHole
    left: Array
    truth: str
    sigma: float | None
    simulated: bool
    version: int
    records: int | None

    @property
    def position(self) -> tuple[int, int]:
        """Grows with each reference: a frozen model keeps its version and counts records."""
        return self.version, -1 if self.records is None else self.records


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalState:
    """State of a session.

    Attributes:
        answered: Clamps answered.
        waiting: Holes that were moved for and wait for a reference, by name.
        references: All that were taken, in their order.
        version: Of the model, at the last line; 0 without one.
    """

    answered: int
    waiting: Mapping[str, MovedHole]
    references: tuple[BookedReference, ...]
    version: int


def answer_document(answer: HoleAnswer) -> dict[str, object]:
    """Returns an answer as sent to the machine and the journal: deg, mm, N."""
    document: dict[str, object] = {"hole": answer.hole, "version": answer.version}
    if answer.simulated:
        document["simulated"] = True
    if answer.adjustment is None:
        return {**document, "status": "refused", "said": answer.refused}
    found = answer.adjustment
    return {
        **document,
        "status": "move",
        **surface_document(found),
        **{name: v for name, v in move_document(found.move).items() if isfinite(v)},
        "notes": list(found.notes),
    }


def step_document(
    hole: str, step: RecordUpdate, left_deg: tuple[float, float], truth: str
) -> dict[str, object]:
    """Returns the effect of a reference on the model, as sent to the machine and the journal."""
    return {
        **({"simulated": True} if step.model.provenance.simulated else {}),
        "hole": hole,
        "status": "alarm" if step.alarm else "recorded",
        "left_a_deg": left_deg[0],
        "left_b_deg": left_deg[1],
        "truth": truth,
        "shift_deg": (step.shift / DEG).tolist(),
        "said": step.said,
        "version": step.model.version,
        "frozen": 0 if step.model.frozen is None else step.model.frozen.version,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _MoveLine:
    """The line of a hole that was moved for; NaN where a machine does not state a position."""

    d_mm: tuple[float, ...]
    force_N: float
    z_mm: float
    approach: str
    a_deg: float
    b_deg: float
    version: int
    X_mm: float = nan
    Y_mm: float = nan
    at_A_deg: float = nan
    at_B_deg: float = nan


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReferenceLine:
    """The line of a reference, as :class:`BookedReference`."""

    hole: str
    left_a_deg: float
    left_b_deg: float
    truth: str
    version: int
    simulated: bool = False
    sigma_deg: float | None = None
    watch_records: int | None = None


class Journal(AbstractContextManager["Journal"]):
    """An open journal; a context manager.

    Args:
        path: Gone on with if it is there.

    Raises:
        FormatError: It cannot be opened, or holds a line that is not of a journal.
    """

    def __init__(self, path: str | Path) -> None:
        self._path = Path(path)
        try:
            self._file = FileIO(self._path, "a+")
        except OSError as cause:
            raise FormatError(
                f"cannot write: {cause.strerror}.", source=path, hint="check the folder."
            ) from cause
        try:
            self.state = self._read_state()
        except BaseException:
            self._file.close()
            raise

    def __exit__(self, *failure: object) -> None:
        self._file.close()

    def write_answer(self, answer: HoleAnswer, document: Mapping[str, object]) -> None:
        """Writes an answer to the disk.

        Raises:
            FormatError: The disk does not take it: the machine must not move.
        """
        line: dict[str, object] = {"kind": "answer", **document}
        if answer.clamps is not None:
            line |= {
                "d_mm": (answer.clamps.readings[0] / MM).tolist(),
                "force_N": float(answer.clamps.force[0]),
                "z_mm": float(answer.clamps.height[0] / MM),
                "approach": answer.clamps.approach[0],
                "at_A_deg": float(answer.axes[0] / DEG),
                "at_B_deg": float(answer.axes[1] / DEG),
            }
            for name, v in zip(PLACE, (answer.clamps.place[0] / MM).tolist(), strict=True):
                if isfinite(v):
                    line[name] = v
        self._put(line)

    def write_reference(
        self, document: Mapping[str, object], *, sigma: float, records: int
    ) -> None:
        """Writes the effect of a reference to the disk.

        Args:
            document: As sent to the machine.
            sigma: rad, deviation of the reference.
            records: The model's watch has seen, this one included.

        Raises:
            FormatError: The disk does not take it.
        """
        self._put(
            {"kind": "reference", **document, "sigma_deg": sigma / DEG, "watch_records": records}
        )

    def _put(self, document: Mapping[str, object]) -> None:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = {**document, "written_utc": at}
        data = (json.dumps(line, allow_nan=False) + "\n").encode()
        size = self._file.seek(0, os.SEEK_END)
        try:
            done = 0
            while done < len(data):
                done += self._file.write(data[done:]) or 0
            os.fsync(self._file.fileno())
        except OSError as cause:
            self._file.truncate(size)
            raise FormatError(
                f"cannot write: {cause.strerror}.", source=self._path, hint="make room on the disk."
            ) from cause

    def _read_state(self) -> JournalState:
        """Reads the journal and truncates an incomplete last line."""
        self._file.seek(0)
        data = self._file.readall()
        entries, whole = whole_lines(data, source=self._path)
        answered, version = 0, 0
        waiting: dict[str, MovedHole] = {}
        references: list[BookedReference] = []
        for number, entry in enumerate(entries, start=1):
            try:
                if entry.kind == "answer":
                    answered += 1
                    if entry.status == "move":
                        waiting[entry.hole] = _read_move(entry.document)
                elif (moved := waiting.pop(entry.hole, None)) is not None:
                    references.append(_read_reference(entry.document, moved))
            except ArchiveError as cause:
                raise foreign_line(self._path, number) from cause
            version = entry.version
        if whole < len(data):
            self._file.truncate(whole)
        return JournalState(
            answered=answered, waiting=waiting, references=tuple(references), version=version
        )


def _read_move(entry: Mapping[str, object]) -> MovedHole:
    line = decode(_MoveLine, entry)
    clamps = Clamps(
        readings=np.array([line.d_mm]) * MM,
        force=np.array([line.force_N]),
        height=np.array([line.z_mm]) * MM,
        approach=(line.approach,),
        place=np.array([[line.X_mm, line.Y_mm]]) * MM,
        axes=np.array([[line.at_A_deg, line.at_B_deg]]) * DEG,
    )
    tilt = np.array([line.a_deg, line.b_deg]) * DEG
    return MovedHole(clamps=clamps, tilt=tilt, version=line.version)


def _read_reference(entry: Mapping[str, object], moved: MovedHole) -> BookedReference:
    line = decode(_ReferenceLine, entry)
    return BookedReference(
        hole=line.hole,
        moved=moved,
        left=np.array([line.left_a_deg, line.left_b_deg]) * DEG,
        truth=line.truth,
        sigma=None if line.sigma_deg is None else line.sigma_deg * DEG,
        simulated=line.simulated,
        version=line.version,
        records=line.watch_records,
    )


def replay_references(
    model: NormalModel,
    references: Iterable[BookedReference],
    *,
    reference_sigma: float,
    source: str | Path,
) -> tuple[NormalModel, int]:
    """Returns the model after its missing references, and their number.

    Args:
        model: As read from its file.
        references: All of the journal, in its order.
        reference_sigma: rad, deviation of references whose line does not state it.
        source: The journal.

    Raises:
        ModelMismatchError: The journal was not written with this model.
    """
    replayed = 0
    for reference in references:
        if reference.position <= (model.version, model.monitor.records):
            continue
        solution = estimate_tilt(model, reference.moved.clamps)
        # Only a hole that this very version moved can show whether it is this model.
        if reference.moved.version == model.version:
            off = np.abs(solution.tilt[0] - reference.moved.tilt).max()
            if not off <= SAME_TILT:
                raise _mismatch(
                    f"moved hole {reference.hole} by {off / DEG:.4f} deg more or less than", source
                )
        record = record_of(
            reference.hole,
            solution,
            reference.left,
            reference.truth,
            SIMULATED if reference.simulated and not model.provenance.simulated else MEASURED,
            moved=reference.moved.tilt,
        )
        sigma = reference_sigma if reference.sigma is None else reference.sigma
        step = update_model(model, solution, record, reference=sigma)
        booked = reference.records in (None, step.model.monitor.records)
        if not booked or reference.version != step.model.version:
            raise _mismatch(
                f"was at version {reference.version} after hole {reference.hole}, version "
                f"{step.model.version} would follow from",
                source,
            )
        model = step.model
        replayed += 1
    return model, replayed


def _mismatch(difference: str, source: str | Path) -> ModelMismatchError:
    return ModelMismatchError(
        f"the model that wrote this journal {difference} the model given.",
        source=source,
        hint="the model that run began with or wrote with -o, or another journal.",
    )
