"""The sensing service from its settings: sources, sinks and record opened, run, closed."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.core.files import sha256_of_file
from robotrue.core.provenance import Provenance, merge, simulation_mark
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.online.addresses import SourceSettings, open_stream, protocol_of
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.clock_alignment import read_clock
from robotrue.online.corrections import Corrections, begin_note, end_note
from robotrue.online.estimates import EstimateBlock
from robotrue.online.link import Health, StreamSource
from robotrue.online.record import RecordHeader, StreamRecord, segments
from robotrue.online.record_frames import Kind
from robotrue.online.record_writer import RecordWriter
from robotrue.online.resume import Resumed, read_estimates_after, resume
from robotrue.online.sense_settings import (
    SenseSettings,
    corrections_of,
    force_rate,
    path_of,
    without_password,
)
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_chain import SensingChain, StreamShift
from robotrue.online.sensing_files import sensing_of
from robotrue.online.service import ServiceSettings, SinkPlan, Snapshot, sense
from robotrue.online.sinks import SinkSettings, open_sink
from robotrue.online.udp import prompt_answers

_FILES: Final = ("cell", "model", "frf", "tool", "deviation")
_BLOCKS: Final = 4096
"""Blocks that may wait for a file while the streams are live: half a minute of a fast sensor."""


class Listener(Protocol):
    """Receives messages from before the first estimate and after the last."""

    def note(self, text: str) -> None:
        """Receives warnings."""
        ...

    def inform(self, text: str) -> None:
        """Receives information."""
        ...


def run_service(
    settings: SenseSettings,
    origins: Mapping[str, Provenance],
    listener: Listener,
    watch: Callable[[Snapshot], None],
) -> Snapshot:
    """Runs the service until the forces end, the time is over or Ctrl-C; returns its totals.

    Args:
        settings: What it does; its note bears the mark of what it rests on.
        origins: Where models and replayed streams come from, by role.
        listener: Gets remarks on the estimator and the record.
        watch: Gets a snapshot several times a second.

    Raises:
        RobotrueError: A file, address or limit that cannot be used, or a record that can no
            longer be whole.
    """
    cell = read_cell(settings.files.cell)
    if settings.resume and settings.record is None:
        raise ConfigurationError("--resume without --record: no record to continue.")
    rate = force_rate(settings)
    sensing, remarks = sensing_of(settings.files, rate)
    for remark in remarks:
        listener.note(remark)
    compile_kernels(sensing)
    shift = StreamShift()
    if settings.clock is not None:
        shift, _ = read_clock(settings.clock, live=not settings.replayed)
    chain = SensingChain(sensing, shift=shift, patient=settings.replayed)
    correction, corrections = settings.correction, None
    if correction is not None:
        corrections = corrections_of(correction, settings.robot, cell)
    header = _header(settings, rate, origins)
    resumed = _resume_record(settings, header, chain, listener)
    if correction is not None:
        begin_note(correction.host, correction.limits.shift, confirmed=correction.confirm_zero)
    writer = None if settings.record is None else RecordWriter(settings.record, header)
    try:
        with (
            prompt_answers()
            if protocol_of(settings.robot).takes_corrections
            else contextlib.nullcontext()
        ):
            return asyncio.run(
                _serve(settings, cell, chain, corrections, writer, resumed, origins, watch)
            )
    finally:
        if writer is not None:
            writer.close()
        if correction is not None and corrections is not None:
            left = end_note(correction.host, corrections.guard.state())
            if left:
                listener.inform(f"warning: {left}")


def compile_kernels(sensing: Sensing) -> None:
    """Compiles the kernels before a robot waits for answers: a second estimator takes a sample."""
    robot = sensing.models.robot
    spare = Sensing(sensing.models, sensing.settings)
    middle = robot.limits.mean(axis=1)
    shown = robot.controller.to_controller(middle[None])[0]
    zero = np.zeros(2, dtype=np.int64)
    spare.joints(
        JointBlock(
            controller_time=np.array([0.0, 4e-3]),
            host_time=np.array([0.0, 4e-3]),
            joints=np.array([shown, shown]),
            T_frame_tool=np.full((2, 4, 4), np.nan),
            sequence=np.array([0, 1]),
            flags=zero,
        )
    )
    spare.force(
        ForceBlock(
            controller_time=np.array([4e-3, 5e-3]),
            host_time=np.array([4e-3, 5e-3]),
            wrench=np.zeros((2, 6)),
            frame="sensor",
            sequence=np.array([0, 1]),
            status=zero,
            flags=zero,
        )
    )


def stop_on_signals() -> asyncio.Event:
    """Returns what Ctrl-C and a request to end set, in the running loop."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):  # Windows: Ctrl-C raises instead
            loop.add_signal_handler(number, stop.set)
    return stop


async def _serve(
    settings: SenseSettings,
    cell: Cell,
    chain: SensingChain,
    corrections: Corrections | None,
    writer: RecordWriter | None,
    resumed: Resumed | None,
    origins: Mapping[str, Provenance],
    watch: Callable[[Snapshot], None],
) -> Snapshot:
    stop = stop_on_signals()
    latest: list[Snapshot] = []
    origin = merge(origins.values())
    plans = _sinks(settings, cell, writer, resumed, lambda: _all_healths(latest), origin)
    robot, force = await _open_streams(settings, corrections, resumed)
    if writer is not None and resumed is not None:
        for block in resumed.missing:
            writer.put(Kind.ESTIMATES, block)

    def keep_and_show(shot: Snapshot) -> None:
        latest[:] = [shot]
        watch(shot)

    return await sense(
        robot,
        force,
        chain,
        sinks=plans,
        record=writer,
        corrections=corrections,
        settings=ServiceSettings(
            patient=settings.replayed,
            seconds=settings.seconds,
            skip_estimates=0 if resumed is None else resumed.again,
        ),
        watch=keep_and_show,
        stop=stop,
    )


async def _open_streams(
    settings: SenseSettings, corrections: Corrections | None, resumed: Resumed | None
) -> tuple[StreamSource[JointBlock], StreamSource[ForceBlock]]:
    """Opens robot and force after the data that a record holds already; both or none."""
    rows = {"joints": 0, "force": 0} if resumed is None else resumed.rows
    correction = settings.correction
    robot = open_stream(
        settings.robot,
        "robot",
        SourceSettings(
            corrector=None if corrections is None else corrections.guard,
            peer=settings.peer,
            trust_restart=correction is not None and correction.trust_restart,
            start_row=rows["joints"],
        ),
    )
    try:
        behind = SourceSettings(start_row=rows["force"], robot=robot)
        return robot, open_stream(settings.force, "force", behind)
    except BaseException:
        await robot.close()
        raise


def _sinks(
    settings: SenseSettings,
    cell: Cell,
    writer: RecordWriter | None,
    resumed: Resumed | None,
    shown: Callable[[], tuple[Health, ...]],
    origin: Provenance,
) -> list[SinkPlan]:
    sink_settings = SinkSettings(
        cell=settings.name or "cell",
        note=settings.note,
        provenance=origin,
        joints=cell.robot.dof,
        resume=settings.resume,
        healths=shown,
        nodesets=settings.nodesets,
    )
    plans = []
    for address in settings.out:
        sink = open_sink(address, sink_settings)
        whole = address.lower().startswith("csv")
        missed = None
        if whole and writer is not None and resumed is not None:
            missed = partial(_give_missing, writer, resumed)
        plans.append(
            SinkPlan(sink=sink, blocks=_BLOCKS if whole else 256, whole=whole, missed=missed)
        )
    return plans


def _give_missing(
    writer: RecordWriter, resumed: Resumed, line: str | None
) -> Iterator[EstimateBlock]:
    """Yields the recorded estimates missing in a file, up to where this service continues."""
    yield from read_estimates_after(StreamRecord(writer.path), line, writer.first)
    yield from resumed.missing


def _resume_record(
    settings: SenseSettings, header: RecordHeader, chain: SensingChain, listener: Listener
) -> Resumed | None:
    """Returns the end of the record if it is to be continued and the streams are files."""
    if settings.record is None or not segments(settings.record):
        return None
    if not settings.resume:
        raise ConfigurationError(
            "there is a record already.",
            source=settings.record,
            hint="--resume to go on with it, or another folder.",
        )
    record = StreamRecord(settings.record)
    before = record.header()
    for what in ("addresses", "provenance", "settings"):
        old, new = dict(getattr(before, what)), dict(getattr(header, what))
        changed = sorted(k for k in {*old, *new} if old.get(k) != new.get(k))
        if changed:
            raise ModelMismatchError(
                f"the record was made with another {changed[0]} ({old.get(changed[0])!r}, now "
                f"{new.get(changed[0])!r}).",
                source=settings.record,
                hint="the files and options of its start, or another folder.",
            )
    if not settings.replayed:
        listener.note("live streams continue in the record; estimates settle again")
        return None
    found = resume(record, chain)
    for torn in record.torn:
        listener.note(f"{torn.length} bytes of a torn frame in {torn.segment.name} are left out")
    listener.note(
        f"continuing after {found.rows['joints']} joint and {found.rows['force']} force "
        f"samples; {found.checked} estimates recomputed with the same result"
    )
    return found


def _header(
    settings: SenseSettings, rate: float, origins: Mapping[str, Provenance]
) -> RecordHeader:
    provenance = {
        name: sha256_of_file(path)
        for name in _FILES
        if (path := getattr(settings.files, name)) is not None
    }
    if settings.clock is not None:
        provenance["clock"] = sha256_of_file(settings.clock)
    for role in ("robot", "force"):
        address = getattr(settings, role)
        if address.lower().startswith("replay://"):
            provenance[role] = sha256_of_file(Path(path_of(address)))
    return RecordHeader(
        addresses={
            "robot": without_password(settings.robot),
            "force": without_password(settings.force),
        },
        provenance=provenance,
        settings={
            "rate_hz": rate,
            "frf_joints": settings.files.frf_joints,
            "frf_frame": settings.files.frf_frame,
            "sensor": settings.files.sensor,
            "spindle_rpm": settings.files.spindle_rpm,
            "force_most_n": settings.files.force_most,
        },
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        host_to_utc=time.time() - time.monotonic(),
        simulated=tuple(role for role, origin in origins.items() if simulation_mark(origin)),
    )


def _all_healths(latest: list[Snapshot]) -> tuple[Health, ...]:
    if not latest:
        return ()
    shot = latest[0]
    return (*shot.sources.values(), *shot.sinks, *((shot.record,) if shot.record else ()))
