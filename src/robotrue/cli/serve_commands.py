"""``robotrue serve``: the workbench in a browser."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from types import ModuleType
from typing import Annotated, TypeAlias

import typer

from robotrue.app.serve_defaults import HOST, PORT
from robotrue.cli.app import app
from robotrue.errors import ConfigurationError, MissingExtraError

HostNames: TypeAlias = Annotated[
    list[str] | None, typer.Option("--name", help="Host name of the server; may be repeated.")
]


@app.command()
def serve(
    workspace: Annotated[
        Path,
        typer.Argument(
            metavar="[WORKSPACE]", help="Workspace; a new or empty folder is initialized."
        ),
    ] = Path("workspace"),
    host: Annotated[
        str, typer.Option(help="Address to listen on; all but loopback need a secret.")
    ] = HOST,
    port: Annotated[int, typer.Option(help="Port; 0 picks a free one.")] = PORT,
    password_env: Annotated[
        str | None, typer.Option(help="Environment variable with the password of users.")
    ] = None,
    token_env: Annotated[
        str | None, typer.Option(help="Environment variable with the token of programs.")
    ] = None,
    name: HostNames = None,
    tls_cert: Annotated[Path | None, typer.Option(help="Certificate (PEM), for https.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its private key.")] = None,
    sense: Annotated[
        list[str] | None,
        typer.Option(
            "--sense",
            metavar="ws://HOST:PORT",
            help="Sensing service on another computer; gets ROBOTRUE_WS_TOKEN. May be repeated.",
        ),
    ] = None,
    upload_mb: Annotated[int, typer.Option(help="Largest file accepted, MB.")] = 1024,
    upload_total_mb: Annotated[
        int | None,
        typer.Option(help="All unused files together, MB; default: four times --upload-mb."),
    ] = None,
    open_browser: Annotated[bool, typer.Option("--open", help="Open a browser.")] = False,
) -> None:
    """Open the workbench: cell, measurements, calibration and programs in a browser."""
    from robotrue.app.job_kinds import LazyJobKinds
    from robotrue.cli.console import say

    server, made = _server()
    settings = made.ServeSettings(
        workspace=workspace,
        host=host,
        port=port,
        password=_secret("--password-env", password_env),
        token=_secret("--token-env", token_env),
        names=tuple(name or ()),
        certificate=tls_cert,
        key=tls_key,
        sense=tuple(sense or ()),
        upload_limit=upload_mb * made.MB,
        upload_total=(upload_total_mb or 0) * made.MB,
        kinds=LazyJobKinds(),
    )

    def ready(address: str) -> None:
        say(f"workbench of {workspace} at {address} (Ctrl-C ends it)")
        if open_browser:
            import webbrowser

            webbrowser.open(address)

    server.serve(settings, ready=ready)


def _server() -> tuple[ModuleType, ModuleType]:
    """The server and its settings."""
    gc.disable()  # nothing to collect among modules; the server enables it when it is up
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
    """Returns a secret from an environment variable; on the command line ``ps`` would show it."""
    if variable is None:
        return ""
    held = os.environ.get(variable, "")
    if not held:
        raise ConfigurationError(
            f"{option} {variable}, but that variable is not set or empty.",
            hint=f"export {variable}=...",
        )
    return held
