"""``robotrue sense``: the service with the files, addresses and limits of the command line."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qs

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import emit_facts, emit_json, emit_table, say, say_mark
from robotrue.cli.sense_models import SensingFiles, provenances, sensing_of
from robotrue.cli.sense_table import HEADINGS, health_rows, live_table, summary
from robotrue.core.arrays import Array
from robotrue.core.files import sha256_of_file
from robotrue.core.provenance import Provenance, merge, read_provenance, simulation_mark
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.online.addresses import SourceSettings, open_stream
from robotrue.online.answering_link import answering_guard
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.clock_file import read_clock
from robotrue.online.corrections import Corrections, fixed_axes
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.held_note import begin_note, end_note
from robotrue.online.link import Health
from robotrue.online.net_address import parse_peer
from robotrue.online.path_axes import PathAxes
from robotrue.online.record import Record, RecordHeader, segments
from robotrue.online.record_frames import Kind
from robotrue.online.record_writer import RecordWriter
from robotrue.online.remote_guard import RemoteGuard
from robotrue.online.replay_blocks import Repeats, force_blocks
from robotrue.online.resume import Resumed, read_estimates_after, resume
from robotrue.online.samples import CorrectionMode
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_chain import SensingChain, StreamShift
from robotrue.online.service import (
    ServiceSettings,
    SinkPlan,
    Snapshot,
    sense,
    snapshot_document,
)
from robotrue.online.sink_addresses import open_sink
from robotrue.online.sink_settings import SinkSettings
from robotrue.online.udp import prompt_answers
from robotrue.robot.forward import forward

_FILES: Final = ("cell", "model", "frf", "tool", "deviation", "clock")
_BLOCKS: Final = 4096
"""Blocks that may wait for a file while the streams are live: half a minute of a fast sensor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SenseOptions(SensingFiles):
    """The command line; names as there."""

    robot: str
    force: str
    out: tuple[str, ...] = ()
    record: Path | None = None
    resume: bool = False
    rate: float | None = None
    clock: Path | None = None
    correct: bool = False
    limit_mm: float | None = None
    rate_mm_per_s: float | None = None
    watchdog_ms: float = 100.0
    recover: bool = False
    peer: str | None = None
    trust_restart: bool = False
    confirm_zero: bool = False
    low_pass_hz: float = 2.0
    correct_in: str = "base"
    name: str | None = None
    note: str = ""
    nodesets: Path | None = None
    seconds: float | None = None

    @property
    def replayed(self) -> bool:
        """Whether both streams are files, that can wait."""
        return all(a.lower().startswith("replay://") for a in (self.robot, self.force))


def run_sense(options: SenseOptions, *, as_json: bool) -> None:
    """Runs the service until the forces end, the time is over or Ctrl-C; prints its totals.

    Raises:
        RobotrueError: A file, address or limit that cannot be used, or a record that can no
            longer be whole.
    """
    cell = read_cell(options.cell)
    if options.resume and options.record is None:
        raise ConfigurationError("--resume without --record: nothing to go on with.")
    rate = _force_rate(options)
    sensing, remarks = sensing_of(options, rate)
    for remark in remarks:
        say(f"note: {remark}")
    origins = _origins(options)
    origin = merge(origins.values())
    options = replace(options, note=_noted(options.note, origin))
    say_mark(origin)
    warmed(sensing)
    shift = StreamShift()
    if options.clock is not None:
        shift, _ = read_clock(options.clock, live=not options.replayed)
    chain = SensingChain(sensing, shift=shift, patient=options.replayed)
    corrections = _corrections(options, cell)
    header = _header(options, rate, origins)
    resumed = _resumed(options, header, chain)
    peer = parse_peer(options.peer)[0] if options.peer is not None else ""
    if corrections is not None:
        limit = correction_limits(options).shift
        begin_note(peer, limit, confirmed=options.confirm_zero)
    writer = None if options.record is None else RecordWriter(options.record, header)
    try:
        with prompt_answers() if _answers(options) else contextlib.nullcontext():
            shot = asyncio.run(_served(options, cell, chain, corrections, writer, resumed, origin))
    finally:
        if writer is not None:
            writer.close()
        if corrections is not None and (left := end_note(peer, corrections.guard.state())):
            say(f"warning: {left}")
    _report(shot, options, origin, as_json=as_json)


def warmed(sensing: Sensing) -> None:
    """Has the kernels compiled before a robot waits for answers: another one takes one sample."""
    robot = sensing.models.robot
    spare = Sensing(sensing.models, sensing.settings)
    middle = robot.limits.mean(axis=1)
    shown = middle if robot.controller is None else robot.controller.to_controller(middle[None])[0]
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


async def _served(
    options: SenseOptions,
    cell: Cell,
    chain: SensingChain,
    corrections: Corrections | None,
    writer: RecordWriter | None,
    resumed: Resumed | None,
    origin: Provenance,
) -> Snapshot:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):  # Windows: Ctrl-C raises instead
            loop.add_signal_handler(number, stop.set)
    latest: list[Snapshot] = []
    plans = _sinks(options, cell, writer, resumed, lambda: _all_healths(latest), origin)
    guard = None if corrections is None else corrections.guard
    settings = SourceSettings(
        corrector=guard if isinstance(guard, CorrectionGuard | RemoteGuard) else None,
        peer=None if options.peer is None else parse_peer(options.peer),
        trust_restart=options.trust_restart,
    )
    rows = {"joints": 0, "force": 0} if resumed is None else dict(resumed.rows)
    robot = open_stream(options.robot, "robot", _with(settings, start_row=rows["joints"]))
    try:
        force = open_stream(
            options.force, "force", SourceSettings(start_row=rows["force"], robot=robot)
        )
    except BaseException:
        await robot.close()
        raise
    if writer is not None and resumed is not None:
        for block in resumed.missing:
            writer.put(Kind.ESTIMATES, block)
    with live_table(options.note) as show:

        def watch(shot: Snapshot) -> None:
            latest[:] = [shot]
            show(shot)

        return await sense(
            robot,
            force,
            chain,
            sinks=plans,
            record=writer,
            corrections=corrections,
            settings=ServiceSettings(
                patient=options.replayed,
                seconds=options.seconds,
                skip_estimates=0 if resumed is None else resumed.again,
            ),
            watch=watch,
            stop=stop,
        )


def _with(settings: SourceSettings, *, start_row: int) -> SourceSettings:
    return replace(settings, start_row=start_row)


def _sinks(
    options: SenseOptions,
    cell: Cell,
    writer: RecordWriter | None,
    resumed: Resumed | None,
    shown: Callable[[], tuple[Health, ...]],
    origin: Provenance,
) -> list[SinkPlan]:
    settings = SinkSettings(
        cell=options.name or "cell",
        note=options.note,
        provenance=origin,
        joints=cell.robot.dof,
        resume=options.resume,
        healths=shown,
        nodesets=options.nodesets,
    )
    plans = []
    for address in options.out:
        sink = open_sink(address, settings)
        whole = address.lower().startswith("csv")
        plan = SinkPlan(sink=sink, blocks=_BLOCKS if whole else 256, whole=whole)
        if whole and writer is not None and resumed is not None:
            plan = replace(
                plan,
                before=partial(_missed, writer, resumed, sink),
                after=partial(getattr, sink, "resumed_after", None),
            )
        plans.append(plan)
    return plans


def _missed(writer: RecordWriter, resumed: Resumed, sink: Any) -> Any:
    """What a file has missed of the record, up to where this service goes on."""
    line = getattr(sink, "resumed_after", None)
    yield from read_estimates_after(Record(writer.path), line, writer.first)
    yield from resumed.missing


def _resumed(options: SenseOptions, header: RecordHeader, chain: SensingChain) -> Resumed | None:
    """Where the record ended, if it is to be gone on with and the streams are files."""
    if options.record is None or not segments(options.record):
        return None
    if not options.resume:
        raise ConfigurationError(
            "there is a record already.",
            source=options.record,
            hint="--resume to go on with it, or another folder.",
        )
    record = Record(options.record)
    before = record.header()
    for what in ("addresses", "provenance", "settings"):
        old, new = dict(getattr(before, what)), dict(getattr(header, what))
        changed = sorted(k for k in {*old, *new} if old.get(k) != new.get(k))
        if changed:
            raise ModelMismatchError(
                f"the record was made with another {changed[0]} ({old.get(changed[0])!r}, now "
                f"{new.get(changed[0])!r}).",
                source=options.record,
                hint="the files and options it was begun with, or another folder.",
            )
    if not options.replayed:
        say("note: live streams go on in the record; estimates settle anew")
        return None
    found = resume(record, chain)
    for torn in record.torn:
        say(f"note: {torn.length} bytes of a torn frame in {torn.segment.name} are left out")
    say(
        f"note: going on behind {found.rows['joints']} joint and {found.rows['force']} force "
        f"samples; {found.checked} estimates made again and found the same"
    )
    return found


def _origins(options: SenseOptions) -> dict[str, Provenance]:
    """Where models and replayed streams come from, by role; a live wire says nothing of itself."""
    found = provenances(options)
    for role in ("robot", "force"):
        address = getattr(options, role)
        if address.lower().startswith("replay://"):
            found[role] = read_provenance(_path_of(address))
    return found


def _noted(note: str, origin: Provenance) -> str:
    """The note that every sink shows, with the mark in front where it lacks it."""
    mark = simulation_mark(origin, "simulated")
    if not mark or mark in note.lower():
        return note
    return f"{mark}, {note}" if note else mark


def _header(options: SenseOptions, rate: float, origins: Mapping[str, Provenance]) -> RecordHeader:
    provenance = {
        name: sha256_of_file(path)
        for name in _FILES
        if (path := getattr(options, name)) is not None
    }
    for role in ("robot", "force"):
        address = getattr(options, role)
        if address.lower().startswith("replay://"):
            provenance[role] = sha256_of_file(Path(_path_of(address)))
    return RecordHeader(
        addresses={"robot": _shown(options.robot), "force": _shown(options.force)},
        provenance=provenance,
        settings={
            "rate_hz": rate,
            "frf_joints": options.frf_joints,
            "frf_frame": options.frf_frame,
            "sensor": options.sensor,
            "spindle_rpm": options.spindle_rpm,
            "force_most_n": options.force_most,
        },
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        host_to_utc=time.time() - time.monotonic(),
        simulated=tuple(role for role, origin in origins.items() if simulation_mark(origin)),
    )


def _force_rate(options: SenseOptions) -> float:
    """Force samples per second: as stated, of the address, or of the file's first second."""
    stated = parse_qs(options.force.partition("?")[2]).get("rate", [])
    if options.rate is not None:
        return options.rate
    if stated and stated[0].lower().removesuffix("hz").replace(".", "", 1).isdigit():
        return float(stated[0].lower().removesuffix("hz"))
    scheme = options.force.partition("://")[0].lower()
    if scheme == "egm":
        return 250.0
    if scheme == "rtde":
        return 500.0
    if scheme != "replay":
        raise ConfigurationError(
            "the force samples per second are not stated.",
            source=_shown(options.force),
            hint="--rate-hz 1000, or rate=1000Hz in the address.",
        )
    path = Path(_path_of(options.force))
    for block in force_blocks(path, Repeats(), frame="sensor"):
        step = np.diff(block.controller_time[block.valid])
        if len(step) and np.median(step) > 0.0:
            return round(1.0 / float(np.median(step)), 3)
        break
    raise ConfigurationError(
        "the file does not show its samples per second.", source=path, hint="--rate-hz 1000"
    )


def _answers(options: SenseOptions) -> bool:
    """Whether the robot is one that waits for answers."""
    return options.robot.lower().startswith(("rsi://", "egm://"))


def correction_limits(options: SenseOptions) -> CorrectionLimits:
    """Returns what corrections keep within.

    Raises:
        ConfigurationError: No limit or no rate is stated, or one that cannot be.
    """
    if options.limit_mm is None or options.rate_mm_per_s is None:
        raise ConfigurationError(
            "corrections without limits.",
            hint="--limit-mm 0.2 --rate-mm-per-s 1, and the same in the controller (POSCORR).",
        )
    return CorrectionLimits(
        shift=options.limit_mm * MM,
        shift_rate=options.rate_mm_per_s * MM,
        cycle=12e-3 if _asked(options.robot, "cycle").startswith("12") else 4e-3,
        timeout=options.watchdog_ms * 1e-3,
        latch=not options.recover,
    )


def _asked(address: str, name: str) -> str:
    """What an address says of ``name`` behind its question mark, or nothing."""
    return parse_qs(address.partition("?")[2]).get(name, [""])[0]


def _corrections(options: SenseOptions, cell: Cell) -> Corrections | None:
    if not options.correct:
        stated = options.recover or options.trust_restart or options.confirm_zero
        if options.limit_mm is not None or options.rate_mm_per_s is not None or stated:
            raise ConfigurationError("limits of a correction without --correct.")
        return None
    limits = correction_limits(options)
    if not _answers(options):
        raise ConfigurationError(
            f"corrections to {_shown(options.robot)}: only rsi:// and egm:// robots take them.",
            hint="leave --correct out.",
        )
    if options.peer is None:
        raise ConfigurationError(
            "corrections without the address of the controller: any sender could take its place.",
            hint="--peer 192.168.1.10; --peer 127.0.0.1 for `robotrue simulate` on this computer.",
        )
    relative = _asked(options.robot, "mode") == CorrectionMode.RELATIVE.value
    mode = CorrectionMode.RELATIVE if relative else CorrectionMode.ABSOLUTE
    guard = answering_guard(limits, mode)
    if options.correct_in == "path" and not options.robot.lower().startswith("egm://"):
        raise ConfigurationError(
            f"--correct-in path with {_shown(options.robot)}: only egm:// controllers take a "
            "correction in the axes of their path.",
            hint="base, tool, or A,B,C in deg.",
        )
    return Corrections(guard, _axes(options.correct_in, cell), cutoff=options.low_pass_hz)


def _axes(text: str, cell: Cell) -> Callable[[Array], Array]:
    """The axes of the controller's correction in base, for joints as displayed."""
    if text == "base":
        return fixed_axes(np.eye(3))
    if text in ("tool", "path"):
        controller = cell.robot.controller

        def pose(joints: Array) -> Array:
            own = joints if controller is None else controller.to_model(joints)
            return np.asarray(forward(cell.robot, own[None])[0])

        return PathAxes(pose) if text == "path" else lambda joints: pose(joints)[:3, :3]
    try:
        angles = np.array([float(part) for part in text.split(",")])
    except ValueError:
        angles = np.zeros(0)
    if angles.shape != (3,) or not np.isfinite(angles).all():
        raise ConfigurationError(
            f"--correct-in {text!r}, expected base, tool, path, or A,B,C in deg.",
            hint="as RSI_ON and the sensor's frame of the running program say.",
        )
    return fixed_axes(matrix_from_abc(angles * DEG))


def _path_of(address: str) -> str:
    return address.partition("://")[2].partition("?")[0]


def _shown(address: str) -> str:
    """An address as it may be written down: without a password."""
    scheme, mark, rest = address.partition("://")
    head, at, tail = rest.rpartition("@")
    return f"{scheme}{mark}{'...@' if at and head else ''}{tail}"


def _all_healths(latest: list[Snapshot]) -> tuple[Health, ...]:
    if not latest:
        return ()
    shot = latest[0]
    return (*shot.sources.values(), *shot.sinks, *((shot.record,) if shot.record else ()))


def _report(shot: Snapshot, options: SenseOptions, origin: Provenance, *, as_json: bool) -> None:
    if as_json:
        clocks = {stream: asdict(fix) for stream, fix in shot.clocks.items()}
        document = snapshot_document(shot) | {"seconds": shot.running, "clocks": clocks}
        emit_json(document, origin)
        return
    emit_facts(
        "sensed",
        [
            ("for", f"{shot.running:.1f} s"),
            *((f"{stream} samples", str(rows)) for stream, rows in shot.rows.items()),
            ("estimates", f"{shot.given}, {shot.invalid} invalid in this run"),
        ],
        origin,
    )
    emit_table("health", HEADINGS, health_rows(shot))
    say(summary(shot, options.note))
