"""The zero of a dynamometer, from the air before and behind the cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.core.arrays import Array
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.pass_stages import PassStages
from robotrue.errors import ObservabilityError


def zero_at_both_ends(
    record: ForceRecord, stages: PassStages, turn: float
) -> tuple[ForceRecord, Array]:
    """Returns the record without its zero, and what that was before and behind the cut (2, 3) N.

    A charge amplifier drifts along a pass. The mean of whole turns in the air is its zero there;
    between the two it is taken for a straight line.

    Args:
        record: In the axes of the sensor.
        stages: Of the pass.
        turn: Samples per turn of the spindle.

    Raises:
        ObservabilityError: Less than a turn of air on one side.
    """
    time = record.time
    before, behind = np.flatnonzero(time < stages.entry), np.flatnonzero(time >= stages.end)
    zeros, middles = [], []
    for rows, where in ((before, "before"), (behind, "behind")):
        whole = round(np.floor(len(rows) / turn + 1e-9) * turn)
        if whole < 1:
            raise ObservabilityError(
                f"{len(rows)} samples of air {where} the cut, expected a turn of {turn:.0f}.",
                source=record.source,
                hint="record for a second more on both sides.",
            )
        taken = rows[:whole] if where == "before" else rows[-whole:]
        zeros.append(record.force[taken].mean(axis=0))
        middles.append(time[taken].mean())
    part = (time - middles[0]) / (middles[1] - middles[0])
    line = zeros[0] + part[:, None] * (zeros[1] - zeros[0])
    return replace(record, force=record.force - line), np.array(zeros)
