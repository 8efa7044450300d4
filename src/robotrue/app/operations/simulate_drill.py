"""Simulated drilling head: clamps, requests its move, turns, and measures the hole."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Note, PlainResult
from robotrue.app.request import InputFile, Request
from robotrue.app.simulated_service import Seconds, run_until_stopped
from robotrue.errors import ConfigurationError
from robotrue.simulation.device_defaults import HOLES, SHIFT_UM

if TYPE_CHECKING:
    from robotrue.drilling.head import Head
    from robotrue.online.net_address import NetAddress
    from robotrue.simulation.drilling_machine import DrillingMachine
    from robotrue.simulation.drilling_online import DrillingRun, DrillingTally

PORT: Final = 47600
NO_ANSWERS: Final = 2
"""Holes without any answer after which the run ends."""


class SimulateDrillRequest(Request):
    """Machine to simulate, and its address."""

    to: str = f"udp://127.0.0.1:{PORT}"
    """Address of `drill run`."""
    write: Path | None = None
    """Write foot, campaign and test of this machine to a folder and end."""
    holes: int = HOLES
    """Number of holes."""
    pause_s: float = 0.5
    """Pause between two holes, s."""
    damaged: float = 0.0
    """Share of datagrams that are lost, repeated or truncated."""
    shift_at: int = 0
    """First hole with a shifted zero of a sensor; 0 for none."""
    shift_um: float = SHIFT_UM
    """Shift of the zero."""
    gauge_deg: float = 0.005
    """Standard deviation of the gauge at each hole; 0 for no gauge."""
    nonlinear: bool = False
    """Foot that deflects nonlinearly with force and tilt."""
    friction: bool = False
    """Friction in the foot's joint."""
    foot: Annotated[Path | None, InputFile()] = None
    """Foot file with sensors and head of the machine; default: three sensors at 60 mm."""
    seconds: Seconds = None
    seed: int = 0
    """Seed of the machine, its surfaces and its noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PracticeFigures:
    """Totals of a practice: true tilts in deg, which only a simulated machine knows."""

    moved: int
    tilt_before_mean_deg: float | None
    tilt_left_mean_deg: float | None
    tilt_left_max_deg: float | None
    refused: int
    without_answer: int
    alarms: str
    datagrams: int


@operation(is_service=True)
def run(request: SimulateDrillRequest, context: Context) -> PlainResult:
    """Drills with ``robotrue drill run`` until all holes are done or Ctrl-C; or writes files.

    Raises:
        ConfigurationError: Invalid numbers or address, or no answer.
    """
    from robotrue.drilling.foot_file import read_foot
    from robotrue.drilling.head import Head
    from robotrue.simulation.drilling_machine import PIVOT, drilling_machine

    setup = None if request.foot is None else read_foot(request.foot)
    head = Head(p_pivot_tip=PIVOT) if setup is None or setup.head is None else setup.head
    machine = drilling_machine(
        request.seed,
        nonlinear=request.nonlinear,
        friction=request.friction,
        foot=None if setup is None else setup.foot,
        order=head.order,
    )
    if request.write is None:
        return _drill(machine, head, request, context)
    return _write_files(machine, head, request, context)


def _write_files(
    machine: DrillingMachine, head: Head, request: SimulateDrillRequest, context: Context
) -> PlainResult:
    from robotrue.simulation.drilling_machine import write_practice_files

    seed, folder = request.seed, request.write or Path()
    paths = write_practice_files(machine, context.output(folder), seed=seed, head=head)
    foot, campaign, test = map(str, paths)
    return PlainResult(
        values={"simulated": "drilling head", "files": [foot, campaign, test]},
        shown=(
            Note(f"SIMULATED drilling head of seed {seed}: {foot}, {campaign}, {test}"),
            Note(f"robotrue drill fit {foot} {campaign} -o drill.robotrue"),
            Note(f"robotrue drill report drill.robotrue {test} -o drill.html"),
        ),
    )


def _drill(
    machine: DrillingMachine, head: Head, request: SimulateDrillRequest, context: Context
) -> PlainResult:
    from robotrue.simulation.drilling_online import run as drill_holes

    address = _address(request.to)
    settings = _settings(machine, head, request)
    context.inform(
        f"SIMULATED drilling head of seed {request.seed}, sends to {address.shown}: "
        f"{request.holes} holes."
    )
    context.inform(f"robotrue drill run MODEL --journal holes.jsonl --from {address.shown}")
    context.inform("Ctrl-C ends it after the current hole.")
    alone = asyncio.Event()

    async def practise(stop: asyncio.Event) -> object:
        def report_hole(hole: str, tally: DrillingTally) -> None:
            context.inform(_line(hole, tally))
            if len(tally.silent) == NO_ANSWERS and not (tally.left or tally.refused):
                alone.set()
                stop.set()

        tally = await drill_holes(settings, address.host, address.port, stop=stop, told=report_hole)
        return _figures(tally)

    result = run_until_stopped("drilling head", practise, seconds=request.seconds)
    if alone.is_set():
        raise ConfigurationError(
            f"no answer from {address.shown}.",
            hint="start robotrue drill run first; --to the address it reports.",
        )
    return result


def _settings(machine: DrillingMachine, head: Head, request: SimulateDrillRequest) -> DrillingRun:
    import math

    from robotrue.core.units import DEG, UM
    from robotrue.simulation.drilling_online import DrillingRun

    holes, damaged, pause, gauge = (
        request.holes, request.damaged, request.pause_s, request.gauge_deg,
    )  # fmt: skip
    if holes < 1 or not 0.0 <= damaged < 1.0 or not pause >= 0.0 or not gauge >= 0.0:
        raise ConfigurationError(
            f"{holes} holes, {damaged:g} of the datagrams damaged, {pause:g} s between holes, a "
            f"gauge of {gauge:g} deg; expected at least 1, 0 to 1, and none below 0."
        )
    return DrillingRun(
        machine=machine,
        holes=holes,
        seed=request.seed,
        gauge_sigma=gauge * DEG if gauge else math.nan,
        shift_at=request.shift_at,
        shift=request.shift_um * UM,
        damaged=damaged,
        pause=pause,
        sense=head.sense,
    )


def _address(text: str) -> NetAddress:
    from robotrue.online.net_address import net_address

    address = net_address(text, default_port=PORT)
    address.read_options({})
    if address.scheme != "udp":
        raise ConfigurationError(
            f"--to {address.scheme}://, expected udp://.", hint=f"--to udp://127.0.0.1:{PORT}"
        )
    return address


def _line(hole: str, tally: DrillingTally) -> str:
    import numpy as np

    from robotrue.core.units import DEG

    if tally.silent[-1:] == [hole]:
        return f"simulated hole {hole}: no answer"
    if tally.refused and tally.refused[-1][0] == hole:
        return f"simulated hole {hole}: no move. {tally.refused[-1][1]}"
    before, left = (float(np.hypot(*each[-1]) / DEG) for each in (tally.before, tally.left))
    alarm = "; ALARM" if tally.alarms[-1:] == [hole] else ""
    return f"simulated hole {hole}: tilt {before:.3f} deg, {left:.4f} deg true residual{alarm}"


def _figures(tally: DrillingTally) -> PracticeFigures:
    import numpy as np

    from robotrue.core.units import DEG

    before, left = (
        np.hypot(*np.array(each).T) / DEG if tally.left else None
        for each in (tally.before, tally.left)
    )
    return PracticeFigures(
        moved=len(tally.left),
        tilt_before_mean_deg=None if before is None else float(before.mean()),
        tilt_left_mean_deg=None if left is None else float(left.mean()),
        tilt_left_max_deg=None if left is None else float(left.max()),
        refused=len(tally.refused),
        without_answer=len(tally.silent),
        alarms=", ".join(tally.alarms),
        datagrams=tally.sent,
    )
