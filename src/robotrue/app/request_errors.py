"""Why a request was refused, in the words of the shell it came from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from pydantic import ValidationError

from robotrue.app.request import Request, RequestField, fields_of
from robotrue.errors import ConfigurationError

LIMITS: Final = {
    "greater_than": ("gt", "above {}"),
    "greater_than_equal": ("ge", "{} or more"),
    "less_than": ("lt", "below {}"),
    "less_than_equal": ("le", "{} or less"),
}
"""The limit in the context of an error, and its wording."""
EXPECTED: Final = {
    "bool_type": "true or false",
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "list_type": "a list",
    "tuple_type": "a list",
}
UNITS: Final = ("mm", "um", "deg", "ms", "s", "Hz", "N", "kg")


def on_command_line(field: RequestField) -> str:
    """Returns what messages of the command line call a field."""
    return field.option


def in_job(field: RequestField) -> str:
    """Returns what messages of a job call a field."""
    return f"parameter {field.name!r}"


def refusal(
    error: ValidationError,
    request: type[Request],
    name_of: Callable[[RequestField], str] = on_command_line,
) -> ConfigurationError:
    """Returns the first fault of a request as an error of ours.

    Args:
        error: All faults.
        request: Type of the request.
        name_of: What the shell calls a field.
    """
    faults = error.errors(include_url=False, include_context=True)
    fault = min(faults, key=lambda each: each["type"] != "extra_forbidden")
    fields = {field.name: field for field in fields_of(request)}
    name = str(fault["loc"][0]) if fault["loc"] else ""
    field = fields.get(name)
    if field is None:
        return ConfigurationError(f"{request.__name__}: {fault['msg']} ({name}).")
    value, kind = fault["input"], str(fault["type"])
    if kind == "literal_error":
        words = field.option if name_of is on_command_line else name.replace("_", " ")
        return ConfigurationError(
            f"{words} {value!r}, expected {_join_choices(field.choices)}.",
            hint=_example(field, name_of),
        )
    if kind in LIMITS:
        key, form = LIMITS[kind]
        limit = form.format(f"{fault['ctx'][key]:g}")
        words = name.removesuffix(f"_{_unit(name).strip()}").replace("_", " ")
        return ConfigurationError(
            f"{words} {value:g}{_unit(name)}, expected {limit}.", hint=_example(field, name_of)
        )
    expected = EXPECTED.get(kind, str(fault["msg"]))
    return ConfigurationError(f"{name_of(field)} is {value!r}, expected {expected}.")


def _join_choices(choices: tuple[str, ...]) -> str:
    *first, last = choices
    return f"{', '.join(first)} or {last}" if first else last


def _unit(name: str) -> str:
    unit = name.rpartition("_")[2]
    return f" {unit}" if unit in UNITS else ""


def _example(field: RequestField, name_of: Callable[[RequestField], str]) -> str | None:
    value: object = field.default
    if value is None or field.entry.argument:
        return None
    number = f"{value:g}" if isinstance(value, float) else f"{value}"
    return f"{field.option} {number}" if name_of is on_command_line else number
