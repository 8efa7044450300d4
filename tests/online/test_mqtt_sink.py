"""Against a mosquitto of our own: killed and started again, frozen, with passwords, with TLS."""

import asyncio
import contextlib
import datetime
import gc
import json
import shutil
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from estimate_cases import estimates

from robotrue.errors import ConfigurationError
from robotrue.online.estimates import Doubt
from robotrue.online.link import Health
from robotrue.online.sinks import SinkSettings, open_sink

aiomqtt = pytest.importorskip("aiomqtt")
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason="needs the Debian package mosquitto")
SECRET = "not-for-logs-7"  # noqa: S105


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


class Broker:
    """A mosquitto on a free port with its own configuration."""

    def __init__(self, folder, *lines):
        self.port = _free_port()
        self._file = folder / "mosquitto.conf"
        self._file.write_text("\n".join([f"listener {self.port} 127.0.0.1", *lines]) + "\n")
        self.process = None

    def start(self):
        self.process = subprocess.Popen(  # noqa: S603
            [MOSQUITTO, "-c", str(self._file)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        until = time.monotonic() + 10
        while True:
            with (
                contextlib.suppress(OSError),
                socket.create_connection(("127.0.0.1", self.port), 1),
            ):
                return
            assert time.monotonic() < until, "mosquitto did not come up"
            assert self.process.poll() is None, "mosquitto ended"

    def kill(self):
        if self.process is not None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            self.process.wait(timeout=10)
            self.process = None


@pytest.fixture
def broker(tmp_path):
    made = Broker(tmp_path, "allow_anonymous true", "persistence false")
    try:
        made.start()
        yield made
    finally:
        made.kill()


async def _until(condition):
    async with asyncio.timeout(15):
        while not condition():
            await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def _listening(port, topic="#", **more):
    async with aiomqtt.Client("127.0.0.1", port, **more) as client:
        await client.subscribe(topic, qos=1)

        async def read():
            message = await asyncio.wait_for(anext(client.messages), 20)
            return str(message.topic), message.payload.decode(), message

        yield read


@contextlib.asynccontextmanager
async def _sink(address, **settings):
    sink = open_sink(address, SinkSettings(**{"environment": {}, **settings}))
    await sink.open()
    try:
        yield sink
    finally:
        await asyncio.wait_for(sink.close(), 10)


def test_every_row_arrives_once_and_in_order(broker):
    healths = (Health(name="rdt://x", connected=True, lost=4),)
    doubt = np.zeros(400, dtype=np.int64)
    doubt[100:110] = int(Doubt.BAD_FORCE | Doubt.SETTLING)

    async def scene():
        found, others = [], {}
        async with _listening(broker.port, "robotrue/c7/#") as read:
            address = f"mqtt://127.0.0.1:{broker.port}"
            async with _sink(address, cell="c7", note="simulated", healths=lambda: healths) as sink:
                await _until(lambda: sink.health().connected)
                for k in range(0, 400, 8):
                    await sink.write(estimates(k, 8, doubt=doubt[k : k + 8]))
                while sum(m["rows"] for m in found) < 400 or "robotrue/c7/health" not in others:
                    topic, text, _ = await read()
                    if topic.endswith("/estimate"):
                        found.append(json.loads(text))
                    else:
                        others[topic] = text
                health = sink.health()
            while others["robotrue/c7/status"] != "offline":
                topic, text, _ = await read()
                others[topic] = text
        return found, others, health

    found, others, health = asyncio.run(scene())
    assert [s for m in found for s in m["sequence"]] == list(range(400))
    assert len(found) == 8  # 0.4 s at 20 a second; the span of a message reaches its last row
    assert {m["note"] for m in found} == {"simulated"}
    ex = [v for m in found for v in m["ex_um"]]
    assert [v is None for v in ex] == list(doubt != 0)
    truth = estimates(0, 400).error[:, 0] * 1e6
    np.testing.assert_allclose(np.array(ex, dtype=float)[doubt == 0], truth[doubt == 0], atol=1e-4)
    assert {"4": 1, "20": 1}.keys() >= found[2]["doubt_words"].keys() - {"0"}
    assert any("bad_force+settling" in m["doubt_words"].values() for m in found)
    assert json.loads(others["robotrue/c7/health"])["links"][0]["lost"] == 4
    assert (health.received, health.dropped, health.refused) == (50, 0, 0)


def write_at_once(sink, block):
    """Writes a block; a write that waits for anything fails."""
    with pytest.raises(StopIteration):
        sink.write(block).send(None)


def test_killed_in_mid_stream_and_started_again(broker):
    async def scene():
        address = f"mqtt://127.0.0.1:{broker.port}"
        async with _sink(address, cell="c7") as sink:
            await _until(lambda: sink.health().connected)
            await sink.write(estimates(0, 100))
            broker.kill()
            k = 100
            while sink.health().dropped < 100:  # the service goes on, the queue stays bounded
                write_at_once(sink, estimates(k, 100))
                k += 100
                await asyncio.sleep(0)
            await _until(lambda: not sink.health().connected)
            assert sink.health().last_fault
            broker.start()
            sequence = []
            async with _listening(broker.port, "robotrue/c7/estimate") as read:
                await _until(lambda: sink.health().reconnects == 1)
                await sink.write(estimates(k, 100))
                while not sequence or sequence[-1] != k + 99:
                    sequence += json.loads((await read())[1])["sequence"]
        return sequence, k

    sequence, last = asyncio.run(scene())
    assert sequence == sorted(set(sequence))
    assert sequence[0] > 100  # the oldest were left out
    assert sequence[-1] == last + 99


_SERVICE = """
import asyncio, sys
from robotrue.online.sinks import open_sink
async def run():
    await open_sink(sys.argv[1]).open()
    await asyncio.sleep(60)
asyncio.run(run())
"""


def test_a_service_that_is_killed_leaves_its_last_will(broker):
    async def scene():
        async with _listening(broker.port, "plant/robot/status") as read:
            service = subprocess.Popen(  # noqa: S603
                [sys.executable, "-c", _SERVICE, f"mqtt://127.0.0.1:{broker.port}/plant/robot"]
            )
            try:
                said = [(await asyncio.wait_for(read(), 20))[1]]
            finally:
                service.kill()
                service.wait(timeout=10)
            said.append((await read())[1])
        async with _listening(broker.port, "plant/robot/status") as read:
            _, text, message = await read()
            return said, text, message.retain

    said, text, retained = asyncio.run(scene())
    assert said == ["online", "offline"]
    assert (text, retained) == ("offline", True)


def test_a_broker_that_hangs_holds_up_nobody(broker):
    async def scene():
        async with _sink(f"mqtt://127.0.0.1:{broker.port}") as sink:
            await _until(lambda: sink.health().connected)
            broker.process.send_signal(signal.SIGSTOP)
            for k in range(1500):
                write_at_once(sink, estimates(100 * k, 100))
                if k % 10 == 0:
                    await asyncio.sleep(0)
            broker.process.send_signal(signal.SIGCONT)
            return sink.health()

    health = asyncio.run(scene())
    assert health.received == 1500
    assert health.dropped > 1000


def test_one_that_is_not_there_yet():
    async def scene():
        async with _sink(f"mqtt://127.0.0.1:{_free_port()}") as sink:
            await sink.write(estimates(0, 10))
            await _until(lambda: sink.health().last_fault)
            return sink.health()

    health = asyncio.run(scene())
    assert not health.connected
    assert health.received == 1


def test_passwords_open_and_are_never_shown(tmp_path):
    passwords = tmp_path / "passwords"
    tool = shutil.which("mosquitto_passwd")
    if tool is None:
        pytest.skip("needs mosquitto_passwd of the Debian package mosquitto")
    subprocess.run(  # noqa: S603
        [tool, "-b", "-c", str(passwords), "cell", SECRET], check=True, capture_output=True
    )
    broker = Broker(tmp_path, "allow_anonymous false", f"password_file {passwords}", "user root")

    async def scene(address, environment):
        async with _sink(address, environment=environment) as sink:
            await _until(lambda: sink.health().connected or sink.health().last_fault)
            return sink.health(), repr(vars(sink)["_address"])

    try:
        broker.start()
        host = f"127.0.0.1:{broker.port}"
        by_address, shown = asyncio.run(scene(f"mqtt://cell:{SECRET}@{host}", {}))
        names = {"ROBOTRUE_MQTT_USER": "cell", "ROBOTRUE_MQTT_PASSWORD": SECRET}
        by_names, _ = asyncio.run(scene(f"mqtt://{host}", names))
        nobody, _ = asyncio.run(scene(f"mqtt://{host}", {}))
    finally:
        broker.kill()
    assert by_address.connected
    assert by_names.connected
    assert not nobody.connected
    assert "uthori" in nobody.last_fault
    assert SECRET not in repr((by_address, by_names, shown))


# paho-mqtt leaves the socket of a failed handshake to the collector
@pytest.mark.filterwarnings("ignore:Exception ignored in.*SSLSocket")
@pytest.mark.filterwarnings("ignore:unclosed.*SSLSocket")
def test_tls_with_an_authority_of_ones_own(tmp_path):
    _certificate(tmp_path)
    broker = Broker(
        tmp_path,
        "allow_anonymous true",
        f"certfile {tmp_path / 'cert.pem'}",
        f"keyfile {tmp_path / 'key.pem'}",
        "user root",
    )

    async def scene(environment):
        async with _sink(f"mqtts://127.0.0.1:{broker.port}", environment=environment) as sink:
            await _until(lambda: sink.health().connected or sink.health().last_fault)
            return sink.health()

    try:
        broker.start()
        known = asyncio.run(scene({"ROBOTRUE_MQTT_CA": str(tmp_path / "cert.pem")}))
        unknown = asyncio.run(scene({}))
    finally:
        broker.kill()
        gc.collect()
    assert known.connected
    assert not unknown.connected
    assert "certificate" in unknown.last_fault.lower()
    with pytest.raises(ConfigurationError, match="cannot be read"):
        open_sink("mqtts://h", SinkSettings(environment={"ROBOTRUE_MQTT_CA": str(tmp_path / "no")}))


def _certificate(folder):
    """Writes a certificate of 127.0.0.1 that signs itself."""
    x509 = pytest.importorskip("cryptography.x509")
    import ipaddress

    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "robotrue test")])
    now = datetime.datetime.now(datetime.UTC)
    day = datetime.timedelta(days=1)
    host = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(now - day)
        .not_valid_after(now + day)
        .add_extension(host, critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    (folder / "cert.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    (folder / "key.pem").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("mqtt://127.0.0.1/a/+/b", "in a topic"),
        ("mqtt://127.0.0.1?rate=0", "second, 0.1 to 100"),
        (f"mqtt://u:{SECRET}@127.0.0.1?speed=1", "option speed is unknown, expected rate="),
        (f"mqtt://u:{SECRET}@:x", "cannot be read"),
    ],
)
def test_addresses_that_are_refused(address, words):
    with pytest.raises(ConfigurationError, match=words) as refused:
        open_sink(address, SinkSettings(environment={}))
    assert SECRET not in str(refused.value)
