"""Where attempts at jobs are made: what a worker asks of processes here or of a scheduler."""

from __future__ import annotations

from typing import Protocol

from robotrue.store.jobs_claim import Claim
from robotrue.store.workspace import Workspace


class Run(Protocol):
    """One attempt that is under way."""

    def ended(self) -> str | None:
        """Returns None while it goes on, "" when it ended by itself, else what it died of."""
        ...

    def kill(self) -> None:
        """Ends it."""
        ...


class Engine(Protocol):
    """Where attempts are made."""

    def begin(self, workspace: Workspace, target: str, claim: Claim) -> Run:
        """Returns an attempt that has begun."""
        ...
