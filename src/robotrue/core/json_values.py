"""JSON values of anything that has them: no array, no number that is not finite, no tuple."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Final, overload

_ODD: Final = re.compile("[\\0\\ud800-\\udfff]")


@overload
def json_values(value: Mapping[str, object]) -> dict[str, object]: ...


@overload
def json_values(value: object) -> object: ...


def json_values(value: object) -> object:
    """Returns the value in dicts, lists, text and numbers; numbers that are not finite are None."""
    if isinstance(value, Mapping):
        return {str(k): json_values(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(v) for v in value]
    to_list = getattr(value, "tolist", None)
    if to_list is not None:
        return json_values(to_list())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def texts_in(value: object) -> Iterator[str]:
    """Yields the texts in JSON or TOML values, keys excepted."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from texts_in(item)
    elif isinstance(value, list):
        for item in value:
            yield from texts_in(item)


def plain_text(value: object) -> bool:
    """Returns whether any database and any file keeps the text in JSON values.

    None keeps a NUL, nor half a character (a surrogate without its pair).
    """
    if isinstance(value, Mapping):
        return all(plain_text(k) and plain_text(v) for k, v in value.items())
    if isinstance(value, list | tuple):
        return all(plain_text(v) for v in value)
    if not isinstance(value, str):
        return True
    return _ODD.search(value) is None
