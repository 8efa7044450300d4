"""``robotrue serve``: the workbench in a browser."""

from __future__ import annotations

import os
import webbrowser
from pathlib import Path
from types import ModuleType

from robotrue.app.job_kinds import LazyJobKinds
from robotrue.cli.console import say
from robotrue.errors import ConfigurationError, MissingExtraError


def run(
    workspace: Path,
    *,
    password_env: str | None,
    token_env: str | None,
    upload_mb: int,
    upload_total_mb: int | None,
    open_browser: bool,
    **settings: object,
) -> None:
    """Serves a workspace until Ctrl-C."""
    server, made = _server()
    wanted = made.ServeSettings(
        workspace=workspace,
        password=_secret("--password-env", password_env),
        token=_secret("--token-env", token_env),
        upload_limit=upload_mb * made.MB,
        upload_total=(upload_total_mb or 0) * made.MB,
        kinds=LazyJobKinds(),
        **settings,
    )

    def ready(address: str) -> None:
        say(f"workbench of {workspace} at {address} (Ctrl-C ends it)")
        if open_browser:
            webbrowser.open(address)

    server.serve(wanted, ready=ready)


def _server() -> tuple[ModuleType, ModuleType]:
    """The server and its settings."""
    try:
        from robotrue.web import serve_settings, server
    except ModuleNotFoundError as cause:
        if (cause.name or "").startswith("robotrue"):
            raise
        raise MissingExtraError(
            f"the workbench needs {cause.name}, which is not installed.",
            hint='pip install "robotrue[web]"',
        ) from cause
    return server, serve_settings


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
