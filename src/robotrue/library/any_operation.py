"""Any operation of the command line by its name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, cast

from robotrue.app.operation import Result
from robotrue.app.presentation import Block, Facts, Table
from robotrue.app.registry import listings, operation_of
from robotrue.app.reporting import Message
from robotrue.core.provenance import Provenance, marked_document
from robotrue.errors import ConfigurationError
from robotrue.library.cell_object import RobotCell
from robotrue.library.measurement_object import Measurements, place_cell, place_measured
from robotrue.library.model_object import Model
from robotrue.library.objects_context import ObjectsContext
from robotrue.library.operation_call import call_operation, command_fields, open_context
from robotrue.library.presented import Presented
from robotrue.library.program_object import RobotProgram

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture

NAME_THEIR_MODEL: Final = ("register", "register_rounds")
"""Operations whose registered cell names the file of the model."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class OperationResult(Presented):
    """Result of an operation and its messages.

    Attributes:
        operation: Its name.
        result: Its result.
        messages: Messages of the operation.
    """

    operation: str
    result: Result
    messages: tuple[Message, ...]

    @property
    def provenance(self) -> Provenance | None:
        """Provenance of the data behind the result; None without data."""
        return self.result.provenance

    def document(self) -> dict[str, object]:
        """Returns the JSON values of ``--json``, units in the names."""
        document = dict(self.result.document() or {})
        return document if "simulated" in document else marked_document(document, self.provenance)

    def blocks(self) -> Iterable[Block]:
        """Returns the output of the command."""
        return self.result.blocks()

    def to_dataframe(self) -> pd.DataFrame:
        """Returns the largest table that the command prints; numbers as numbers.

        Raises:
            ConfigurationError: It prints none; ``document()`` has the values.
        """
        import pandas as pd

        shown = [block for block in self.blocks() if isinstance(block, Facts | Table)]
        if not shown:
            raise ConfigurationError(f"{self.operation} prints no table.", hint=".document()")
        block = max(shown, key=lambda each: len(each.rows))
        names = name_columns(block.columns) if isinstance(block, Table) else ["name", "value"]
        frame = pd.DataFrame(block.rows, columns=names)
        for name in names:
            numbers = pd.to_numeric(frame[name], errors="coerce")
            if numbers.notna().all():
                frame[name] = numbers
        return frame

    def plot(self) -> Picture:
        """Returns a bar of each number in the table of :meth:`to_dataframe`.

        Raises:
            ConfigurationError: No column of it holds numbers.
        """
        from robotrue.library.pictures import draw_bars, make_picture

        table = self.to_dataframe()
        numbers = table.select_dtypes("number")
        if numbers.empty:
            raise ConfigurationError(f"{self.operation} has no numbers to draw.", hint=".summary()")
        labels = [str(each) for each in table.iloc[:, 0]]
        drawings = [draw_bars(labels, numbers[name].to_numpy(), str(name)) for name in numbers]
        return make_picture(drawings, title=f"{self._mark}{self.operation}")

    def _describe(self) -> str:
        return f"result of {self.operation}"


def name_columns(columns: Sequence[str]) -> list[str]:
    """Returns a different name for each column: one without a heading is a name or a remark."""
    names: list[str] = []
    for number, heading in enumerate(columns):
        name = heading or ("remark" if number else "name")
        names.append(name if name not in names else f"{name} {number + 1}")
    return names


def operations() -> dict[str, str]:
    """Returns the operations for ``run`` by name, with one line each."""
    return {each.name: each.help for each in listings() if each.command}


def run(operation: str, /, **options: object) -> OperationResult:
    """Returns the result of any operation of the command line.

    Args:
        operation: Its name, as :func:`operations` lists it: ``"register"``, ``"drift"``, ...
        options: Its options, by the names that the reference of the command has, ``_`` for ``-``;
            cells, models, measurements and programs as objects or as paths.

    Raises:
        ConfigurationError: No such operation or option, a service that runs until it is stopped,
            or a model without a file for a cell that names it.
        RobotrueError: Errors of the operation.
    """
    if operation_of(operation).is_service:
        raise ConfigurationError(
            f"{operation} runs until it is stopped.",
            hint=f"robotrue {operation.replace('_', ' ')} ... in a terminal.",
        )
    named = {field.name for field in command_fields(operation)}
    with open_context() as context:
        fields = {
            name: _place_object(context, operation, value) if name in named else value
            for name, value in options.items()
        }
        call = call_operation(context, operation, object, fields)
    return OperationResult(
        operation=operation, result=cast(Result, call.result), messages=call.messages
    )


def _place_object(context: ObjectsContext, operation: str, value: object) -> object:
    """A value with the objects of the library as files.

    Raises:
        ConfigurationError: A model that has no file; what the operation writes would name it.
    """
    if isinstance(value, tuple | list):
        return tuple(_place_object(context, operation, each) for each in value)
    if isinstance(value, RobotCell):
        return place_cell(context, value)
    if isinstance(value, Measurements):
        return place_measured(context, value)
    if isinstance(value, Model) and operation in NAME_THEIR_MODEL:
        return value.require_file(f"{operation} writes the name of the model's file into the cell")
    if isinstance(value, Model):
        return value.place(context)
    return value.path if isinstance(value, RobotProgram) else value
