"""Commands made from requests: their arguments, options, defaults and help."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cached_property
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer.models import CommandInfo, TyperInfo

from robotrue.app.registry import GROUPS, Listing, listings
from robotrue.cli.app import Json

if TYPE_CHECKING:
    from robotrue.app.request import Request, RequestField

AS_JSON: Final = "json"


class GeneratedCommand:
    """A command of an operation, which is imported when somebody asks for its options."""

    def __init__(self, listing: Listing) -> None:
        self.__name__ = listing.name
        self.__doc__ = listing.help
        self.__annotations__: dict[str, Any] = {}
        self._listing = listing

    @cached_property
    def __signature__(self) -> Signature:
        """Arguments and options, as typer reads them."""
        from robotrue.app.registry import operation_of
        from robotrue.app.request import CLI, fields_of

        operation = operation_of(self._listing.name)
        request: type[Request] = operation.request
        parameters = [_parameter(each) for each in fields_of(request) if each.is_in(CLI)]
        switch = Parameter(AS_JSON, Parameter.KEYWORD_ONLY, default=False, annotation=Json)
        return Signature([*parameters, *([switch] if operation.has_document else [])])

    def __call__(self, **values: Any) -> None:
        """Runs the operation with what was typed."""
        from pydantic import ValidationError

        from robotrue.app.registry import operation_of
        from robotrue.app.request_errors import refusal
        from robotrue.cli.terminal import run_operation

        operation = operation_of(self._listing.name)
        as_json = values.pop(AS_JSON, False)
        try:
            request = operation.request.model_validate(_stated(operation.request, values))
        except ValidationError as error:
            raise refusal(error, operation.request) from None
        run_operation(operation, request, as_json=as_json)


def _stated(request: type[Request], values: Mapping[str, Any]) -> dict[str, Any]:
    """The values as the request wants them: lists as tuples, what was left out left out."""
    from robotrue.app.request import fields_of

    many = {field.name for field in fields_of(request) if field.many}
    return {
        name: tuple(value or ()) if name in many else value
        for name, value in values.items()
        if value is not None
    }


def _parameter(field: RequestField) -> Parameter:
    from robotrue.app.outputs import writes
    from robotrue.app.request import Item, Output

    entry = field.entry
    is_path = isinstance(entry, Item | Output) or field.kind is Path
    kind: Any = Path if is_path else str if field.choices else field.kind
    if field.many:
        kind = list[kind]
    if field.optional or (field.many and not field.required):
        kind = kind | None
    callback = None
    if isinstance(entry, Output) and entry.suffixes:
        callback = writes(entry.what, *entry.suffixes, only=entry.only)
    if entry.argument:
        presented: Any = typer.Argument(metavar=entry.argument, help=entry.help, callback=callback)
    else:
        names = entry.names
        if field.kind is bool and not names and not entry.paired:
            names = (field.option,)
        presented = typer.Option(
            *names,
            metavar=entry.metavar,
            help=entry.help,
            callback=callback,
            envvar=entry.variable or None,
            min=entry.least,
        )
    default = Parameter.empty if field.required else field.default or _blank(field)
    return Parameter(
        field.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, presented]
    )


def _blank(field: RequestField) -> Any:
    """A default that counts as false: typer writes 0 beside an option, and nothing for no list."""
    return None if field.many else field.default


def register_operations(app: typer.Typer, order: Sequence[str]) -> None:
    """Adds the commands of all operations to the application and its groups.

    Args:
        app: The application, with its groups and with the commands that are not made here.
        order: Names of commands in the order of the help, with their group; others follow.
    """
    groups = {
        _group_name(each): each.typer_instance
        for each in app.registered_groups
        if each.typer_instance is not None
    }
    for listing in listings():
        target = groups[listing.group] if listing.group else app
        target.registered_commands.append(
            CommandInfo(name=listing.command, callback=GeneratedCommand(listing), help=listing.help)
        )
    _sort(app, "", order)
    for name, group in groups.items():
        _sort(group, f"{name} ", order)
    app.registered_groups.sort(key=lambda each: GROUPS.index(_group_name(each)))


def _sort(app: typer.Typer, group: str, order: Sequence[str]) -> None:
    def place(command: CommandInfo) -> int:
        words = f"{group}{name_of(command)}"
        return order.index(words) if words in order else len(order)

    app.registered_commands.sort(key=place)


def _group_name(group: TyperInfo) -> str:
    return "" if group.typer_instance is None else str(group.typer_instance.info.name)


def name_of(command: CommandInfo) -> str:
    """Returns the name of a command that is registered."""
    return command.name or getattr(command.callback, "__name__", "").replace("_", "-")


def without_options(command: CommandInfo) -> CommandInfo:
    """Returns a command for a list of commands: its operation is not imported."""
    if not isinstance(command.callback, GeneratedCommand):
        return command

    def listed() -> None:
        """Is never called: the list shows the name and the help."""

    return CommandInfo(name=command.name, callback=listed, help=command.help)


def without_operations(group: TyperInfo) -> TyperInfo:
    """Returns a group for a list of commands: none of its operations is imported."""
    listed = copy(group)
    if group.typer_instance is not None:
        listed.typer_instance = copy(group.typer_instance)
        commands = group.typer_instance.registered_commands
        listed.typer_instance.registered_commands = [without_options(each) for each in commands]
    return listed
