"""Signature of ``robotrue serve``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from robotrue.app.serve_defaults import HOST, PORT
from robotrue.cli.app import app

HostNames: TypeAlias = Annotated[
    list[str] | None, typer.Option("--name", help="Host name it is reached by; may be repeated.")
]


@app.command()
def serve(
    workspace: Annotated[
        Path, typer.Argument(metavar="[WORKSPACE]", help="Folder; a new or empty one is set up.")
    ] = Path("workspace"),
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but this machine's needs a secret.")
    ] = HOST,
    port: Annotated[int, typer.Option(help="Port; 0 takes a free one.")] = PORT,
    password_env: Annotated[
        str | None, typer.Option(help="Environment variable that holds the password of people.")
    ] = None,
    token_env: Annotated[
        str | None, typer.Option(help="Environment variable that holds the token of programs.")
    ] = None,
    name: HostNames = None,
    tls_cert: Annotated[Path | None, typer.Option(help="Certificate (PEM), for https.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its private key.")] = None,
    sense: Annotated[
        list[str] | None,
        typer.Option(
            "--sense",
            metavar="ws://HOST:PORT",
            help="Sensing service on another computer; is sent ROBOTRUE_WS_TOKEN. May be repeated.",
        ),
    ] = None,
    upload_mb: Annotated[int, typer.Option(help="Largest file accepted, MB.")] = 1024,
    upload_total_mb: Annotated[
        int | None,
        typer.Option(help="All files not yet used, MB; four times --upload-mb if not given."),
    ] = None,
    open_browser: Annotated[bool, typer.Option("--open", help="Open a browser.")] = False,
) -> None:
    """Open the workbench: cell, measurements, calibration and programs in a browser."""
    from robotrue.cli.serve import run

    run(
        workspace,
        host=host,
        port=port,
        password_env=password_env,
        token_env=token_env,
        names=tuple(name or ()),
        certificate=tls_cert,
        key=tls_key,
        sense=tuple(sense or ()),
        upload_mb=upload_mb,
        upload_total_mb=upload_total_mb,
        open_browser=open_browser,
    )
