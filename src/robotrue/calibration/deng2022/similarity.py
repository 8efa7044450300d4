"""Similarity of the errors of two regions: normalisation and cosine, eq. 9 and 10 (Table 4).

Equation 9 prints minimum and maximum the wrong way round, and equation 10 calls "coordinates" what
the text before it calls errors. The readings:

==================  ==============================================================================
``per-point``       eq. 9 for each region and axis; cosine of the three normalised components at
                    each point, averaged over the points. Recommended: closest to Table 4.
``swapped``         the same with minimum and maximum as printed: x becomes 1 - x
``shared``          the same with minimum and maximum over all regions together
``per-axis``        eq. 9 for each region; cosine over the n points of each axis, averaged
``raw``             no eq. 9; cosine of the error vectors at each point
``coordinates``     eq. 10 to the letter: no errors at all, cosine of the points' coordinates
==================  ==============================================================================
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotrue.calibration.deng2022.readings import (
    SIMILARITY_READING,
    SIMILARITY_READINGS,
    SimilarityReading,
)
from robotrue.core.arrays import Array, frozen
from robotrue.errors import ConfigurationError, ObservabilityError, ShapeError


def similarity(
    errors_a: Array, errors_b: Array, *, reading: SimilarityReading = SIMILARITY_READING
) -> float:
    """Returns the cosine similarity of two regions, -1 to 1; see :func:`similarities`."""
    return float(similarities(errors_a, [errors_b], reading=reading)[0])


def similarities(reference: Array, others: Sequence[Array], *, reading: SimilarityReading) -> Array:
    """Returns the similarity of each region to the reference region, (len(others),), eq. 9-10.

    Args:
        reference: (n, 3) errors in m, base axes; with the reading ``coordinates`` the points.
        others: (n, 3) each, at the points that correspond to those of the reference.
        reading: See the table above.

    Raises:
        ShapeError: Regions of different sizes, or no points.
        ConfigurationError: No such reading.
        ObservabilityError: An axis has one value everywhere and cannot be normalised, or every
            vector is zero.
    """
    if reading not in SIMILARITY_READINGS:
        raise ConfigurationError(
            f"no reading {reading!r}; readings are {list(SIMILARITY_READINGS)}."
        )
    first = frozen(reference, (None, 3), "reference")
    rest = [frozen(other, (len(first), 3), f"region {k + 1}") for k, other in enumerate(others)]
    if not len(first):
        raise ShapeError("no points in the regions.")
    regions = [first, *rest]
    if reading == "shared":
        together = np.concatenate(regions)
        limits = together.min(axis=0), together.max(axis=0)
        regions = [_normalise(r, *limits) for r in regions]
    elif reading in ("per-point", "swapped", "per-axis"):
        regions = [_normalise(r, r.min(axis=0), r.max(axis=0)) for r in regions]
    if reading == "swapped":
        regions = [1.0 - r for r in regions]
    over = 0 if reading == "per-axis" else 1
    return np.array([_mean_cosine(regions[0], other, over) for other in regions[1:]])


def _normalise(errors: Array, low: Array, high: Array) -> Array:
    """Equation 9, with the minimum in the numerator."""
    span = high - low
    flat = np.flatnonzero(span <= 0.0)
    if len(flat):
        raise ObservabilityError(
            f"the {'xyz'[flat[0]]} errors of a region are all {low[flat[0]] * 1e3:.6g} mm; "
            "eq. 9 cannot normalise them.",
            hint="the reading 'raw', or a region with more than one error.",
        )
    out: Array = (errors - low) / span
    return out


def _mean_cosine(a: Array, b: Array, over: int) -> float:
    """Mean of the cosines along an axis; a point with a zero vector is excluded."""
    length = np.linalg.norm(a, axis=over) * np.linalg.norm(b, axis=over)
    some = length > 0.0
    if not some.any():
        raise ObservabilityError("every vector is zero, so no angle between them exists.")
    return float(np.mean((a * b).sum(axis=over)[some] / length[some]))
