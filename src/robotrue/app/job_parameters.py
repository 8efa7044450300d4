"""Parameters of jobs: the same requests, with items of a workspace in place of files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, WithJsonSchema, create_model

from robotrue.app.job_naming import NAMED, Naming
from robotrue.app.operation import AnyOperation
from robotrue.app.registry import job_operations
from robotrue.app.request import (
    JOB,
    Item,
    ItemVersion,
    Option,
    Output,
    Request,
    RequestField,
    fields_of,
)
from robotrue.app.request_errors import in_job, refusal
from robotrue.errors import ConfigurationError

ItemParameter = Annotated[
    str | ItemVersion,
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string", "maxLength": 200},
                {
                    "type": "object",
                    "properties": {
                        "id": {"type": "string", "maxLength": 200},
                        "version": {"type": ["integer", "null"]},
                    },
                    "required": ["id"],
                    "additionalProperties": False,
                },
            ]
        }
    ),
]
"""An item by its id, the beginning of it, its name, or id and version."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """The checked parameters of a job."""

    request: Request
    naming: Naming


@cache
def parameters_model(request: type[Request]) -> type[Naming]:
    """Returns the pydantic model of a job's parameters: the schema of its HTTP body."""
    fields: dict[str, Any] = {
        field.name: _parameter(field) for field in fields_of(request) if field.is_in(JOB)
    }
    name = request.__name__.removesuffix("Request") + "Parameters"
    model: type[Naming] = create_model(name, __base__=Naming, **fields)
    return model


def _parameter(field: RequestField) -> tuple[Any, Any]:
    kind: Any = field.kind
    required = field.is_required(JOB)
    default = ... if required else field.default
    if isinstance(field.entry, Output):
        kind, default = bool, False
    elif isinstance(field.entry, Item):
        kind = ItemParameter
        if field.entry.listed:
            kind |= Annotated[list[ItemParameter], Field(min_length=1, max_length=1)]
    limits = [each for each in field.info.metadata if not isinstance(each, Option)]
    for limit in limits:
        kind = Annotated[kind, limit]
    if field.many:
        kind = Annotated[list[kind], Field(min_length=1)] if required else list[kind]
        default = ... if required else list(field.default or ())
    if field.optional and not required:
        kind = kind | None
    return Annotated[kind, Field(description=field.entry.help)], default


def stated_parameters(operation: AnyOperation, parameters: Mapping[str, Any]) -> Stated:
    """Returns the request that the parameters of a job state.

    Raises:
        ConfigurationError: An unknown parameter, one that is missing, or a value it cannot have.
    """
    request: type[Request] = operation.request
    fields = {field.name: field for field in fields_of(request)}
    known = {name for name, field in fields.items() if field.is_in(JOB)} | set(NAMED)
    unknown = sorted(set(parameters) - known)
    if unknown:
        raise ConfigurationError(
            f"unknown parameter {unknown[0]!r}; known are {', '.join(sorted(known))}."
        )
    given = {name: value for name, value in parameters.items() if value is not None}
    for name, value in given.items():
        if name in fields and fields[name].many and not isinstance(value, list):
            given[name] = [value]
        elif name in fields and isinstance(value, list) and _is_listed(fields[name]):
            given[name] = _only(fields[name], value)
    try:
        model = parameters_model(request).model_validate(given)
    except ValidationError as error:
        raise _refusal(error, request, fields) from None
    values: dict[str, Any] = {}
    for name, field in fields.items():
        if isinstance(field.entry, Output):
            if field.entry.saved_as and (not field.is_in(JOB) or getattr(model, name)):
                values[name] = Path(field.entry.saved_as)
        elif field.is_in(JOB):
            value = getattr(model, name)
            values[name] = tuple(value) if isinstance(value, list) else value
    try:
        return Stated(
            request=request.model_validate(values),
            naming=Naming(name=model.name, note=model.note),
        )
    except ValidationError as error:
        raise _refusal(error, request, fields) from None


def _is_listed(field: RequestField) -> bool:
    return isinstance(field.entry, Item) and field.entry.listed


def _only(field: RequestField, values: list[Any]) -> Any:
    """The one item of a list.

    Raises:
        ConfigurationError: None, or several.
    """
    if len(values) != 1:
        raise ConfigurationError(
            f"{len(values)} items in parameter {field.name!r}, expected one.",
            hint=f"a job for each {getattr(field.entry, 'noun', 'item')}.",
        )
    return values[0]


def _refusal(
    error: ValidationError, request: type[Request], fields: Mapping[str, RequestField]
) -> ConfigurationError:
    """The first fault; a missing item says which noun is wanted."""
    for fault in error.errors(include_url=False):
        name = str(fault["loc"][0]) if fault["loc"] else ""
        if name in NAMED:
            return ConfigurationError(f"parameter {name!r} is {fault['input']!r}, expected text.")
        entry = fields[name].entry if name in fields else None
        if isinstance(entry, Item):
            if fault["type"] == "missing":
                return ConfigurationError(
                    f"the parameter {name!r} is missing: which {entry.noun}?",
                    hint="robotrue workspace list shows what there is.",
                )
            many = fields[name].many
            expected = f"one {entry.noun} or more" if many else f"the id of a {entry.noun}"
            return ConfigurationError(
                f"parameter {name!r} is {fault['input']!r}, expected {expected}."
            )
    return refusal(error, request, in_job)


def check_parameters(kind: str, parameters: Mapping[str, Any]) -> None:
    """Passes if a kind of job can be asked with these parameters; kinds of others always pass.

    Raises:
        ConfigurationError: As :func:`stated_parameters`.
    """
    operation = job_operations().get(kind)
    if operation is not None:
        stated_parameters(operation, parameters)


def parameter_schemas() -> dict[str, Any]:
    """Returns the JSON schema of the parameters of each kind of job."""
    requests: dict[str, type[Request]] = {k: each.request for k, each in job_operations().items()}
    return {kind: parameters_model(each).model_json_schema() for kind, each in requests.items()}
