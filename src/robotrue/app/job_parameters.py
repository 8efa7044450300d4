"""Parameters of jobs: the same requests, with items of a workspace in place of files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, WithJsonSchema, create_model

from robotrue.app.job_files import (
    FileItem,
    NoPlaces,
    Places,
    file_item,
    is_result_folder,
    job_fields,
    require_result_name,
    result_name,
)
from robotrue.app.operation import AnyOperation
from robotrue.app.registry import job_operations
from robotrue.app.request import (
    JOB,
    NAMED,
    InputFile,
    Item,
    ItemVersion,
    Naming,
    Option,
    Output,
    Request,
    RequestField,
    fields_of,
)
from robotrue.app.request_errors import in_job, refusal
from robotrue.errors import ConfigurationError


def _item_schema(*more: str) -> WithJsonSchema:
    """The schema of a text, or of an item with its version and further texts."""
    text = {"type": "string", "maxLength": 200}
    return WithJsonSchema(
        {
            "anyOf": [
                text,
                {
                    "type": "object",
                    "properties": {
                        "id": text,
                        "version": {"type": ["integer", "null"]},
                        **dict.fromkeys(more, text),
                    },
                    "required": ["id"],
                    "additionalProperties": False,
                },
            ]
        }
    )


ItemParameter = Annotated[str | ItemVersion, _item_schema()]
"""An item by its id, the beginning of it, its name, or id and version."""
FileParameter = Annotated[str | FileItem, _item_schema("file")]
"""A file of an item of the workspace; over HTTP also ``{"upload": ID}``, which is kept as one."""
SentParameter = Annotated[str | ItemVersion | FileItem, _item_schema("file")]
"""An item, or a file as :data:`FileParameter`."""
ResultName = Annotated[str, Field(max_length=200)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """The checked parameters of a job."""

    request: Request
    naming: Naming


@cache
def parameters_model(operation: AnyOperation) -> type[Naming]:
    """Returns the pydantic model of a job's parameters: the schema of its HTTP body."""
    fields: dict[str, Any] = {
        field.name: _result_parameter(operation.request, field)
        if isinstance(field.entry, Output) and operation.save is None
        else _parameter(field)
        for field in job_fields(operation)
    }
    name = operation.request.__name__.removesuffix("Request") + "Parameters"
    model: type[Naming] = create_model(name, __base__=Naming, **fields)
    return model


def _result_parameter(request: type[Request], field: RequestField) -> tuple[object, object]:
    """The name of a result; one that may be left out is written under its usual name for true."""
    kind: object = list[ResultName] if field.many else ResultName
    default: object = result_name(request, field) if field.required else None
    if field.many:
        default = [] if default is None else [default]
    elif not field.required:
        kind = kind | bool | None
    return Annotated[kind, Field(description=field.entry.help)], default


def _parameter(field: RequestField) -> tuple[object, object]:
    kind: Any = field.kind
    required = field.is_required(JOB)
    default = ... if required else field.default
    if isinstance(field.entry, Output):
        kind, default = bool, False
    elif isinstance(field.entry, InputFile):
        kind = FileParameter
    elif isinstance(field.entry, Item):
        kind = SentParameter if field.entry.sent else ItemParameter
        if _is_listed(field):
            kind |= Annotated[list[kind], Field(min_length=1, max_length=1)]
    limits = [each for each in field.info.metadata if not isinstance(each, Option)]
    for limit in limits:
        kind = Annotated[kind, limit]
    if is_list(field):
        kind = Annotated[list[kind], Field(min_length=1)] if required else list[kind]
        default = ... if required else list(field.default or ())
    if field.optional and not required:
        kind = kind | None
    return Annotated[kind, Field(description=field.entry.help)], default


def stated_parameters(
    operation: AnyOperation, parameters: Mapping[str, object], places: Places | None = None
) -> Stated:
    """Returns the request that the parameters of a job state.

    Args:
        operation: That the job is of.
        parameters: JSON values.
        places: Of the files of the job; None: only names, where the request is but checked.

    Raises:
        ConfigurationError: An unknown parameter, one that is missing, or a value it cannot have.
    """
    request: type[Request] = operation.request
    fields = {field.name: field for field in fields_of(request)}
    stated = {field.name: field for field in job_fields(operation)}
    known = {*stated, *NAMED}
    unknown = sorted(set(parameters) - known)
    if unknown:
        raise ConfigurationError(
            f"unknown parameter {unknown[0]!r}; known are {', '.join(sorted(known))}."
        )
    given = {name: value for name, value in parameters.items() if value is not None}
    for name, value in given.items():
        if name in fields and is_list(fields[name]) and not isinstance(value, list):
            given[name] = [value]
        elif name in fields and isinstance(value, list) and _is_listed(fields[name]):
            given[name] = _only(fields[name], value)
    try:
        model = parameters_model(operation).model_validate(given)
    except ValidationError as error:
        raise _refusal(error, request, fields) from None
    place = NoPlaces() if places is None else places
    if operation.save is None:
        values = _kept_values(request, model, place)
    else:
        values = _saved_values(fields, stated, model)
    for name, field in stated.items():
        if isinstance(field.entry, InputFile):
            values |= _input_values(field, model, place)
        elif not isinstance(field.entry, Output):
            value = getattr(model, name)
            listed = _with_files(field, value if isinstance(value, list) else [value], place)
            values[name] = tuple(listed) if field.many else listed[0]
    try:
        return Stated(
            request=request.model_validate(values),
            naming=Naming(name=model.name, note=model.note),
        )
    except ValidationError as error:
        raise _refusal(error, request, fields) from None


def _saved_values(
    fields: Mapping[str, RequestField], stated: Mapping[str, RequestField], model: Naming
) -> dict[str, object]:
    """Returns the outputs of a job with its own ``save``, by the names that it expects."""
    return {
        name: Path(field.entry.saved_as)
        for name, field in fields.items()
        if isinstance(field.entry, Output)
        and field.entry.saved_as
        and (name not in stated or getattr(model, name))
    }


def _kept_values(request: type[Request], model: Naming, places: Places) -> dict[str, object]:
    """Returns the output fields of a job whose result is saved, each with its path.

    Raises:
        ConfigurationError: An invalid name, or two results of one name.
    """
    values: dict[str, object] = {}
    written: list[str] = []
    for field in fields_of(request):
        if isinstance(field.entry, Output):
            stated = getattr(model, field.name)
            listed = stated if isinstance(stated, list) else [stated] if stated else []
            usual = result_name(request, field)
            names = [
                usual if each is True else require_result_name(each, request, field)
                for each in listed
            ]
            written += names
            paths = tuple(places.result_file(name) for name in names)
            if field.many or paths:
                values[field.name] = paths if field.many else paths[0]
        elif is_result_folder(field) and field.default is not None:
            values[field.name] = places.result_file(Path(field.default).name)
    twice = sorted({name for name in written if written.count(name) > 1})
    if twice:
        raise ConfigurationError(f"two results of the name {twice[0]!r}.", hint="another name.")
    return values


def _input_values(field: RequestField, model: Naming, places: Places) -> dict[str, object]:
    """The files that a field reads; nothing where none is stated."""
    stated = getattr(model, field.name)
    listed = stated if isinstance(stated, list) else [] if stated is None else [stated]
    if not listed:
        return {}
    found = places.input_files(field, [file_item(each) for each in listed])
    return {field.name: found if field.many else found[0]}


def _with_files(field: RequestField, values: list[object], places: Places) -> list[object]:
    """The values of a field, the paths of files in place of what was sent along."""
    sent = [each for each in values if isinstance(each, FileItem) and each.file]
    paths = dict(zip(map(id, sent), places.input_files(field, sent), strict=True))
    return [paths.get(id(each), each) for each in values]


def is_list(field: RequestField) -> bool:
    """Returns whether a parameter is a list of values: also the files of a folder are."""
    folder = isinstance(field.entry, InputFile) and field.entry.folder
    return field.many_in_jobs or folder


def _is_listed(field: RequestField) -> bool:
    return isinstance(field.entry, Item) and (field.entry.listed or field.entry.single)


def _only(field: RequestField, values: list[object]) -> object:
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
    """Returns the first fault; for a missing item it names the expected noun."""
    for fault in error.errors(include_url=False):
        name = str(fault["loc"][0]) if fault["loc"] else ""
        if name in NAMED:
            return ConfigurationError(f"parameter {name!r} is {fault['input']!r}, expected text.")
        entry = fields[name].entry if name in fields else None
        if isinstance(entry, InputFile) and fault["type"] == "missing":
            return ConfigurationError(
                f"the parameter {name!r} is missing: a file.", hint=entry.help
            )
        if entry is not None and not isinstance(entry, Item) and fault["type"] == "missing":
            return ConfigurationError(f"the parameter {name!r} is missing.", hint=entry.help)
        if isinstance(entry, Item):
            if fault["type"] == "missing":
                return ConfigurationError(
                    f"the parameter {name!r} is missing: a {entry.noun}.",
                    hint="robotrue workspace list shows all items.",
                )
            many = fields[name].many_in_jobs
            expected = f"one {entry.noun} or more" if many else f"the id of a {entry.noun}"
            return ConfigurationError(
                f"parameter {name!r} is {fault['input']!r}, expected {expected}."
            )
    return refusal(error, request, in_job)


def parameter_schemas() -> dict[str, object]:
    """Returns the JSON schema of the parameters of each kind of job."""
    kinds = job_operations().items()
    return {kind: parameters_model(each).model_json_schema() for kind, each in kinds}
