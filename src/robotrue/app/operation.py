"""An operation: its request, its work, its result."""

from __future__ import annotations

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Operation(Generic[Q, R]):
    """One operation of the product.

    Attributes:
        request: Type of the request.
        help: One line; empty where the first line of its file is used.
        run: Runs it; the same on files and in a workspace.
        save: Writes its result into a workspace, with the transaction that ends the job, and
            returns the job's result; None: the result is saved as a document with the files it
            wrote, by :mod:`robotrue.app.job_runner`.
        has_document: Whether the command has ``--json``: a run without a result has none.
        is_service: Whether a run continues until it is stopped; no job does.
    """

    request: type[Q]
    run: Callable[[Q, Context], R]
    help: str = ""
    save: Callable[[Q, R, Transaction, WorkspaceContext], Mapping[str, object]] | None = None
    has_document: bool = True
    is_service: bool = False


AnyOperation: TypeAlias = Operation[Any, Any]
