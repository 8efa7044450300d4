"""Who is let in: hosts, origins, secrets, sizes; and what leaves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocketDisconnect
from web_shop import Client, Shop

from robotrue.errors import ConfigurationError
from robotrue.store.workspace import Workspace
from robotrue.web.gate import COOKIE
from robotrue.web.pages import SCREENS
from robotrue.web.serve_settings import ServeSettings
from robotrue.web.sessions import LIFETIME, TRIES, WINDOW, Sessions, Tries
from robotrue.web.static_files import STATIC_ROOT

PASSWORD = "correct horse"  # noqa: S105
TOKEN = "0123456789abcdef0123"  # noqa: S105


def refused(client: Any, **headers: str) -> int:
    return client.get(
        "/api/items/cell", headers={k.replace("_", "-"): v for k, v in headers.items()}
    ).status_code


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "cell3.example", "::"])  # noqa: S104
def test_another_address_without_a_secret_is_refused(host: str) -> None:
    with pytest.raises(ConfigurationError, match="neither a password nor a token"):
        ServeSettings(workspace=Path("w"), host=host)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"password": "short"}, "password has 5 characters, expected at least 8"),
        ({"token": "0123456789"}, "token has 10 characters, expected at least 16"),
        ({"certificate": Path("c.pem")}, "a certificate needs its key"),
        ({"port": 70000}, "port 70000"),
    ],
)
def test_settings_that_protect_nothing_are_refused(
    settings: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        ServeSettings(workspace=Path("w"), **settings)  # type: ignore[arg-type]


def test_a_name_that_was_made_to_point_here_is_no_name_of_this_server(client: Client) -> None:
    here = client()
    assert refused(here) == 200
    assert refused(here, host="localhost:8080") == 200
    assert refused(here, host="[::1]:8080") == 200
    assert refused(here, host="evil.example") == 421
    assert (
        refused(here, host="192.168.1.7") == 421
    )  # nobody but this machine asks a loopback server
    assert refused(here, host="127.0.0.1.evil.example") == 421


def test_pages_of_other_sites_may_not_ask(client: Client) -> None:
    here = client()
    assert refused(here, origin="http://127.0.0.1") == 200
    assert refused(here, origin="http://evil.example") == 403
    assert refused(here, origin="null") == 403
    assert refused(here, origin="http://127.0.0.1:9999") == 403
    assert refused(here, sec_fetch_site="cross-site", sec_fetch_mode="no-cors") == 403
    opened = {"sec_fetch_mode": "navigate", "sec_fetch_dest": "document"}
    assert refused(here, sec_fetch_site="cross-site", **opened) == 200
    framed = {"sec_fetch_mode": "navigate", "sec_fetch_dest": "iframe"}
    assert refused(here, sec_fetch_site="cross-site", **framed) == 403


def test_sockets_pass_the_same_gate(client: Client) -> None:
    here = client()
    for headers in ({"origin": "http://evil.example"}, {"host": "evil.example"}):
        with (
            pytest.raises(WebSocketDisconnect),
            here.websocket_connect("/api/live/sources/a/frames", headers=headers),
        ):
            pass
    guarded = client(password=PASSWORD)
    with pytest.raises(WebSocketDisconnect), guarded.websocket_connect("/a"):
        pass


def test_off_loopback_nobody_is_let_in_without_a_secret(client: Client) -> None:
    far = client(host="0.0.0.0", password=PASSWORD, token=TOKEN, names=("cell.example",))  # noqa: S104
    for path in ("/api/items/cell", "/api/openapi.json", "/api/journal", "/api/jobs"):
        answer = far.get(path)
        assert answer.status_code == 401, path
        assert answer.headers["www-authenticate"] == "Bearer"
    for path in ("/", "/programs", f"{STATIC_ROOT}/bench.js", "/reports/model/a/b"):
        assert far.get(path, follow_redirects=False).headers["location"] == "/login", path
    assert far.post("/api/files?name=a", content=b"x").status_code == 401
    assert (
        far.get("/api/items/cell", headers={"authorization": f"Bearer {TOKEN}"}).status_code == 200
    )
    for wrong in (f"Bearer {PASSWORD}", "Bearer ", f"Basic {TOKEN}", "Bearer\x01"):
        assert far.get("/api/items/cell", headers={"authorization": wrong}).status_code == 401, (
            wrong
        )


def test_no_route_whatever_answers_a_stranger(client: Client) -> None:
    far = client(host="0.0.0.0", password=PASSWORD, token=TOKEN, names=("cell.example",))  # noqa: S104
    document = far.app.openapi()
    routes = [(m, path) for path, each in document["paths"].items() for m in each]
    assert len(routes) > 25
    routes += [(m, page.path) for page in SCREENS for m in ("get", "post")]
    routes += [
        ("get", f"{STATIC_ROOT}/vue/vue.esm-browser.prod.js"),
        ("get", f"{STATIC_ROOT}/three/index.js"),
        ("get", "/tools/predict"),
        ("get", "/tools/predict?job=a"),
        ("get", "/programs?id=a&part=judged"),
        ("get", "/reports/model/a/" + "0" * 64),
        ("get", "//api/items/cell"),
        ("get", "/login/../api/items/cell"),
        ("get", f"{STATIC_ROOT}/icon.svg/../../api/items/cell"),
        ("get", "/%61pi/items/cell"),
        ("get", "/API/items/cell"),
    ]
    for method, path in routes:
        for asked in (path, path.replace("{noun}", "cell")):
            answer = far.request(method, asked, follow_redirects=False)
            sent_away = answer.status_code == 303 and answer.headers["location"] == "/login"
            assert answer.status_code == 401 or sent_away, (method, asked, answer.status_code)
            assert far.cookies.get(COOKIE) is None
    for path in ("/", "/api/live/sources/a/frames"):
        with pytest.raises(WebSocketDisconnect), far.websocket_connect(path):
            pass


def test_login_gives_a_cookie_that_scripts_and_other_sites_do_not_get(client: Client) -> None:
    far = client(host="0.0.0.0", password=PASSWORD, names=("cell.example",))  # noqa: S104
    assert 'type="password"' in far.get("/login").text
    answer = far.post("/login", data={"secret": PASSWORD}, follow_redirects=False)
    cookie = answer.headers["set-cookie"].lower()
    assert answer.status_code == 303
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert "secure" not in cookie  # plain HTTP: the browser would not send it back
    assert far.get("/api/items/cell").status_code == 200
    far.post("/logout")
    assert far.get("/api/items/cell").status_code == 401


def test_wrong_passwords_are_counted(client: Client) -> None:
    far = client(password=PASSWORD)
    codes = [far.post("/login", data={"secret": "guess"}).status_code for _ in range(TRIES + 1)]
    assert codes == [403] * TRIES + [429]
    assert far.post("/login", data={"secret": PASSWORD}, follow_redirects=False).status_code == 429


def test_tries_are_forgiven_and_sessions_end() -> None:
    now = 0.0
    tries, sessions = Tries(clock=lambda: now), Sessions(clock=lambda: now)
    for _ in range(TRIES):
        tries.count("a")
    assert tries.wait("a") == WINDOW
    assert tries.wait("b") == 0.0
    name = sessions.open()
    now = LIFETIME - 1.0
    assert tries.wait("a") == 0.0
    assert sessions.holds(name)
    now += LIFETIME + 1.0
    assert not sessions.holds(name)
    assert not sessions.holds("made up")


def test_what_leaves_can_load_nothing_from_elsewhere(client: Client) -> None:
    headers = client().get("/api/items/cell").headers
    assert "default-src 'self'" in headers["content-security-policy"]
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert headers["cache-control"] == "no-store"


def test_what_is_too_large_is_refused_whether_it_says_so_or_not(client: Client) -> None:
    here = client(upload_limit=100_000, upload_total=10**9)
    assert here.post("/api/files?name=a", content=b"x" * 100_001).status_code == 413
    chunks = (b"x" * 10_000 for _ in range(11))
    assert here.post("/api/files?name=a", content=chunks).status_code == 413
    assert here.post("/api/jobs", content=b"x" * (2 * 1024 * 1024 + 1)).status_code == 413
    assert here.post("/api/files?name=a", content=b"x" * 100_000).status_code == 201


def test_uploads_have_a_quota_together(client: Client, filled: Shop, tmp_path: Path) -> None:
    alone = replace(filled, workspace=Workspace.create(tmp_path / "shop"))
    here = client(shop=alone, upload_limit=400_000, upload_total=1_000_000)
    content = b"x" * 300_000
    made = [here.post("/api/files?name=a", content=content) for _ in range(3)]
    codes = [each.status_code for each in made]
    assert codes == [201, 201, 400]
    assert made[2].json()["detail"].endswith("at most 1 MB are saved.")
    assert here.delete(f"/api/files/{made[0].json()['id']}").status_code == 204
    assert here.post("/api/files?name=a", content=content).status_code == 201
    for _ in range(4):
        here.post("/api/files?name=a", content=b"")  # refused, and takes nothing
    assert here.post("/api/files?name=a", content=b"x" * 100_000).status_code == 201
    with pytest.raises(ConfigurationError, match="less than one alone"):
        ServeSettings(workspace=Path("w"), upload_limit=2, upload_total=1)
