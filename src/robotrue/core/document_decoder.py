"""Documents of JSON or TOML values, checked once at the door and typed from there on."""

from __future__ import annotations

import functools
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar, cast

from robotrue.errors import ArchiveError, RobotrueError

if TYPE_CHECKING:  # loading it takes a tenth of a second, which not every command needs
    from pydantic import TypeAdapter

T = TypeVar("T")
REMAKE: Final = "make the file again, or fetch it from its backup."


def decode(
    kind: type[T],
    stated: object,
    *,
    key: str = "",
    error: type[RobotrueError] = ArchiveError,
    source: str | Path | None = None,
    hint: str | None = None,
) -> T:
    """Returns JSON values as the stated type; keys that a record does not have are ignored.

    Args:
        kind: A frozen dataclass whose fields are the keys, or e.g. ``dict[str, float]``.
        stated: JSON values.
        key: Key of the values, for messages; empty for a whole document.
        error: Exception to raise.
        source: The file, for messages.
        hint: Remedy; of an archive, by default, to make it again.

    Raises:
        ArchiveError: A value is missing or of another type, with its key and the allowed values; or
            the given ``error``.
    """
    from pydantic import ValidationError

    try:
        return cast(T, _adapter(cast(Hashable, kind)).validate_python(stated))
    except ValidationError as cause:
        fault = cause.errors(include_url=False)[0]
        where = join_key(([key] if key else []) + list(fault["loc"]))
        if fault["type"] == "missing":
            message = f"{where} is missing."
        else:
            expected = expected_value(fault["type"], fault.get("ctx") or {})
            message = f"{where or 'the document'} is {show_value(fault['input'])}, {expected}."
        if error is ArchiveError:
            message = f"contents are incomplete or damaged: {message}"
            hint = hint or REMAKE
        raise error(message, source=source, hint=hint) from cause


def encode(record: object) -> dict[str, object]:
    """Returns a dataclass as JSON values that :func:`decode` reads, defaults left out."""
    values = _adapter(cast(Hashable, type(record))).dump_python(
        record, mode="json", exclude_defaults=True
    )
    return cast(dict[str, object], values)


@functools.cache
def _adapter(kind: Hashable) -> TypeAdapter[object]:
    from pydantic import TypeAdapter

    return TypeAdapter(cast(type[object], kind))


def expected_value(fault: str, facts: Mapping[str, object]) -> str:
    """Returns what is allowed where pydantic found a fault.

    Args:
        fault: Type of the fault, as pydantic names it.
        facts: Context of the fault: the limits.
    """
    return {
        "literal_error": f"expected {facts.get('expected')}",
        "float_type": "expected a number",
        "float_parsing": "expected a number",
        "finite_number": "expected a finite number",
        "greater_than": f"expected above {facts.get('gt', 0):g}",
        "greater_than_equal": f"expected {facts.get('ge', 0):g} or more",
        "less_than_equal": f"expected {facts.get('le', 0):g} or less",
        "int_type": "expected a whole number",
        "int_parsing": "expected a whole number",
        "int_from_float": "expected a whole number",
        "bool_type": "expected true or false",
        "bool_parsing": "expected true or false",
        "list_type": "expected a list",
        "tuple_type": "expected a list",
        "string_type": "expected text in quotation marks",
        "too_short": f"expected {facts.get('min_length')} values",
        "too_long": f"expected {facts.get('max_length')} values",
    }.get(
        fault,
        "expected a table"
        if any(word in fault for word in ("model", "dict", "dataclass"))
        else "not allowed here",
    )


def show_value(value: object) -> str:
    """Returns a value for a message, in 60 characters at most."""
    shown = repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


def join_key(where: Sequence[str | int]) -> str:
    """Returns ``robot.dh[2].d_mm`` for ("robot", "dh", 1, "d_mm"); rows count from one."""
    key = ""
    for part in where:
        key += f"[{part + 1}]" if isinstance(part, int) else f"{'.' if key else ''}{part}"
    return key
