"""Sampling clocks: even or refused, with the sample at which they are not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ImplausibleDataError

_OFF: Final = 0.25
"""Part of a sample by which a printed time may be off an even clock (rounding of its digits)."""


def even_rate(
    time: Array, source: str | Path, line_of: Callable[[int], int] | None = None
) -> tuple[float, float]:
    """Returns the first time (s) and the rate (samples/s) of evenly spaced times (n,) s.

    Args:
        time: As read.
        source: Of the message.
        line_of: Row to line of the file, for the message.

    Raises:
        ImplausibleDataError: Fewer than two samples, a time that does not rise, missing samples
            or an uneven clock.
    """

    def refuse(row: int, what: str, hint: str) -> ImplausibleDataError:
        place = None if line_of is None else line_of(row)
        named = what if line_of is not None else f"sample {row}: {what}"
        return ImplausibleDataError(named, source=source, line=place, hint=hint)

    if len(time) < 2:
        raise refuse(0, f"{len(time)} sample, expected two or more.", "record for longer.")
    step = np.diff(time)
    if (step <= 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1
        raise refuse(
            row,
            f"time goes from {time[row - 1]:.9g} to {time[row]:.9g} s: duplicated or reordered "
            "samples.",
            "sort them out at the recorder; a record is not repaired here.",
        )
    usual = float(np.median(step))
    if step.max() > 1.6 * usual:
        row = int(np.argmax(step > 1.6 * usual)) + 1
        missing = round(step[row - 1] / usual) - 1
        raise refuse(
            row,
            f"time jumps by {step[row - 1]:.6g} s where samples are {usual:.6g} s apart: about "
            f"{max(missing, 1)} missing.",
            "cut the record there, and predict each piece.",
        )
    index = np.arange(len(time))
    period = (time[-1] - time[0]) / (len(time) - 1)
    off = np.abs(time - time[0] - index * period)
    if off.max() > _OFF * period * max(1.0, 1e-4 * len(time)) or step.min() < 0.4 * usual:
        row = int(np.argmax(off))
        raise refuse(
            row,
            f"an uneven clock: {off[row]:.3g} s off samples of {period:.6g} s.",
            "record with a hardware clock, or resample at the recorder.",
        )
    return float(time[0]), float(1.0 / period)
