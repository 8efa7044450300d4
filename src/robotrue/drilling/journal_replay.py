"""Brings a model up to its journal: books references whose refined model never reached a file.

A reference is on the journal's disk before the refined model is written, and without an output file
no refined model is written at all. A stop in between leaves the model behind its journal.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.provenance import MEASURED
from robotrue.core.units import DEG
from robotrue.drilling.foot_model import NormalModel, estimate_tilt
from robotrue.drilling.hole_session import SIMULATED
from robotrue.drilling.journal import BookedReference
from robotrue.drilling.production import record_of, update_model
from robotrue.errors import ModelMismatchError

SAME_TILT: Final = 1e-6 * DEG
"""rad; tilts of one model at one clamp differ by less, after their way through the journal."""


def replay_references(
    model: NormalModel,
    references: Iterable[BookedReference],
    *,
    reference_sigma: float,
    source: str | Path,
) -> tuple[NormalModel, int]:
    """Returns the model after the references it lacks, and how many those were.

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
        if not reference.is_booked_as(step.model.version, step.model.monitor.records):
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
