"""The service keeps every sample, goes on behind a crash, and no part of it drags another down."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from record_cases import HEADER, force_rows, joint_rows
from service_cases import ListSink, ListSource, StandIn, cut, equal, joined

from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError, ShapeError
from robotrue.online.blocks import ForceBlock
from robotrue.online.corrections import Corrections, fixed_axes
from robotrue.online.estimates import Doubt
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.record import StreamRecord
from robotrue.online.record_frames import Kind
from robotrue.online.record_writer import RecordWriter
from robotrue.online.resume import read_estimates_after, resume
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.sensing_chain import SensingChain
from robotrue.online.service import ServiceSettings, SinkPlan, Snapshot, sense

PATIENT = ServiceSettings(patient=True)
LIVE = ServiceSettings(health_every=0.02)


def run(story: Any) -> Any:
    return asyncio.run(asyncio.wait_for(story, 30.0))


def truth(joints: int, forces: int) -> dict[str, np.ndarray]:
    """What one pass over all rows at once gives."""
    chain = SensingChain(StandIn(), patient=True)
    found = chain.joints(joint_rows(0, joints)) + chain.end_stream("joints")
    return joined(found + chain.force(force_rows(0, forces)))


async def replayed(
    record: Path | None, *, seed: int = 1, forces: int = 6000, sinks: tuple[SinkPlan, ...] = ()
) -> Snapshot:
    writer = None if record is None else RecordWriter(record, HEADER)
    try:
        return await sense(
            ListSource("joints", cut(joint_rows, forces // 4, seed)),
            ListSource("force", cut(force_rows, forces, seed + 1)),
            SensingChain(StandIn(), patient=True),
            sinks=sinks,
            record=writer,
            settings=PATIENT,
        )
    finally:
        if writer is not None:
            writer.close()


def test_every_sample_reaches_record_and_file_however_it_was_cut(tmp_path: Path) -> None:
    wanted = truth(1500, 6000)
    for seed in (1, 2):
        sink = ListSink(slow=lambda: asyncio.sleep(0))
        plan = SinkPlan(sink=sink, blocks=2, whole=True)
        shot = run(replayed(tmp_path / f"r{seed}", seed=seed, sinks=(plan,)))
        assert shot.rows == {"joints": 1500, "force": 6000}
        assert shot.given == 6000
        assert equal(joined(sink.blocks), wanted)
        frames = list(StreamRecord(tmp_path / f"r{seed}").frames())
        assert equal(joined(f.content for f in frames if f.kind is Kind.ESTIMATES), wanted)
        taken = [f.content.sequence for f in frames if f.kind is Kind.FORCE]
        assert np.concatenate(taken).tolist() == list(range(6000))
        assert not sink.open_now


def test_a_display_that_cannot_follow_loses_the_oldest_and_nobody_else_does() -> None:
    display = ListSink(slow=lambda: asyncio.sleep(0.05))
    broken = ListSink(fault="gone")
    whole = ListSink()
    plans = (
        SinkPlan(sink=display, blocks=2),
        SinkPlan(sink=broken, blocks=2),
        SinkPlan(sink=whole, blocks=4, whole=True),
    )
    shot = run(replayed(None, sinks=plans))
    assert sum(map(len, whole.blocks)) == 6000
    assert shot.sinks[0].dropped > 0
    assert shot.sinks[1].last_fault == "RuntimeError: gone"
    assert shot.sinks[1].refused > 0
    assert not broken.open_now


def test_a_live_source_that_fails_is_opened_again() -> None:
    stop = asyncio.Event()

    async def story() -> tuple[Snapshot, ListSink, ListSource]:
        sink = ListSink()
        joints = ListSource("joints", [joint_rows(0, 500)], ends=False)
        force = ListSource(
            "force", [force_rows(0, 50), OSError("no route"), force_rows(60, 40)], ends=False
        )

        def look(shot: Snapshot) -> None:
            if shot.given == 90:
                stop.set()

        shot = await sense(
            joints,
            force,
            SensingChain(StandIn()),
            sinks=[SinkPlan(sink=sink)],
            settings=LIVE,
            watch=look,
            stop=stop,
        )
        return shot, sink, force

    shot, sink, force = run(story())
    assert force.opened == 2
    assert shot.faults == {"force": "no route"}
    assert joined(sink.blocks)["sequence"].tolist() == [*range(50), *range(60, 100)]


def test_forces_wait_a_moment_for_joints_that_a_busy_computer_holds_up() -> None:
    handed = asyncio.Event()

    async def story() -> ListSink:
        async def hand() -> None:
            handed.set()

        joints = [joint_rows(0, 25), handed.wait, lambda: asyncio.sleep(0.005), joint_rows(25, 25)]
        sink = ListSink()
        await sense(
            ListSource("joints", joints, ends=False),
            ListSource(
                "force", [lambda: asyncio.sleep(0), force_rows(0, 100), hand, force_rows(100, 100)]
            ),
            SensingChain(StandIn()),
            sinks=[SinkPlan(sink=sink)],
            settings=LIVE,
        )
        return sink

    assert equal(joined(run(story()).blocks), truth(50, 200))


def guard() -> CorrectionGuard:
    limits = CorrectionLimits(shift=1e-3, shift_rate=1.0, cycle=4e-3, ramp=0.0, timeout=1e6)
    return CorrectionGuard(limits, CorrectionMode.ABSOLUTE)


class Faulty(StandIn):
    def force(self, block: ForceBlock) -> Any:
        if block.sequence[0] >= 100:
            raise ZeroDivisionError("a bug")
        return super().force(block)


def test_a_bug_brings_the_correction_to_zero_before_the_links_close() -> None:
    held = guard()
    seen: list[bool] = []

    class Robot(ListSource):
        async def close(self) -> None:
            if not self.closed.is_set():
                seen.append(held.active)
            await super().close()

    async def story() -> None:
        await sense(
            Robot("joints", [joint_rows(0, 100)], ends=False),
            ListSource("force", [force_rows(4, 50), force_rows(100, 10)], ends=False),
            SensingChain(Faulty()),
            corrections=Corrections(held, fixed_axes(np.eye(3))),
            settings=LIVE,
        )

    with pytest.raises(ZeroDivisionError, match="a bug"):
        run(story())
    assert seen == [False]


def test_corrections_are_minus_the_error_in_the_axes_of_the_robot_s_correction() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # x of the frame is y
    chain = SensingChain(StandIn())
    chain.joints(joint_rows(0, 3000))
    (block,) = chain.force(force_rows(4, 4000))
    held = guard()
    taken = Corrections(held, fixed_axes(turn), cutoff=1000.0)
    taken.take(block)
    last = held.next(float(block.host_time[-1]))
    error = block.error[-1]
    np.testing.assert_allclose(
        last.shift, [-error[1], error[0], -error[2]], atol=0.02 * np.abs(error).max()
    )
    (bad,) = SensingChain(StandIn()).force(force_rows(0, 3))
    assert bad.doubt.tolist() == [int(Doubt.NO_JOINTS)] * 3
    taken.take(bad)
    assert held.why == "the estimate is not valid: no_joints"


def test_a_low_pass_of_two_hertz_passes_what_stands_and_not_what_swings() -> None:
    time_ = np.arange(5000) * 1e-3
    still, swing = np.array([20e-6, 0.0, 0.0]), np.array([0.0, 20e-6, 0.0])
    error = still + swing * np.sin(2.0 * np.pi * 60.0 * time_)[:, None]
    (block,) = SensingChain(StandIn()).force(force_rows(0, 5000))
    values = {n: getattr(block, n) for n in type(block).__dataclass_fields__}
    values |= {
        "error": error,
        "doubt": np.zeros(5000, dtype=np.int64),
        "joints": np.zeros((5000, 6)),
    }
    held = guard()
    Corrections(held, fixed_axes(np.eye(3))).take(type(block)(**values))
    last = held.next(5.0)
    np.testing.assert_allclose(last.shift, [-20e-6, 0.0, 0.0], atol=20e-6 * 2.0 / 60.0 * 1.1)


def test_a_record_without_room_stops_the_service_and_says_so(tmp_path: Path) -> None:
    def refuse(_file: int, _data: object) -> int:
        raise OSError(28, "No space left on device")

    async def story() -> None:
        writer = RecordWriter(tmp_path / "r", HEADER, memory=300_000, write=refuse)
        try:
            await sense(
                ListSource("joints", [], ends=False),
                ListSource("force", cut(force_rows, 20_000, 1)),
                SensingChain(StandIn()),
                record=writer,
                settings=LIVE,
            )
        finally:
            with pytest.raises(FormatError, match="could not be written"):
                writer.close()

    with pytest.raises(
        FormatError, match=r"record would not be whole \(cannot write to the disk: No space"
    ):
        run(story())


def test_a_checkpoint_of_other_models_is_refused(tmp_path: Path) -> None:
    run(replayed(tmp_path / "r"))
    chain = SensingChain(StandIn(), patient=True)
    first = resume(StreamRecord(tmp_path / "r"), chain)
    assert first.rows == {"joints": 1500, "force": 6000}
    state = chain.state()
    with pytest.raises(ShapeError, match="clock state fit"):
        SensingChain(StandIn()).restore({**state, "clock/force/fit": np.zeros(2)})
    del state["passed"]
    with pytest.raises(ModelMismatchError, match="a checkpoint without 'passed'"):
        SensingChain(StandIn()).restore(state)


class Other(StandIn):
    def force(self, block: ForceBlock) -> Any:
        self.memory = self.memory + 1e-9
        return super().force(block)


def test_other_models_than_those_of_the_record_are_seen(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "r", HEADER)
    chain = SensingChain(StandIn(), patient=True)
    for kind, block in ((Kind.JOINTS, joint_rows(0, 100)), (Kind.FORCE, force_rows(4, 200))):
        writer.put(kind, block)
        made = chain.joints(block) if kind is Kind.JOINTS else chain.force(block)
        for estimates in made:
            writer.put(Kind.ESTIMATES, estimates)
    writer.close()
    again = resume(StreamRecord(tmp_path / "r"), SensingChain(StandIn(), patient=True))
    assert again.checked == 200
    with pytest.raises(
        ModelMismatchError, match="error of frame 2 differs from the result of these models"
    ):
        resume(StreamRecord(tmp_path / "r"), SensingChain(Other(), patient=True))


def test_a_file_is_given_what_it_has_missed(tmp_path: Path) -> None:
    run(replayed(tmp_path / "r"))
    record = StreamRecord(tmp_path / "r")
    wanted = truth(1500, 6000)
    row = 2345
    line = f"{wanted['host_time'][row]:.9f},{wanted['sequence'][row]},1.0"
    rest = joined(read_estimates_after(record, line, 10**9))
    assert rest["sequence"].tolist() == list(range(row + 1, 6000))
    assert joined(read_estimates_after(record, None, 10**9))["sequence"].tolist() == list(
        range(6000)
    )
    assert list(read_estimates_after(record, "12345.0,9000,1", 10**9)) == []  # ahead of the record
    with pytest.raises(ConfigurationError, match="ends with an estimate that is not in the record"):
        list(read_estimates_after(record, "2.000500000,3,1", 10**9))


KILLED = """
import asyncio, sys
sys.path[:0] = [{tests!r}]
from pathlib import Path
from record_cases import HEADER, force_rows, joint_rows
from service_cases import ListSource, StandIn, cut
from robotrue.online.record import StreamRecord, segments
from robotrue.online.record_writer import RecordWriter
from robotrue.online.resume import resume
from robotrue.online.sensing_chain import SensingChain
from robotrue.online.service import ServiceSettings, sense
from robotrue.online.record_frames import Kind

async def main():
    path, seed = Path({path!r}), int(sys.argv[1])
    chain, again, missing = SensingChain(StandIn(), patient=True), 0, []
    if segments(path):
        found = resume(StreamRecord(path), chain)
        again, missing = found.again, found.missing
    writer = RecordWriter(path, HEADER, segment=200_000)
    for block in missing:
        writer.put(Kind.ESTIMATES, block)
    settings = ServiceSettings(
        patient=True, skip_estimates=again, checkpoint_every=0.05
    )
    print("running", flush=True)
    await sense(
        ListSource("joints", cut(joint_rows, {joints}, seed, start=chain.rows['joints'])),
        ListSource("force", cut(force_rows, {forces}, seed + 1, start=chain.rows['force'])),
        chain, record=writer, settings=settings,
    )
    writer.close()
    print("whole", flush=True)

asyncio.run(main())
"""


def test_killed_again_and_again_the_record_ends_whole_and_the_same(tmp_path: Path) -> None:
    """SIGKILL at moments that chance chose, in the middle of whatever was going on."""
    forces = 28_000
    text = KILLED.format(
        tests=str(Path(__file__).parent),
        path=str(tmp_path / "r"),
        joints=forces // 4,
        forces=forces,
    )
    # By size, not by time: a fast machine is done before a slow one has begun.
    least = forces * 7 * 8  # bytes of the forces' numbers alone

    def size() -> int:
        return sum(part.stat().st_size for part in (tmp_path / "r").glob("*"))

    rng, kills = np.random.default_rng(5), 0
    for seed in range(100):
        command = [sys.executable, "-c", text, str(seed)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:  # noqa: S603
            assert process.stdout is not None
            assert process.stdout.readline() == b"running\n"
            if kills < 4:
                grown = size() + rng.uniform(0.02, 0.2) * least
                while process.poll() is None and size() < grown:
                    time.sleep(0.001)
                process.send_signal(signal.SIGKILL)
            kills += process.wait(30.0) == -signal.SIGKILL
            if process.stdout.readline() == b"whole\n":
                break
    assert kills >= 3
    frames = list(StreamRecord(tmp_path / "r").frames())
    found = joined(f.content for f in frames if f.kind is Kind.ESTIMATES)
    assert equal(found, truth(forces // 4, forces))
    for kind, rows in ((Kind.JOINTS, forces // 4), (Kind.FORCE, forces)):
        taken = np.concatenate([f.content.sequence for f in frames if f.kind is kind])
        assert taken.tolist() == list(range(rows))
