"""Programs damaged on purpose, and what any dialect makes of them: read, or refused by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from hypothesis import strategies as st

from robotrue.errors import FormatError
from robotrue.program.language import Language
from robotrue.program.program import Program, Replacement

Edits = list[tuple[float, int, bytes]]
"""Where (share of the bytes), how many bytes go, and what comes in their place."""
Moved = Callable[[Program, np.ndarray, np.ndarray], Replacement]


def edits(pieces: Sequence[bytes]) -> st.SearchStrategy[Edits]:
    """Up to six edits with pieces of the language, any bytes, or nothing."""
    piece = st.one_of(st.sampled_from(pieces), st.binary(max_size=3), st.just(b""))
    place = st.floats(0, 1, exclude_max=True)
    return st.lists(st.tuples(place, st.integers(0, 8), piece), min_size=1, max_size=6)


def edited(data: bytes, changes: Edits) -> bytes:
    """The data after one edit after the other."""
    for where, cut, piece in changes:
        at = int(where * (len(data) + 1))
        data = data[:at] + piece + data[at + cut :]
    return data


def read_or_refused(
    read: Callable[[bytes], Program], dialect: Language, moved: Moved, source: str, data: bytes
) -> bool:
    """Whether the data were read; then their zero correction is the data themselves."""
    try:
        program = read(data)
    except FormatError as error:
        refused = error
    else:
        assert dialect.write(program, moved(program, np.zeros(3), np.eye(3))) == data
        return True
    assert refused.source == source
    assert refused.line is not None
    assert 1 <= refused.line <= data.count(b"\n") + data.count(b"\r") + 1
    return False
