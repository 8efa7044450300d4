"""The shell that runs an operation, as far as it does more than listen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from robotrue.app.presentation import LiveView


class Shell:
    """A shell nobody sits at: it shows no service while it runs, and answers no question."""

    def live(self) -> AbstractContextManager[Callable[[LiveView], None]]:
        """Yields what shows a service while it runs; each view replaces the one before."""
        return _drop_views()

    def confirm(self, question: str, word: str) -> bool | None:
        """Returns whether the answer to a question is a word; None: nobody can be asked."""
        return None


@contextmanager
def _drop_views() -> Iterator[Callable[[LiveView], None]]:
    yield lambda view: None
