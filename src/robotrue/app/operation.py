"""An operation: its request, its work, its result."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from robotrue.app.context import Context
from robotrue.app.presentation import Block
from robotrue.app.request import Request
from robotrue.core.provenance import Provenance

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.store.workspace import Transaction


class Result(Protocol):
    """Contract of every result; the shell that shows it adds the mark of simulated data."""

    @property
    def provenance(self) -> Provenance | None:
        """Provenance of the data of the result; None without data."""
        ...

    def document(self) -> Mapping[str, object] | None:
        """Returns JSON values, units in the names; without ``simulated`` they are marked.

        None for a service, which has reported everything.
        """
        ...

    def blocks(self) -> Iterable[Block]:
        """Returns what is shown instead of the document."""
        ...


Q = TypeVar("Q", bound=Request)
R = TypeVar("R", bound=Result)
Run: TypeAlias = Callable[[Q, Context], R]
Save: TypeAlias = "Callable[[Q, R, Transaction, WorkspaceContext], Mapping[str, object]]"


@dataclass(slots=True, kw_only=True, eq=False)
class Operation(Generic[Q, R]):
    """One operation of the product; it is called as the function that it was made from.

    Attributes:
        request: Type of the request.
        run: Runs it; the same on files and in a workspace.
        save: Writes its result into a workspace, with the transaction that ends the job, and
            returns the job's result; None: the result is saved as a document with the files it
            wrote, by :mod:`robotrue.app.job_runner`.
        has_document: Whether the command has ``--json``: a run without a result has none.
        is_service: Whether a run continues until it is stopped; no job does.
    """

    request: type[Q]
    run: Run[Q, R]
    has_document: bool
    is_service: bool
    save: Save[Q, R] | None = None

    def __call__(self, request: Q, context: Context) -> R:
        """Returns the result of a request."""
        return self.run(request, context)

    def saves(self, save: Save[Q, R]) -> Save[Q, R]:
        """Decorates the function that writes the result into a workspace."""
        self.save = save
        return save


def operation(
    name: str = "", *, has_document: bool = True, is_service: bool = False
) -> Callable[[Run[Q, R]], Operation[Q, R]]:
    """Decorates the function that runs an operation; its annotation states the request.

    Args:
        name: Of the operation, whose help is the first line of the docstring. Without one it has
            the name of its file and the first line of that file. The registry reads both.
        has_document: Whether the command has ``--json``.
        is_service: Whether a run continues until it is stopped.
    """

    def declare(run: Run[Q, R]) -> Operation[Q, R]:
        # Results may be of types that are not imported at run time: no get_type_hints.
        request: type[Q] = getattr(sys.modules[run.__module__], run.__annotations__["request"])
        return Operation(request=request, run=run, has_document=has_document, is_service=is_service)

    return declare


AnyOperation: TypeAlias = Operation[Any, Any]
