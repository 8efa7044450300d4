"""Estimate the deviation of the tool and its uncertainty at every force sample."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, LiveView, Note, PlainResult, Table
from robotrue.app.request import InputFile, Item, Reference, Request
from robotrue.app.request_fields import CellFile
from robotrue.core.provenance import Provenance, mark_sentence, merge
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.online.clocks import ClockFix
    from robotrue.online.link import Health
    from robotrue.online.sense_settings import CorrectionSettings, SenseSettings
    from robotrue.online.service import Snapshot


class SenseRunRequest(Request):
    """Sources, models of the arm, outputs and correction of the service."""

    cell: CellFile
    robot: str
    """Joints: rsi://, egm://, rtde:// or replay://FILE.csv"""
    force: str
    """Force: rdt://, egm://, rtde:// or replay://FILE.csv|.tdms"""
    out: tuple[str, ...] = ()
    """Output, may be repeated: csv:FILE, mqtt://, opcua://, ws://"""
    record: Path | None = None
    """Folder of the record: every sample and every estimate."""
    resume: bool = False
    """Continue an existing record and its files."""
    rate_hz: float | None = None
    """Force samples per second, if no address states it."""
    model: Annotated[Reference | None, Item(noun="model")] = None
    """Model of `calibrate`, for the stiffness."""
    frf: Annotated[Path | None, InputFile()] = None
    """Frequency response of the tool."""
    frf_joints: str | None = None
    """A1,..,A6 in deg, as displayed at the hammer test."""
    frf_frame: str | None = None
    """Axes of the response: base or tool."""
    tool: Annotated[Path | None, InputFile()] = None
    """File of `dynamics sensor`: weight and offset."""
    sensor: str | None = None
    """Pose of the force sensor on the flange, X,Y,Z,A,B,C in mm and deg."""
    deviation: Annotated[Path | None, InputFile()] = None
    """Model of `dynamics fit`."""
    spindle_rpm: float | None = None
    """Spindle speed, for --deviation."""
    force_most_n: float | None = None
    """Range of the force sensor."""
    clock: Annotated[Path | None, InputFile()] = None
    """Clock file of `sense align`."""
    correct: bool = False
    """Send corrections to the robot. Read the how-to."""
    limit_mm: float | None = None
    """Largest correction."""
    rate_mm_per_s: float | None = None
    """Fastest change of the correction."""
    watchdog_ms: float = 100.0
    """Corrections ramp to zero when the newest estimate is older than this."""
    recover: bool = False
    """After a fault restart from zero, once estimates are valid."""
    peer: str | None = None
    """Address of the controller; other senders are ignored. Required with --correct."""
    trust_restart: bool = False
    """RSI: a Delay near zero after a pause is a new RSI_ON without correction."""
    confirm_zero: bool = False
    """Confirm that the robot holds no correction."""
    low_pass_hz: float = 2.0
    """Cut-off frequency of the low-pass on corrections."""
    correct_in: str = "base"
    """Axes of the controller's correction: base, tool, path, A,B,C in deg."""
    name: str | None = None
    """Name of the cell in topics and pages."""
    note: str = ""
    """Note shown with every estimate, such as `simulated`."""
    nodesets: Annotated[Path | None, InputFile()] = None
    """Folder of OPC UA NodeSet files."""
    seconds: float | None = None
    """Run time in s; default: until Ctrl-C."""


@operation(is_service=True)
def run(request: SenseRunRequest, context: Context) -> PlainResult:
    """Runs the service until the forces end, the time is over or Ctrl-C; returns its totals.

    Raises:
        RobotrueError: A file, address or limit that cannot be used, or a record that can no
            longer be whole.
    """
    from robotrue.online.sense_settings import marked_note, origins_of
    from robotrue.online.service_run import run_service

    settings = _settings(request, context)
    origins = origins_of(settings)
    origin = merge(origins.values())
    settings = replace(settings, note=marked_note(settings.note, origin))
    if line := mark_sentence(origin):  # before the first estimate, not only with the totals
        context.inform(line)
    with context.shell.live() as show:

        def watch(shot: Snapshot) -> None:
            show(_live_view(shot, settings.note))

        shot = run_service(settings, origins, context, watch)
    return _result(shot, settings.note, origin)


def _settings(request: SenseRunRequest, context: Context) -> SenseSettings:
    from robotrue.online.net_address import parse_peer
    from robotrue.online.sense_settings import SenseSettings
    from robotrue.online.sensing_files import SensingFiles

    model_file, model = None, None
    if request.model is not None:
        model_file, model = context.model_file(request.model), context.model(request.model).model
    files = SensingFiles(
        cell=context.cell_file(request.cell),
        model=model_file,
        calibrated=model,
        frf=request.frf,
        frf_joints=request.frf_joints,
        frf_frame=request.frf_frame,
        tool=request.tool,
        sensor=request.sensor,
        deviation=request.deviation,
        spindle_rpm=request.spindle_rpm,
        force_most=request.force_most_n,
    )
    return SenseSettings(
        files=files,
        robot=request.robot,
        force=request.force,
        correction=_correction(request),
        peer=None if request.peer is None else parse_peer(request.peer),
        out=request.out,
        record=request.record,
        resume=request.resume,
        rate=request.rate_hz,
        clock=request.clock,
        name=request.name,
        note=request.note,
        nodesets=request.nodesets,
        seconds=request.seconds,
    )


def _correction(request: SenseRunRequest) -> CorrectionSettings | None:
    from robotrue.online.net_address import parse_peer
    from robotrue.online.sense_settings import (
        CorrectionSettings,
        correction_limits,
        require_correctable,
    )

    if not request.correct:
        stated = request.recover or request.trust_restart or request.confirm_zero
        if request.limit_mm is not None or request.rate_mm_per_s is not None or stated:
            raise ConfigurationError("limits of a correction without --correct.")
        return None
    limits = correction_limits(
        request.robot,
        limit_mm=request.limit_mm,
        rate_mm_per_s=request.rate_mm_per_s,
        watchdog_ms=request.watchdog_ms,
        recover=request.recover,
    )
    require_correctable(request.robot, request.correct_in)
    if request.peer is None:
        raise ConfigurationError(
            "corrections without the address of the controller: any sender could take its place.",
            hint="--peer 192.168.1.10; --peer 127.0.0.1 for `robotrue simulate` on this computer.",
        )
    return CorrectionSettings(
        limits=limits,
        host=parse_peer(request.peer)[0],
        axes=request.correct_in,
        cutoff=request.low_pass_hz,
        trust_restart=request.trust_restart,
        confirm_zero=request.confirm_zero,
    )


def _result(shot: Snapshot, note: str, origin: Provenance) -> PlainResult:

    from robotrue.online.service import snapshot_document

    clocks: dict[str, object] = {stream: asdict(fix) for stream, fix in shot.clocks.items()}
    totals = (
        ("for", f"{shot.running:.1f} s"),
        *((f"{stream} samples", str(rows)) for stream, rows in shot.rows.items()),
        ("estimates", f"{shot.given}, {shot.invalid} invalid in this run"),
    )
    return PlainResult(
        values=snapshot_document(shot) | {"seconds": shot.running, "clocks": clocks},
        shown=(
            Facts(title="sensed", rows=totals),
            Table(title="health", columns=HEADINGS, rows=_health_rows(shot)),
            Note(_summary(shot, note)),
        ),
        provenance=origin,
    )


HEADINGS: Final = (
    "", "there", "taken", "lost", "late", "refused", "dropped", "answer ms", "ppm", "last fault"
)  # fmt: skip
"""Answer: median and 99th percentile. Ppm: by which the sender's clock runs slow."""
_BAND: Final = 1.96
"""Standard deviations of a band that holds 95 of 100."""


def _live_view(shot: Snapshot, note: str) -> LiveView:
    """Returns what is shown while the service runs."""
    table = Table(title="", columns=HEADINGS, rows=_health_rows(shot))
    return LiveView(line=_summary(shot, note), table=table, at=shot.running)


def _summary(shot: Snapshot, note: str) -> str:
    """Returns one line: time, samples, error and band, correction."""
    from robotrue.online.estimates import doubt_words

    parts = [f"{shot.running:.0f} s", f"{shot.given} estimates", f"{shot.invalid} invalid"]
    latest = shot.latest
    if latest is not None and latest.valid[-1]:
        numbers = zip("xyz", latest.error[-1] / UM, _BAND * latest.sd[-1] / UM, strict=True)
        parts.append("error um " + " ".join(f"{a} {e:+.1f}±{s:.1f}" for a, e, s in numbers))
    elif latest is not None:
        parts.append("no valid error: " + doubt_words(int(latest.doubt[-1])))
    if shot.correction_um is not None:
        held = " ".join(f"{v:+.1f}" for v in shot.correction_um)
        parts.append(
            f"correction um {held}" + (f" ({shot.correction_why})" * bool(shot.correction_why))
        )
    if note:
        parts.append(note)
    return " · ".join(parts)


def _health_rows(shot: Snapshot) -> tuple[tuple[str, ...], ...]:
    """Returns the counters of everything that has some, a row each, as :data:`HEADINGS`."""
    outputs = (*shot.sinks, *((shot.record,) if shot.record else ()))
    return (
        *(
            _health_row(health, shot.clocks[stream], shot.faults.get(stream, ""))
            for stream, health in shot.sources.items()
        ),
        *(_health_row(health, None, "") for health in outputs),
    )


def _health_row(health: Health, clock: ClockFix | None, fault: str) -> tuple[str, ...]:
    import numpy as np

    answer = drift = ""
    if np.isfinite(health.turnaround_p50):
        answer = f"{1e3 * health.turnaround_p50:.2f}/{1e3 * health.turnaround_p99:.2f}"
    if clock is not None and clock.seconds:
        drift = f"{1e6 * clock.drift:+.1f}"
    counts = (health.received, health.lost, health.late, health.refused, health.dropped)
    return (
        health.name,
        "yes" if health.connected else "no",
        *(str(c) for c in counts),
        answer,
        drift,
        fault or health.last_fault,
    )
