"""Errors in a TOML file in the user's words: key, value, allowed values, line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from robotrue.core.document_decoder import expected_value, join_key, show_value
from robotrue.errors import ConfigurationError

S = TypeVar("S", bound=BaseModel)
_HEADER: Final = re.compile(r"\s*+(\[\[?)([^\[\]]++)\]\]?\s*+(?:#.*)?")


def check_tables(
    schema: type[S], tables: Mapping[str, object], *, path: str | Path, text: str
) -> S:
    """Returns the tables of a TOML file as the model of its schema.

    Args:
        schema: The file is checked against it.
        tables: Of the file.
        path: For the message.
        text: Of the file, for the line.

    Raises:
        ConfigurationError: An unknown key, or an invalid value; with file and line.
    """
    try:
        return schema.model_validate(tables)
    except ValidationError as cause:
        raise _configuration_error(cause, path=path, text=text, schema=schema) from None


def _configuration_error(
    cause: ValidationError,
    *,
    path: str | Path,
    text: str,
    schema: type[BaseModel],
) -> ConfigurationError:
    """The error for the first fault pydantic found; unknown keys come before the others.

    A misspelt key is both unknown and missing; the first is what helps.
    """
    faults = sorted(cause.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    where = tuple(fault["loc"])
    message, hint = _message(schema, fault["type"], where, fault.get("ctx") or {}, fault["input"])
    if where == ("schema",) and fault["type"] == "literal_error":
        hint = "update robotrue, or write the file for schema 1."
    if fault["type"] == "missing" and where == ("schema",):
        hint = "begin the file with: schema = 1."
    more = len(faults) - 1
    if more:
        message += f" ({more} more fault{'s' if more > 1 else ''} in the file.)"
    return ConfigurationError(message, source=path, line=line_of_key(text, where), hint=hint)


def _message(
    schema: type[BaseModel],
    kind: str,
    where: Sequence[str | int],
    facts: Mapping[str, object],
    value: object,
) -> tuple[str, str | None]:
    key = join_key(where)
    if kind == "extra_forbidden":
        known = _known_keys(schema, where[:-1])
        near = [k for k in known if k.startswith(f"{where[-1]}_")] or difflib.get_close_matches(
            str(where[-1]), known, n=1, cutoff=0.5
        )
        hint = f"{join_key((*where[:-1], near[0]))}." if near else "remove the key."
        return f"unknown key {key}; allowed are {', '.join(known)}.", hint
    if kind == "missing":
        return f"{key} is missing.", None
    return f"{key} is {show_value(value)}, {expected_value(kind, facts)}.", None


def _known_keys(schema: type[BaseModel], where: Sequence[str | int]) -> list[str]:
    """Returns the keys a table may have."""
    model = schema
    for part in where:
        if isinstance(part, str):
            found = _table_type(model.model_fields[part].annotation)
            model = found or model
    return [field.alias or name for name, field in model.model_fields.items()]


def _table_type(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in get_args(annotation):
        found = _table_type(inner)
        if found is not None:
            return found
    return None


def line_of_key(text: str, where: Sequence[str | int]) -> int | None:
    """Returns the one-based line of a key, or of its nearest table; None if neither exists.

    Args:
        text: The TOML file.
        where: The key's path, e.g. ("robot", "dh", 1, "d_mm").
    """
    names = [part for part in where if isinstance(part, str)]
    depth_of_list = next((k for k, part in enumerate(where) if isinstance(part, int)), 0)
    place = where[depth_of_list] if depth_of_list else None
    inside: list[str] = []
    count = -1  # of [[tables]] with the name that is looked for
    best: tuple[int, int] | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        header = _HEADER.fullmatch(line)
        if header:
            inside = [part.strip().strip("\"'") for part in header[2].split(".")]
            here = inside
            if header[1] == "[[" and here == names[:depth_of_list]:
                count += 1
                if place not in (None, count):
                    inside = here = []
        else:
            key = re.match(r"\s*([\w\"'.-]+)\s*=", line)
            if key is None:
                continue
            here = inside + [part.strip("\"'") for part in key[1].split(".")]
        depth = len(here)
        if here and here == names[:depth] and (best is None or depth > best[0]):
            best = (depth, number)
    return best[1] if best else None
