"""Jobs on the workers of a Dask scheduler. Needs the extra ``dask``.

The workers need this robotrue and must see the workspace's folder and database. If one dies, the
scheduler gives its job to another; nothing of the first attempt stands.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, Final

from robotrue.errors import ConfigurationError, MissingExtraError
from robotrue.store.job_engine import Run
from robotrue.store.jobs_claim import Claim
from robotrue.store.jobs_work import attempt
from robotrue.store.workspace import Workspace

ANSWER: Final = 10
"""s within which the scheduler must answer."""


class Dask:
    """The workers of a scheduler."""

    def __init__(self, address: str) -> None:
        try:
            client: Any = import_module("distributed").Client
        except ImportError as cause:
            raise MissingExtraError(
                "a Dask scheduler was named, and the package distributed is not installed.",
                hint="pip install 'robotrue[dask]'.",
            ) from cause
        try:
            self._client = client(address, timeout=ANSWER, set_as_default=False)
        except (OSError, ValueError) as cause:
            raise ConfigurationError(
                f"no Dask scheduler answers at {address!r} ({cause}).",
                hint="the address `dask scheduler` prints, such as tcp://10.0.0.5:8786.",
            ) from cause

    def begin(self, workspace: Workspace, target: str, claim: Claim) -> Run:
        """Returns an attempt that was handed to the scheduler."""
        future = self._client.submit(
            _attempt, str(workspace.folder), workspace.url, target, claim, pure=False
        )
        return Future(future)

    def __enter__(self) -> Dask:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()


class Future:
    """An attempt on one of the workers."""

    def __init__(self, future: Any) -> None:
        self._future = future

    def ended(self) -> str | None:
        """Returns None while it goes on, "" when it ended by itself, else what it died of."""
        match self._future.status:
            case "pending":
                return None
            case "finished":
                return ""
            case "error":
                cause = self._future.exception()
                return f"Dask lost it ({type(cause).__name__})"
            case word:
                return f"Dask says it is {word}"

    def kill(self) -> None:
        """Takes it back; what a worker has begun already writes nothing any more."""
        self._future.cancel(force=True)


def _attempt(folder: str, url: str | None, target: str, claim: Claim) -> None:
    attempt(Path(folder), url, target, claim)
