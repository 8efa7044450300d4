"""Files of learned deviations: compliant joints, or the components and vectors of Jin et al."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from robotrue.core.archive import Archive, read_archive
from robotrue.dynamics import deviation, paper_regression
from robotrue.dynamics.learned_deviation import LearnedDeviation
from robotrue.errors import ArchiveError

_READERS: Final[Mapping[str, Callable[[Archive], LearnedDeviation]]] = {
    deviation.KIND: deviation.deviation_from_archive,
    paper_regression.KIND: paper_regression.paper_from_archive,
}


def read_learned_deviation(path: str | Path) -> LearnedDeviation:
    """Returns the deviation that ``robotrue dynamics fit`` wrote.

    Raises:
        ArchiveError: Another kind of file, damaged, or written by a newer robotrue.
        FormatError: The file cannot be read.
    """
    archive = read_archive(path)
    if archive.kind not in _READERS:
        raise ArchiveError(
            f"an archive of kind {archive.kind!r}, expected {' or '.join(map(repr, _READERS))}.",
            source=path,
            hint="a deviation model is what `robotrue dynamics fit` writes.",
        )
    return _READERS[archive.kind](archive)
