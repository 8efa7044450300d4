"""Live data past the workbench: alarms, limits, and who may look."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocketDisconnect
from web_shop import Client

from robotrue.store.workspace import Workspace
from robotrue.web.alarms import AlarmWatch
from robotrue.web.live_relay import Relays
from robotrue.web.live_sources import add_source

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
PASSWORD = "a long sentence"  # noqa: S105


def bins(*errors: float | None, start: float = 0.0, step: float = 0.1) -> list[dict[str, Any]]:
    """Bins of an error along x alone."""
    return [
        {
            "t_s": start + k * step,
            "low": [None if e is None else min(e, 0.0), -1.0, 0.0],
            "high": [None if e is None else max(e, 0.0), 1.0, 0.0],
            "sd_um": [2.0, 2.0, 2.0],
        }
        for k, e in enumerate(errors)
    ]


def test_an_alarm_is_one_until_two_quiet_seconds() -> None:
    watch = AlarmWatch((20.0, 0.0, 0.0))
    (begun,) = watch.take(bins(5.0, 21.0, -33.0, None, 10.0, 25.0), NOON)
    assert (begun.axis, begun.value_um, begun.over) == ("x", 21.0, False)
    assert begun.begun == NOON - timedelta(seconds=0.4)
    assert watch.take(bins(*[3.0] * 19, start=0.6), NOON) == []
    (ended,) = watch.take(bins(3.0, start=2.5), NOON)
    assert ended.key == begun.key
    assert (ended.value_um, ended.band_um, ended.limit_um, ended.over) == (-33.0, 4.0, 20.0, True)
    assert ended.duration_s == pytest.approx(0.4)
    assert watch.open == ()


def test_what_is_not_known_raises_no_alarm_and_a_lost_stream_ends_one() -> None:
    watch = AlarmWatch((20.0, 0.5, 0.0))
    found = watch.take(bins(None, None), NOON)
    assert [each.axis for each in found] == ["y"]  # the limit along z is none
    assert [each.over for each in watch.end()] == [True]
    assert watch.take(bins(), NOON) == []


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("http://127.0.0.1:80", "no address of robotrue sense"),
        ("ws://user:secret@10.0.0.1", "no address of robotrue sense"),
        ("ws://10.0.0.1/other", "no address of robotrue sense"),
        ("ws://", "without a host"),
        ("ws://10.0.0.1?token=abc", "option token"),
    ],
)
def test_addresses_that_are_none(client: Client, address: str, said: str) -> None:
    answer = client().post("/api/live/sources", json={"address": address})
    assert answer.status_code == 400
    assert said in answer.json()["detail"]
    assert "secret" not in answer.text


def test_other_computers_are_connected_to_only_where_the_operator_names_them(
    client: Client,
) -> None:
    named = client(sense=("ws://0.0.0.0",))
    assert named.post("/api/live/sources", json={"address": "ws://0.0.0.0"}).status_code == 201
    answer = named.post("/api/live/sources", json={"address": "ws://0.0.0.0:22"})
    assert answer.status_code == 400
    assert answer.json()["detail"].startswith("ws://0.0.0.0:22 is not on this computer")
    assert answer.json()["hint"] == "robotrue serve --sense ws://0.0.0.0:22"
    for local in ("ws://127.0.0.1:9", "ws://localhost:9", "ws://[::1]:9"):
        assert named.post("/api/live/sources", json={"address": local}).status_code == 201


def test_a_source_that_is_not_named_is_not_connected_to(tmp_path: Path) -> None:
    async def connected_to(named: tuple[str, ...]) -> bool:
        relays = Relays(workspace, named)
        watching = asyncio.create_task(relays.watch())
        relays.wake()  # so that it may be awake when it is cancelled
        until = asyncio.get_running_loop().time() + 20.0
        while relays.of(local.id) is None:
            assert asyncio.get_running_loop().time() < until
            await asyncio.sleep(0.01)
        found = relays.of(far.id) is not None
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
        return found

    with Workspace.create(tmp_path / "shop") as workspace:
        elsewhere = "ws://0.0.0.0:9"  # not an address of loopback, and goes nowhere else
        far = add_source(workspace, elsewhere, "", named=(elsewhere,))
        local = add_source(workspace, "ws://127.0.0.1:9", "")
        assert asyncio.run(connected_to((elsewhere,)))
        assert not asyncio.run(connected_to(()))


def test_limits_are_kept_and_history_is_not_overwritten(client: Client) -> None:
    here = client()
    made = here.post("/api/live/sources", json={"address": "ws://127.0.0.1:9"}).json()
    where = f"/api/live/sources/{made['id']}"
    limits = {"x_um": 40.0, "y_um": 0.0, "z_um": 12.5}
    changed = here.put(f"{where}/limits", json=limits).json()
    assert (changed["version"], changed["detail"]["limits_um"]) == (2, [40.0, 0.0, 12.5])
    assert here.put(f"{where}/limits", json={**limits, "x_um": -1.0}).status_code == 422
    assert here.get(f"{where}/alarms").json() == {"items": []}
    assert here.get(f"{where}/alarms.csv").text.startswith("begun,axis,value_um")
    assert here.get("/api/live/sources/nothing/alarms").status_code == 404
    here.delete(f"/api/items/document/{made['id']}")
    assert here.get(f"{where}/alarms").status_code == 404


def test_frames_are_for_those_who_may_look(client: Client) -> None:
    def refused(here: Any, **headers: str) -> int:
        with (
            pytest.raises(WebSocketDisconnect) as found,
            here.websocket_connect(
                "/api/live/sources/any/frames", headers={"host": "127.0.0.1", **headers}
            ),
        ):
            pass
        return int(found.value.code)

    here = client()
    assert refused(here, origin="http://evil.example") == 1008
    assert refused(here) == 1013  # let in, and there is no such source
    assert refused(client(password=PASSWORD)) == 1008
