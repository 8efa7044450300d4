"""Commands made from requests: their arguments, options, defaults and help."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from importlib.util import find_spec
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

import typer
from typer.core import TyperGroup
from typer.models import CommandInfo, TyperInfo

from robotrue.app.registry import GROUPS, Listing, listings, operation_of
from robotrue.cli.app import Json
from robotrue.errors import ConfigurationError, MissingExtraError

if TYPE_CHECKING:
    from robotrue.app.request import Output, Request, RequestField

AS_JSON: Final = "json"
Names: TypeAlias = Path | list[Path] | None


class GeneratedCommand:
    """A command of an operation, which is imported when its options are needed."""

    def __init__(self, listing: Listing) -> None:
        self.__name__ = listing.name
        self.__doc__ = listing.help
        self.__annotations__: dict[str, object] = {}
        self._listing = listing

    @cached_property
    def __signature__(self) -> Signature:
        """Arguments and options, as typer reads them."""
        from robotrue.app.request import CLI, fields_of

        operation = operation_of(self._listing.name)
        request: type[Request] = operation.request
        parameters = [_parameter(each) for each in fields_of(request) if each.is_in(CLI)]
        switch = Parameter(AS_JSON, Parameter.KEYWORD_ONLY, default=False, annotation=Json)
        return Signature([*parameters, *([switch] if operation.has_document else [])])

    def __call__(self, **values: object) -> None:
        """Runs the operation with what was typed."""
        from pydantic import ValidationError

        from robotrue.app.request_errors import refusal
        from robotrue.cli.terminal import run_operation

        operation = operation_of(self._listing.name)
        as_json = bool(values.pop(AS_JSON, False))
        try:
            request = operation.request.model_validate(_read_values(operation.request, values))
        except ValidationError as error:
            raise refusal(error, operation.request) from None
        run_operation(operation, request, as_json=as_json)


def _read_values(request: type[Request], values: Mapping[str, object]) -> dict[str, object]:
    """The values as the request wants them: lists as tuples, what was left out left out."""
    from robotrue.app.request import fields_of

    many = {field.name for field in fields_of(request) if field.many}
    return {
        name: tuple(value) if name in many and isinstance(value, list) else value
        for name, value in values.items()
        if value is not None
    }


def _parameter(field: RequestField) -> Parameter:
    from robotrue.app.request import CLI, Item, Output

    entry = field.entry
    is_path = isinstance(entry, Item | Output) or field.kind is Path
    kind: Any = Path if is_path else str if field.choices else field.kind
    if field.many:
        kind = list[kind]
    required = field.is_required(CLI)
    if not required and (field.optional or field.many):
        kind = kind | None
    callback = None
    if isinstance(entry, Output) and entry.suffixes:
        callback = _check_names(entry)
    if entry.argument:
        presented: object = typer.Argument(
            metavar=entry.argument, help=entry.help, callback=callback
        )
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
    default = Parameter.empty if required else field.default or _blank(field)
    return Parameter(
        field.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, presented]
    )


def _check_names(entry: Output) -> Callable[[Names], Names]:
    """Returns the callback that refuses output names with the suffix of another format."""
    from robotrue.app.outputs import require_suffix

    def check(given: Names) -> Names:
        for output in given if isinstance(given, list) else [] if given is None else [given]:
            require_suffix(output, entry.what, entry.suffixes, only=entry.only)
        return given

    return check


def _blank(field: RequestField) -> object:
    """A default that counts as false: typer writes 0 next to an option, and nothing for no list."""
    return None if field.many else field.default


def register_operations(app: typer.Typer, order: Sequence[str]) -> None:
    """Adds the commands of all operations to the application and its groups.

    Args:
        app: The application, with the groups and commands that are not made here.
        order: Names of commands that come first in the help, with their group before them.
    """
    for name, text in GROUPS.items():
        app.add_typer(_make_group(name, text))
    app.registered_groups.sort(key=lambda each: list(GROUPS).index(str(_group(each).info.name)))
    groups = {str(_group(each).info.name): _group(each) for each in app.registered_groups}
    for listing in listings():
        if not listing.command:
            continue
        target = groups[listing.group] if listing.group else app
        target.registered_commands.append(
            CommandInfo(name=listing.command, callback=GeneratedCommand(listing), help=listing.help)
        )
    for group, target in {"": app, **groups}.items():
        _sort_commands(target, group, order)


class RunFirst(TyperGroup):
    """A group in which ``sense CELL ...`` means ``sense run CELL ...``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Returns the remaining arguments, with the command's name inserted where missing."""
        if args and args[0] not in (*self.commands, "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


def require_store() -> None:
    """Passes if the packages of the store are installed.

    Raises:
        MissingExtraError: One is not.
    """
    for package in ("sqlalchemy", "alembic", "pyarrow"):
        if find_spec(package) is None:
            raise MissingExtraError(
                f"workspaces need the package {package}, which is not installed.",
                hint="pip install 'robotrue[store]'.",
            )


_NEEDS: Final[Mapping[str, Callable[[], None]]] = {
    "workspace": require_store,
    "jobs": require_store,
}
"""Checks before a command of a group."""


def _make_group(name: str, text: str) -> typer.Typer:
    """Returns a command of commands that has none yet."""
    return typer.Typer(
        name=name,
        cls=RunFirst if name == "sense" else TyperGroup,
        callback=_NEEDS.get(name),
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        help=text,
    )


def _group(info: TyperInfo) -> typer.Typer:
    """The commands of a group; all of ours have some."""
    if info.typer_instance is None:
        raise ConfigurationError(f"the group {info.name!r} of commands is empty.")
    return info.typer_instance


def _sort_commands(target: typer.Typer, group: str, order: Sequence[str]) -> None:
    def place(command: CommandInfo) -> int:
        name = f"{group} {name_of(command)}".strip()
        return order.index(name) if name in order else len(order)

    target.registered_commands.sort(key=place)


def name_of(command: CommandInfo) -> str:
    """Returns the name of a command that is registered."""
    return command.name or getattr(command.callback, "__name__", "").replace("_", "-")


def without_options(app: typer.Typer) -> typer.Typer:
    """Returns an application for a list of its commands: no operation is imported."""
    listed = copy(app)
    listed.registered_commands = [_without_options(each) for each in app.registered_commands]
    listed.registered_groups = [copy(each) for each in app.registered_groups]
    for each in listed.registered_groups:
        each.typer_instance = without_options(_group(each))
    return listed


def _without_options(command: CommandInfo) -> CommandInfo:
    if not isinstance(command.callback, GeneratedCommand):
        return command

    def do_nothing() -> None:
        """Is never called: the list shows the name and the help."""

    return CommandInfo(name=command.name, callback=do_nothing, help=command.help)
