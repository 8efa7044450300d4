"""Calls of operations: the request of the command line, filled in from Python values.

A default is stated in the request alone. A Python object, array or table becomes a file in the
request, which the context resolves to the object.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import Parameter, Signature, signature
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import ValidationError

from robotrue.app.files_context import check_outputs
from robotrue.app.registry import operation_of
from robotrue.app.reporting import Message
from robotrue.app.request import CLI, InputFile, Item, Output, Request, RequestField, fields_of
from robotrue.app.request_errors import refusal
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.library.objects_context import ObjectsContext

if TYPE_CHECKING:
    from robotrue.app.operation import AnyOperation

F = TypeVar("F", bound=Callable[..., object])
R = TypeVar("R")


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedCall(Generic[R]):
    """An operation that ran.

    Attributes:
        request: Its request.
        result: Its result.
        messages: What it reported.
    """

    request: Request
    result: R
    messages: tuple[Message, ...]


@contextmanager
def open_context() -> Iterator[ObjectsContext]:
    """Yields a context whose files are gone afterwards; no error names their folder."""
    with TemporaryDirectory(prefix="robotrue-") as folder:
        try:
            yield ObjectsContext(Path(folder))
        except RobotrueError as error:
            if error.source is not None and error.source.startswith(folder):
                error.rename_source(Path(error.source).name)
            raise


def call_operation(
    context: ObjectsContext, name: str, result: type[R], fields: Mapping[str, object]
) -> FinishedCall[R]:
    """Returns an operation that ran with these fields; None leaves a field to its default.

    Args:
        context: Resolves files to objects; a context serves one call or several.
        name: Of the operation.
        result: Type of its result.
        fields: By the name in the request.

    Raises:
        ConfigurationError: No such option, a value that is not allowed, another type of result.
        RobotrueError: What the operation raises.
    """
    operation = operation_of(name)
    request = make_request(operation, name, fields)
    check_outputs(request)
    found = operation.run(request, context)
    if not isinstance(found, result):
        raise ConfigurationError(f"{name} returned {type(found).__name__}; use rt.run({name!r}).")
    return FinishedCall(request=request, result=found, messages=context.messages)


def command_fields(name: str) -> tuple[RequestField, ...]:
    """Returns the fields that an operation has on the command line."""
    kind: type[Request] = operation_of(name).request
    return tuple(field for field in fields_of(kind) if field.is_in(CLI))


def make_request(operation: AnyOperation, name: str, fields: Mapping[str, object]) -> Request:
    """Returns the request with paths as paths and single values of lists as lists.

    Raises:
        ConfigurationError: No such option, or a value that is not allowed.
    """
    kind: type[Request] = operation.request
    offered = {field.name: field for field in command_fields(name)}
    for stated in fields:
        if stated not in offered:
            near = difflib.get_close_matches(stated, offered, n=1)
            raise ConfigurationError(
                f"{name} has no option {stated!r}; it has {', '.join(offered)}.",
                hint=f"{near[0]}=..." if near else None,
            )
    missing = [n for n, f in offered.items() if f.is_required(CLI) and fields.get(n) in (None, [])]
    if missing:
        raise ConfigurationError(f"{name} needs {' and '.join(missing)}.", hint=f"{missing[0]}=...")
    values = {
        stated: _field_value(offered[stated], value)
        for stated, value in fields.items()
        if value is not None
    }
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise refusal(error, kind, lambda field: field.name) from None


def _field_value(field: RequestField, value: object) -> object:
    """A value as the request wants it."""
    is_path = isinstance(field.entry, Item | InputFile | Output) or field.kind is Path
    if not field.many:
        return Path(value) if is_path and isinstance(value, str | os.PathLike) else value
    values = value if isinstance(value, tuple | list) else (value,)
    return tuple(
        Path(each) if is_path and isinstance(each, str | os.PathLike) else each for each in values
    )


def with_options_of(name: str, *handled: str) -> Callable[[F], F]:
    """Returns a decorator that shows the options of an operation in signature and docstring.

    Args:
        name: Of the operation.
        handled: Fields that the function states itself, or fills in.
    """

    def show(function: F) -> F:
        shown = signature(function)
        own = [p for p in shown.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        named = {*handled, *(p.name for p in own)}
        fields = [field for field in command_fields(name) if field.name not in named]
        options = [_parameter(field) for field in fields]
        changed: Any = function
        changed.__signature__ = Signature(
            [*own, *options], return_annotation=shown.return_annotation
        )
        lines = [f"    - ``{field.name}``: {field.entry.help}" for field in fields]
        heading = f"    The options of ``robotrue {name.replace('_', ' ')}``, as keywords:"
        changed.__doc__ = "\n".join([f"{function.__doc__}".rstrip(), "", heading, "", *lines, ""])
        return function

    return show


def _parameter(field: RequestField) -> Parameter:
    default = Parameter.empty if field.required else field.default
    return Parameter(field.name, Parameter.KEYWORD_ONLY, default=default)
