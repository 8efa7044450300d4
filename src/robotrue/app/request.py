'''Requests of operations; each field has a default, limits and one line of help, its docstring.

A field is a value, an input or an output, by its annotation::

    cell: Annotated[Reference, Item(noun="cell", argument="CELL")]
    """Cell to calibrate."""
    poses: Annotated[int, Option(names=("--poses", "-n"))] = 30
    """How many, at most."""
    output: Annotated[Path, Output(what="a CSV table", suffixes=(".csv",))]
    """CSV to write."""

Commands, jobs, HTTP bodies, forms and the reference are made from these fields.
'''

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Final, Literal, TypeAlias, Union, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.fields import FieldInfo

from robotrue.errors import ConfigurationError

CLI: Final = "cli"
JOB: Final = "job"
FORM: Final = "form"
ALL: Final = frozenset({CLI, JOB, FORM})
ON_COMMAND_LINE: Final = frozenset({CLI})
IN_JOBS: Final = frozenset({JOB, FORM})
NOT_IN_FORMS: Final = frozenset({CLI, JOB})
"""Of the command and the job, and so of the generated page; not of a form made by hand."""


class ItemVersion(BaseModel):
    """An item of a workspace.

    Attributes:
        id: Its id, the beginning of it, or its name.
        version: None is the latest when the operation begins.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    id: str
    version: int | None = None


def _item_of_text(value: object) -> object:
    return ItemVersion(id=value) if isinstance(value, str) else value


Reference: TypeAlias = Annotated[Path | ItemVersion, BeforeValidator(_item_of_text)]
"""An input: a path on the command line, an item in a workspace."""


class Request(BaseModel):
    """Request of one operation; the module's docstring describes its fields."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )


class Naming(BaseModel):
    """Name and note for the results of a job."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    name: Annotated[str | None, Field(description="Name of what the job leaves.")] = None
    note: Annotated[str, Field(description="Note on what the job leaves.")] = ""


NAMED: Final = tuple(Naming.model_fields)
"""Parameters of every job."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """A value, and how the shells present it.

    Attributes:
        help: One line, for a field without a docstring.
        argument: Placeholder of a positional argument of the command; empty for an option.
        names: Of the option, as ``("--poses", "-n")``; empty: made of the field's name.
        metavar: Placeholder of the option's value, where it is not the type.
        paired: A flag that has a ``--no-...`` next to it.
        advanced: Forms show it behind "more".
        offered: Least and largest number that forms offer; the limits of the type go further.
        example: Of a text, for forms.
        variable: Environment variable that states it where the command line does not.
        least: Smallest number of a command line; less is a wrong command line (exit 2).
        shells: Which of command line, jobs and forms have it.
        needed_in: Shells in which it has to be stated although it has a default.
    """

    help: str = ""
    argument: str = ""
    names: tuple[str, ...] = ()
    metavar: str | None = None
    paired: bool = False
    advanced: bool = False
    offered: tuple[float, float] | None = None
    example: str = ""
    variable: str = ""
    least: int | float | None = None
    shells: frozenset[str] = ALL
    needed_in: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Item(Option):
    """A reference to a cell, a model, measurements, a program, a registration or a document.

    Attributes:
        noun: Kind of item, as ``robotrue workspace list`` spells it.
        also: Other nouns that it may refer to in a job whose result is saved as a document.
        listed: Jobs may state it as a list of one.
        single: Jobs state one, or a list of one, where the command line takes several.
        sent: A job with its own ``save`` also takes a file in its place, as the command does.
    """

    noun: str
    also: tuple[str, ...] = ()
    listed: bool = False
    single: bool = False
    sent: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class InputFile(Option):
    """An input file that has no items in a workspace.

    A job gets it as a file of an item: an uploaded file is saved as a document. A job with its own
    ``save`` has it only where ``shells`` allows it.

    Attributes:
        folder: A folder of files is read.
    """

    folder: bool = False
    shells: frozenset[str] = ON_COMMAND_LINE


@dataclass(frozen=True, slots=True, kw_only=True)
class Output(Option):
    """A file to write.

    On the command line its value is the path. A job with its own ``save`` writes it under
    ``saved_as``: always, or, where the field is of the shell ``job``, if the parameter of that name
    is true. Any other job gets the file name.

    Attributes:
        what: Written content, with its article.
        suffixes: In lower case, the usual one first.
        only: No other suffix is allowed, unknown ones neither.
        folder: An existing folder is allowed, too.
        renews: Name of the input that it may be written over.
        saved_as: File name in a job; empty: not written there.
    """

    what: str = ""
    suffixes: tuple[str, ...] = ()
    only: bool = False
    folder: bool = False
    renews: str = ""
    saved_as: str = ""
    shells: frozenset[str] = ON_COMMAND_LINE


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestField:
    """One field of a request.

    Attributes:
        name: Of the field; also of the parameter of a job.
        kind: Type of one value, without ``None`` and ``tuple``.
        many: Whether it is a tuple of values.
        optional: Whether it may be None.
        required: Whether it has no default.
        default: Its default.
        entry: How it is presented.
        info: Its description in pydantic, limits included.
    """

    name: str
    kind: object
    many: bool
    optional: bool
    required: bool
    default: Any
    entry: Option
    info: FieldInfo

    @property
    def many_in_jobs(self) -> bool:
        """True if jobs state it as a list of values."""
        return self.many and not (isinstance(self.entry, Item) and self.entry.single)

    @property
    def choices(self) -> tuple[str, ...]:
        """Permitted values; empty if any value is permitted."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()

    @property
    def option(self) -> str:
        """Its name on the command line."""
        if self.entry.argument:
            return self.entry.argument
        return next(iter(self.entry.names), f"--{self.name.replace('_', '-')}")

    def is_in(self, shell: str) -> bool:
        """Returns whether a shell has it."""
        return shell in self.entry.shells

    def is_required(self, shell: str) -> bool:
        """Returns whether it has to be stated in a shell."""
        return self.required or shell in self.entry.needed_in


@cache
def fields_of(request: type[Request]) -> tuple[RequestField, ...]:
    """Returns the fields of a request in their order.

    Raises:
        ConfigurationError: A field without a line of help.
    """
    return tuple(_field(request, name, info) for name, info in request.model_fields.items())


def _field(request: type[Request], name: str, info: FieldInfo) -> RequestField:
    entry = next((each for each in info.metadata if isinstance(each, Option)), Option())
    entry = replace(entry, help=" ".join((info.description or entry.help).split()))
    if not entry.help:
        raise ConfigurationError(f"{request.__name__}.{name} has no docstring.")
    kind, optional, many = info.annotation, False, False
    if get_origin(kind) in (Union, UnionType) and type(None) in get_args(kind):
        (kind, *more) = [each for each in get_args(kind) if each is not type(None)]
        kind, optional = kind if not more else info.annotation, True
    if get_origin(kind) is tuple:
        kind, many = get_args(kind)[0], True
    required = info.is_required()
    return RequestField(
        name=name,
        kind=kind,
        many=many,
        optional=optional,
        required=required,
        default=None if required else info.get_default(),
        entry=entry,
        info=info,
    )


def input_paths(request: Request, besides: str = "") -> list[Path]:
    """Returns the files that a request reads, as they were stated, those of one field left out."""
    return [
        path
        for field in fields_of(type(request))
        if isinstance(field.entry, Item | InputFile) and field.name != besides
        for path in paths_in(getattr(request, field.name))
    ]


def paths_in(value: object) -> list[Path]:
    """Returns the files among the values of a field."""
    values = value if isinstance(value, tuple) else (value,)
    return [each for each in values if isinstance(each, Path)]
