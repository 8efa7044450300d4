"""``robotrue drill run`` beside a simulated machine: moves, refusals, alarms, kill -9."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.drilling.foot_model import estimate_tilt, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.journal import Journal
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.production import record_of, update_model
from robotrue.errors import FormatError
from robotrue.simulation.drilling_machine import DrillingMachine, drilling_machine, random_campaign
from robotrue.simulation.drilling_online import DrillingRun, DrillingTally, run


@pytest.fixture(scope="module")
def machine() -> DrillingMachine:
    return drilling_machine(4)


@pytest.fixture
def model(machine: DrillingMachine, tmp_path: Path) -> Path:
    campaign = random_campaign(machine, 60, np.random.default_rng(4))
    head = Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
    learned, _ = fit_model(machine.foot, head, campaign, kind="interactions")
    write_model(tmp_path / "m.robotrue", learned)
    return tmp_path / "m.robotrue"


KILLED_BEFORE_THE_MODEL = """
import os, signal, robotrue.app.drilling_desk
def killed(*_): os.kill(os.getpid(), signal.SIGKILL)
robotrue.app.drilling_desk.write_model = killed
"""


class Service:
    """A process of ``drill run`` and the port it says."""

    def __init__(self, model: Path, journal: Path, *further: str, first: str = "") -> None:
        command = first + "from robotrue.cli.main import run; run()"
        self.process = subprocess.Popen(  # noqa: S603 - this interpreter
            [sys.executable, "-c", command, "drill", "run", str(model), "--journal", str(journal),
             "--from", "udp://127.0.0.1:0", "--json", *further],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stderr is not None
        said = self.process.stderr.readline()
        found = re.search(r"udp://127\.0\.0\.1:(\d+)", said)
        assert found is not None, said
        self.port = int(found[1])

    def end(self, by: signal.Signals = signal.SIGTERM) -> tuple[int, list[dict]]:
        self.process.send_signal(by)
        out, err = self.process.communicate(timeout=20)
        if by is signal.SIGTERM:
            assert self.process.returncode == 0, err
        return self.process.returncode, [json.loads(line) for line in out.splitlines()]


def practised(service: Service, settings: DrillingRun) -> DrillingTally:
    return asyncio.run(run(settings, "127.0.0.1", service.port))


def test_a_job_with_damaged_datagrams_and_a_shifted_zero(
    machine: DrillingMachine, model: Path, tmp_path: Path
) -> None:
    service = Service(model, tmp_path / "j.jsonl", "-o", str(tmp_path / "after.robotrue"),
                      "--quiet-ms", "80")  # fmt: skip
    try:
        job = DrillingRun(machine=machine, holes=14, seed=3, shift_at=7, damaged=0.03)
        tally = practised(service, job)
    finally:
        code, lines = service.end()
    assert tally.silent == tally.refused == []
    left = np.hypot(*(np.array(tally.left) / DEG).T)
    assert np.hypot(*(np.array(tally.before) / DEG).T).mean() > 1.0
    assert left[:6].max() < 0.02
    assert left[6] > 0.02  # 50 um on one sensor
    assert tally.alarms
    assert 7 <= int(tally.alarms[0][1:]) <= 12
    assert [line["hole"] for line in lines if line["status"] == "move"] == [
        f"H{k}" for k in range(1, 15)
    ]
    assert read_model(tmp_path / "after.robotrue").version == 15
    assert code == 0


def test_kill_9_between_move_and_reference_loses_neither(
    machine: DrillingMachine, model: Path, tmp_path: Path
) -> None:
    journal, after = tmp_path / "j.jsonl", tmp_path / "after.robotrue"
    service = Service(model, journal, "-o", str(after))
    tally = practised(service, DrillingRun(machine=machine, holes=2, gauge_sigma=np.nan))
    service.end(signal.SIGKILL)
    assert len(tally.left) == 2
    with journal.open("ab") as file:
        file.write(b'{"kind": "answer", "hole": "H3", "sta')
    with Journal(journal) as kept:
        assert kept.state.answered == 2
        assert list(kept.state.waiting) == ["H1", "H2"]
    service = Service(model, journal, "-o", str(after), "--truth", "mandrel plane")
    try:
        asyncio.run(_sent(service.port, {"hole": "H1", "left_a_deg": 0.01, "left_b_deg": 0.0}))
        asyncio.run(_sent(service.port, {"hole": "H1", "left_a_deg": 0.01, "left_b_deg": 0.0}))
    finally:
        _, lines = service.end()
    assert [line["status"] for line in lines] == ["recorded", "unread"]
    assert "for which this session has no move" in lines[1]["said"]
    assert read_model(after).version == 2


def test_kill_9_between_journal_and_model_loses_no_reference(
    machine: DrillingMachine, model: Path, tmp_path: Path
) -> None:
    """Fails when the next start does not bring the model up to its journal."""
    journal, after = tmp_path / "j.jsonl", tmp_path / "after.robotrue"
    settings = ("-o", str(after), "--truth", "mandrel plane", "--sigma-deg", "0.002")
    service = Service(model, journal, *settings, first=KILLED_BEFORE_THE_MODEL)
    practised(service, DrillingRun(machine=machine, holes=2, gauge_sigma=np.nan))
    asyncio.run(_heard_nothing(service, {"hole": "H1", "left_a_deg": 0.01, "left_b_deg": 0.02}))
    assert service.process.wait(timeout=60) == -signal.SIGKILL
    service.end(signal.SIGKILL)
    assert not after.exists()
    service = Service(model, journal, *settings[:-1], "0.5")  # the journal knows its 0.002 deg
    _, lines = service.end()
    assert lines == []
    assert read_model(after).version == 2
    before, got = read_model(model), read_model(after)
    with Journal(journal) as kept:
        moved = kept.state.references[0].moved
        assert list(kept.state.waiting) == ["H2"]
    left = np.array([0.01, 0.02]) * DEG
    found = estimate_tilt(before, moved.clamps)
    record = record_of("H1", found, left, "mandrel plane", moved=moved.tilt)
    expected = update_model(before, found, record, reference=0.002 * DEG).model
    assert np.abs(expected.refinement.coefficients).max() > 1e-6
    np.testing.assert_allclose(
        got.refinement.coefficients, expected.refinement.coefficients, rtol=1e-9
    )
    np.testing.assert_allclose(got.monitor.sums, expected.monitor.sums, rtol=1e-9)
    assert got.refinement.truths == ("mandrel plane",)
    assert got.provenance.simulated


def test_a_force_outside_the_campaign_and_a_foot_that_judges_itself_are_refused(
    model: Path, tmp_path: Path
) -> None:
    service = Service(model, tmp_path / "j.jsonl", "--truth", "foot", "--quiet-ms", "60")
    clamp = {"d1_mm": 0.1, "d2_mm": 0.1, "d3_mm": 0.1, "z_mm": 0, "A_deg": 0, "B_deg": 0}
    try:
        answer = asyncio.run(_clamped(service.port, {**clamp, "force_N": 5000.0}))
        assert answer["status"] == "refused"
        assert "clamp force is 5000 N" in answer["said"]
        missing = {name: value for name, value in clamp.items() if name != "A_deg"}
        answer = asyncio.run(_clamped(service.port, {**missing, "force_N": 500.0}))
        assert answer["status"] == "unread"
        assert "A_deg is missing" in answer["said"]
        answer = asyncio.run(_sent(service.port, {"again": "9"}))
        assert answer["status"] == "unknown"
    finally:
        service.end()


def test_a_journal_that_is_none_is_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    path.write_text('{"kind": "answer", "hole": "1", "version": 1, "status": "refused"}\nhello\n')
    before = path.read_bytes()
    with pytest.raises(FormatError, match=r"j\.jsonl:2: not a line of a drilling journal"):
        Journal(path)
    assert path.read_bytes() == before


async def _sent(port: int, values: dict) -> dict:
    """Sends values once and returns the answer."""
    return await _clamped(port, values, times=1)


async def _heard_nothing(service: Service, values: dict) -> None:
    """Sends values once to a service that is killed by them."""
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        asyncio.DatagramProtocol, remote_addr=("127.0.0.1", service.port)
    )
    transport.sendto(json.dumps(values).encode())
    transport.close()


async def _clamped(port: int, values: dict, times: int = 200) -> dict:
    """Sends values a hundred times a second until an answer comes."""
    loop = asyncio.get_running_loop()
    got: asyncio.Future[dict] = loop.create_future()

    class Link(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
            if not got.done():
                got.set_result(json.loads(data))

    transport, _ = await loop.create_datagram_endpoint(Link, remote_addr=("127.0.0.1", port))
    try:
        for _ in range(times):
            transport.sendto(json.dumps(values).encode())
            await asyncio.wait([got], timeout=0.01 if times > 1 else 10.0)
            if got.done():
                return got.result()
        async with asyncio.timeout(10.0):
            return await got
    finally:
        transport.close()
