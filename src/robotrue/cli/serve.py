"""``robotrue serve``: the workbench in a browser."""

from __future__ import annotations

import importlib
import os
import webbrowser
from pathlib import Path
from typing import Any, Final

from robotrue.cli.console import say
from robotrue.errors import ConfigurationError, MissingExtraError

KINDS: Final = "robotrue.cli.job_kinds:KINDS"
"""What the server's own worker can do; imported by that process, not by the server."""


def run(
    workspace: Path,
    *,
    password_env: str | None,
    token_env: str | None,
    upload_mb: int,
    upload_total_mb: int | None,
    open_browser: bool,
    **settings: Any,
) -> None:
    """Serves a workspace until Ctrl-C."""
    with _room("starting").lightly():
        server, made = _room("server"), _room("settings")
    wanted = made.ServeSettings(
        workspace=workspace,
        password=_secret("--password-env", password_env),
        token=_secret("--token-env", token_env),
        upload_limit=upload_mb * made.MB,
        upload_total=(upload_total_mb or 0) * made.MB,
        kinds=KINDS,
        **settings,
    )

    def ready(address: str) -> None:
        say(f"workbench of {workspace} at {address} (Ctrl-C ends it)")
        if open_browser:
            webbrowser.open(address)

    server.serve(wanted, ready=ready)


def _room(name: str) -> Any:
    """A module of the web room, by name: the command line and the web app stand side by side.

    Neither imports the other; this is the one place where a command starts what is not below it.
    """
    try:
        return importlib.import_module(f"robotrue.web.{name}")
    except ModuleNotFoundError as cause:
        if (cause.name or "").startswith("robotrue"):
            raise
        raise MissingExtraError(
            f"the workbench needs {cause.name}, which is not installed.",
            hint='pip install "robotrue[web]"',
        ) from cause


def _secret(option: str, variable: str | None) -> str:
    """What an environment variable holds: a secret on the command line stands in every ps."""
    if variable is None:
        return ""
    held = os.environ.get(variable, "")
    if not held:
        raise ConfigurationError(
            f"{option} {variable}, but that variable is not set or empty.",
            hint=f"export {variable}=...",
        )
    return held
