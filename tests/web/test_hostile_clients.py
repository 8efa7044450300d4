"""Clients that send too much, too slowly, or too often, at a real server on this machine."""

from __future__ import annotations

import contextlib
import http.client
import shutil
import socket
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
from serving import serving
from web_shop import Served

from robotrue.web.front import Admission
from robotrue.web.serve_settings import Limits
from robotrue.web.sessions import TRIES, WINDOW, Tries, client_group

PASSWORD = "correct horse"  # noqa: S105
SECRET = "secret=correct+horse"  # noqa: S105
SECONDS = 1.0
"""s for a head and for a pause in a body, here; 10 s otherwise."""
PATIENCE = 40.0
"""s: the machine may have other things to do."""
START = f"""
import sys
from pathlib import Path
from robotrue.web import server
from robotrue.web.serve_settings import Limits, ServeSettings
server.serve(
    ServeSettings(
        workspace=Path(sys.argv[1]),
        port=0,
        password={PASSWORD!r},
        limits=Limits(head_seconds={SECONDS}, body_seconds={SECONDS}, per_address=100),
        **dict(zip(("certificate", "key"), map(Path, sys.argv[2:]))),
    ),
    ready=lambda address: print("at", address, flush=True),
)
"""


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("hostile") / "shop", start=START) as found:
        yield found


def connected(served: Served, address: str = "127.0.0.1") -> socket.socket:
    place = urlsplit(served.address)
    assert place.hostname is not None
    return socket.create_connection(
        (place.hostname, place.port), PATIENCE, source_address=(address, 0)
    )


def ended(connection: socket.socket) -> bytes:
    """What came until the other side ended the connection."""
    said = b""
    with contextlib.suppress(ConnectionResetError):
        while piece := connection.recv(65536):
            said += piece
    return said


def drain(socket: Any) -> None:
    """Takes what is on its way, until the other side closes."""
    while True:
        socket.recv(PATIENCE)


def cpu_seconds(served: Served) -> float:
    fields = Path(f"/proc/{served.process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def answered(
    served: Served, address: str, method: str, path: str, **request: Any
) -> tuple[int, http.client.HTTPMessage]:
    place = urlsplit(served.address)
    client = http.client.HTTPConnection(
        place.hostname or "", place.port, PATIENCE, source_address=(address, 0)
    )
    with contextlib.closing(client):
        client.request(method, path, **request)
        answer = client.getresponse()
        return answer.status, answer.headers


def logged_in(served: Served, address: str) -> int:
    return answered(served, address, "POST", "/login", body=SECRET)[0]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc, which Linux has")
@pytest.mark.parametrize(
    "beginning",
    [
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Long: ",
        b"GET /",
        # a line after the body is parsed as a head is
        b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\nX: ",
    ],
)
def test_an_endless_line_is_refused_at_once(guarded: Served, beginning: bytes) -> None:
    before, sent = cpu_seconds(guarded), 0
    with connected(guarded) as connection:
        connection.sendall(beginning)
        with contextlib.suppress(ConnectionResetError, BrokenPipeError):
            for _ in range(20 * 16):
                sent += connection.send(b"a" * 65536)
        ended(connection)
    assert sent < 20 * 1024 * 1024
    assert cpu_seconds(guarded) - before < 0.5  # 20 MB took longer before there was a limit


def test_half_open_heads_are_dropped_and_keep_nobody_out(guarded: Served) -> None:
    with contextlib.ExitStack() as stack:
        many = [stack.enter_context(connected(guarded)) for _ in range(200)]
        for each in many:
            with contextlib.suppress(ConnectionError):  # one of the oldest, which have gone
                each.sendall(b"GET / HTTP/1.1\r\nHost: ")
        assert logged_in(guarded, "127.0.0.1") == 303
        assert logged_in(guarded, "127.0.0.2") == 303
        assert [ended(each) for each in many] == [b""] * 200


@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl for a certificate")
def test_a_tls_handshake_that_does_not_come_is_dropped(tmp_path: Path) -> None:
    certificate, key = tmp_path / "c.pem", tmp_path / "k.pem"
    made = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=127.0.0.1".split()
    subprocess.run(  # noqa: S603
        [*made, "-keyout", key, "-out", certificate], check=True, capture_output=True, timeout=60
    )
    with serving(tmp_path / "shop", str(certificate), str(key), start=START) as secure:
        with connected(secure) as connection:
            assert ended(connection) == b""
        trusting = ssl.create_default_context(cafile=certificate)
        trusting.check_hostname = False
        with trusting.wrap_socket(connected(secure)) as connection:
            connection.sendall(b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert connection.recv(65536).startswith(b"HTTP/1.1 200")


def test_a_second_head_on_the_same_connection_has_no_more_time(guarded: Served) -> None:
    with connected(guarded) as connection:
        connection.sendall(b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert connection.recv(65536).startswith(b"HTTP/1.1 200")
        connection.sendall(b"GET /login HTTP/1.1\r\nHost: ")
        assert b"HTTP/1.1" not in ended(connection)


def test_a_body_that_does_not_come_is_refused(guarded: Served) -> None:
    head = b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\nsecret="
    with connected(guarded) as connection:
        connection.sendall(head)
        assert ended(connection).startswith(b"HTTP/1.1 408")


def test_guesses_made_at_once_are_counted_and_lock_out_nobody_else(guarded: Served) -> None:
    body = b"secret=guess"
    head = b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n"
    head += b"Expect: 100-continue\r\nContent-Length: %d\r\n\r\n" % len(body)
    ready = threading.Barrier(50)

    def guess(_: int) -> bytes:
        with connected(guarded, "127.0.0.3") as connection:
            connection.sendall(head)
            assert connection.recv(65536).startswith(b"HTTP/1.1 100")
            ready.wait(PATIENCE)  # the server waits for 50 bodies before the first one comes
            connection.sendall(body)
            return ended(connection).partition(b"\r\n")[0]

    with ThreadPoolExecutor(50) as pool:
        answers = sorted(pool.map(guess, range(50)))
    assert [each.split()[1] for each in answers] == [b"403"] * TRIES + [b"429"] * (50 - TRIES)
    assert logged_in(guarded, "127.0.0.4") == 303


def test_guesses_of_an_address_are_counted_for_it_alone() -> None:
    now = 0.0
    tries = Tries(clock=lambda: now)
    for k in range(1000):
        for _ in range(TRIES):
            tries.count(f"10.0.{k // 250}.{k % 250}")
    assert tries.wait("10.0.0.1") == WINDOW
    assert tries.wait("10.1.0.0") == 0.0
    tries.uncount("10.0.0.1")
    assert tries.wait("10.0.0.1") == 0.0
    now = WINDOW
    assert tries.wait("10.0.0.2") == 0.0
    assert not tries._guesses


def test_one_machine_is_one_address() -> None:
    assert client_group("192.168.1.7") == client_group("::ffff:192.168.1.7") == "192.168.1.7"
    assert client_group("2001:db8::1") == client_group("2001:db8::ffff:1")
    assert client_group("2001:db8::1") != client_group("2001:db8:0:1::1")
    assert client_group("fe80::1%eth0") == client_group("fe80::2")


class Connection:
    """What :class:`Admission` knows of a connection."""

    def __init__(self, address: str, connections: set[Any]) -> None:
        self.client, self.connections, self.transport = (address, 1), connections, self
        self.closed = False
        connections.add(self)

    def is_closing(self) -> bool:
        return self.closed

    def abort(self) -> None:
        self.closed = True


def test_the_oldest_connection_without_a_head_goes_first() -> None:
    admission, connections = Admission(Limits(per_address=3, connections=5)), set()

    def arrive(address: str) -> Any:
        found = Connection(address, connections)
        admission.admit(found)  # type: ignore[arg-type]
        return found

    first, second, third = (arrive("10.0.0.1") for _ in range(3))
    admission.settle(first)  # its head has come
    assert not any(each.closed for each in connections)
    arrive("10.0.0.1")
    assert {each for each in connections if each.closed} == {second}
    others = [arrive(f"10.0.0.{k}") for k in (2, 3)]
    for each in others:
        admission.settle(each)
    arrive("10.0.0.4")
    assert {each for each in connections if each.closed} == {second, third}


def test_connections_leave_descriptors_free() -> None:
    limits = Limits(per_address=100, connections=400).at_most(128)
    assert (limits.per_address, limits.connections) == (64, 128)


def test_a_logout_closes_the_sockets_of_its_session(guarded: Served) -> None:
    sync_client = pytest.importorskip("websockets.sync.client")
    closed = pytest.importorskip("websockets.exceptions").ConnectionClosedError
    refused = pytest.importorskip("websockets.exceptions").InvalidStatus
    place = urlsplit(guarded.address)

    def entered() -> dict[str, str]:
        _, headers = answered(guarded, "127.0.0.5", "POST", "/login", body=SECRET)
        return {"Cookie": headers["set-cookie"].partition(";")[0]}

    first, second = entered(), entered()
    made = httpx.post(
        f"{guarded.address}/api/live/sources",
        json={"address": "ws://127.0.0.1:9"},
        headers=first,
        trust_env=False,
    )
    source = made.json()["id"]
    socket_address = f"ws://{place.netloc}/api/live/sources/{source}/frames"
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:  # its relay starts beside
        with (
            contextlib.suppress(refused),
            sync_client.connect(socket_address, additional_headers=second, proxy=None),
        ):
            break
        time.sleep(0.1)
    with (
        sync_client.connect(socket_address, additional_headers=first, proxy=None) as one,
        sync_client.connect(socket_address, additional_headers=first, proxy=None) as two,
        sync_client.connect(socket_address, additional_headers=second, proxy=None) as other,
    ):
        for each in (one, two, other):
            assert each.recv(PATIENCE).startswith('{"type"')
        assert answered(guarded, "127.0.0.5", "POST", "/logout", headers=first)[0] == 303
        for each in (one, two):
            with pytest.raises(closed) as told:
                drain(each)
            assert told.value.rcvd.code == 1008
        assert other.ping().wait(PATIENCE)


def test_what_waits_for_an_answer_gets_none_after_a_logout(guarded: Served) -> None:
    _, headers = answered(guarded, "127.0.0.5", "POST", "/login", body=SECRET)
    cookie = {"Cookie": headers["set-cookie"].partition(";")[0]}
    head = f"POST /api/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: {cookie['Cookie']}\r\n"
    with connected(guarded) as connection:
        connection.sendall(f"{head}Expect: 100-continue\r\nContent-Length: 2\r\n\r\n".encode())
        assert connection.recv(65536).startswith(b"HTTP/1.1 100")
        assert answered(guarded, "127.0.0.5", "POST", "/logout", headers=cookie)[0] == 303
        connection.sendall(b"{}")
        assert connection.recv(65536).startswith(b"HTTP/1.1 401")
