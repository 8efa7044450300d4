"""The token of sensing services goes to those the operator named, and to nobody else."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path

import pytest
from websockets.asyncio.server import Request, Response, ServerConnection, serve
from websockets.datastructures import Headers

from robotrue.errors import ConfigurationError
from robotrue.store.workspace import Workspace
from robotrue.web.live_relay import Relays
from robotrue.web.live_sources import add_source
from robotrue.web.serve_settings import ServeSettings

TOKEN = "a token of a service, long enough"  # noqa: S105


def sent(folder: Path, *, trusted: bool, elsewhere: bool = False) -> list[tuple[str, str]]:
    """Who was told what ``Authorization``: the service, or another it sends its viewers to."""
    told: list[tuple[str, str]] = []
    asked = asyncio.Event()

    def look(name: str, go: str = "") -> object:
        def process(here: ServerConnection, request: Request) -> Response:
            told.append((name, request.headers.get("Authorization", "")))
            asked.set()
            if go:
                return Response(302, "Found", Headers({"Location": go}))
            return here.respond(403, "")

        return process

    async def run() -> None:
        async with contextlib.AsyncExitStack() as stack:
            other = await stack.enter_async_context(
                serve(lambda _: asyncio.sleep(0), "127.0.0.1", 0, process_request=look("other"))
            )
            there = f"http://127.0.0.1:{other.sockets[0].getsockname()[1]}/frames"
            service = await stack.enter_async_context(
                serve(
                    lambda _: asyncio.sleep(0), "127.0.0.1", 0,
                    process_request=look("service", there if elsewhere else ""),
                )
            )  # fmt: skip
            address = f"ws://127.0.0.1:{service.sockets[0].getsockname()[1]}"
            workspace = stack.enter_context(Workspace.create(folder))
            add_source(workspace, address, "")
            settings = ServeSettings(workspace=folder, sense=(address,) if trusted else ())
            watching = asyncio.create_task(Relays(workspace, settings.sense).watch())
            for _ in range(
                2 if elsewhere else 1
            ):  # the second try is after what followed the first
                await asyncio.wait_for(asked.wait(), 20.0)
                asked.clear()
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)

    asyncio.run(run())
    return told


def test_only_a_service_named_at_the_start_is_sent_the_token(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOTRUE_WS_TOKEN", TOKEN)
    assert set(sent(tmp_path / "a", trusted=True)) == {("service", f"Bearer {TOKEN}")}
    assert set(sent(tmp_path / "b", trusted=False)) == {("service", "")}


def test_a_service_that_sends_elsewhere_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOTRUE_WS_TOKEN", TOKEN)
    assert {who for who, _ in sent(tmp_path / "a", trusted=True, elsewhere=True)} == {"service"}


def test_an_operator_s_address_is_checked_at_the_start(tmp_path: Path) -> None:
    settings = ServeSettings(workspace=tmp_path, sense=(" ws://cell3 ", "ws://10.0.0.7:9"))
    assert settings.sense == ("ws://cell3:8765", "ws://10.0.0.7:9")
    with pytest.raises(ConfigurationError, match="no address of robotrue sense"):
        ServeSettings(workspace=tmp_path, sense=("http://cell3",))
