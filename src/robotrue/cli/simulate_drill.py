"""``robotrue simulate drill``: a drilling head that asks ``robotrue drill run`` for its moves."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_json, say
from robotrue.cli.simulate import until_stopped
from robotrue.core.files import write_atomic
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.errors import ConfigurationError
from robotrue.online.net_address import NetAddress, net_address
from robotrue.simulation.drilling_machine import DrillingMachine, random_campaign
from robotrue.simulation.drilling_online import DrillingRun, DrillingTally, run

PORT: Final = 47600
FILES: Final = ("foot.toml", "simulated-campaign.csv", "simulated-test.csv")
CLAMPS: Final = 60
"""Of the campaign; the test holds half as many, between its forces and heights."""
PIVOT: Final = np.array([0.0, 0.0, -350.0]) * MM


@dataclass(frozen=True, slots=True, kw_only=True)
class DrillFigures:
    """What came of a practice: true tilts in deg, which only a simulated machine knows."""

    moved: int
    tilt_before_mean_deg: float | None
    tilt_left_mean_deg: float | None
    tilt_left_max_deg: float | None
    refused: int
    without_answer: int
    alarms: str
    datagrams: int


def write_campaign_files(
    machine: DrillingMachine, folder: Path, *, seed: int, as_json: bool
) -> None:
    """Writes the foot, a campaign and a test of the machine, as its users would have them."""
    paths = [folder / name for name in FILES]
    try:
        folder.mkdir(exist_ok=True)
    except OSError as cause:
        raise ConfigurationError(
            f"cannot make the folder: {cause.strerror}.", source=folder, hint="--write practice"
        ) from cause
    for path in paths:
        check_output(path, [])
    foot, campaign, test = paths
    write_atomic(foot, _foot_text(machine).encode())
    write_campaign(campaign, random_campaign(machine, CLAMPS, np.random.default_rng([seed, 2])))
    held_out = random_campaign(
        machine, CLAMPS // 2, np.random.default_rng([seed, 3]), held_out=True
    )
    write_campaign(test, held_out)
    if as_json:
        emit_json({"simulated": "drilling head", "files": [str(path) for path in paths]})
        return
    say(f"SIMULATED drilling head of seed {seed}: {', '.join(map(str, paths))}")
    say(f"robotrue drill fit {foot} {campaign} -o drill.robotrue")
    say(f"robotrue drill report drill.robotrue {test} -o drill.html")


def run_drill(
    machine: DrillingMachine,
    address: str,
    *,
    holes: int,
    pause_s: float,
    damaged: float,
    shift_at: int,
    shift_um: float,
    gauge_deg: float,
    seconds: float | None,
    seed: int,
    as_json: bool,
) -> None:
    """Drills beside ``robotrue drill run`` until all holes are done, or until stopped."""
    where = _where(address)
    if holes < 1 or not 0.0 <= damaged < 1.0 or not pause_s >= 0.0 or not gauge_deg >= 0.0:
        raise ConfigurationError(
            f"{holes} holes, {damaged:g} of the datagrams damaged, {pause_s:g} s between holes, a "
            f"gauge of {gauge_deg:g} deg; expected at least 1, 0 to 1, and none below 0."
        )
    settings = DrillingRun(
        machine=machine,
        holes=holes,
        seed=seed,
        gauge_sigma=gauge_deg * DEG if gauge_deg else np.nan,
        shift_at=shift_at,
        shift=shift_um * UM,
        damaged=damaged,
        pause=pause_s,
    )
    say(f"SIMULATED drilling head of seed {seed}, sends to {where.shown}: {holes} holes.")
    say(f"robotrue drill run MODEL --journal holes.jsonl --from {where.shown}")
    say("Ctrl-C ends it after the hole under way.")
    alone = asyncio.Event()

    async def practised(stop: asyncio.Event) -> DrillFigures:
        def told(hole: str, tally: DrillingTally) -> None:
            say(_line(hole, tally))
            if len(tally.silent) == _GIVEN_UP and not (tally.left or tally.refused):
                alone.set()
                stop.set()

        return _figures(await run(settings, where.host, where.port, stop=stop, told=told))

    until_stopped("drilling head", practised, seconds=seconds, as_json=as_json)
    if alone.is_set():
        raise ConfigurationError(
            f"nobody answers at {where.shown}.",
            hint="start robotrue drill run first; --to where it says that it listens.",
        )


_GIVEN_UP: Final = 2
"""Holes without any answer after which nobody is there."""


def _where(address: str) -> NetAddress:
    where = net_address(address, default_port=PORT).only()
    if where.scheme != "udp":
        raise ConfigurationError(
            f"--to {where.scheme}://, expected udp://.", hint=f"--to udp://127.0.0.1:{PORT}"
        )
    return where


def _line(hole: str, tally: DrillingTally) -> str:
    if tally.silent[-1:] == [hole]:
        return f"simulated hole {hole}: no answer"
    if tally.refused and tally.refused[-1][0] == hole:
        return f"simulated hole {hole}: no move. {tally.refused[-1][1]}"
    before, left = (float(np.hypot(*each[-1]) / DEG) for each in (tally.before, tally.left))
    alarm = "; ALARM" if tally.alarms[-1:] == [hole] else ""
    return f"simulated hole {hole}: tilt {before:.3f} deg, {left:.4f} deg left in truth{alarm}"


def _figures(tally: DrillingTally) -> DrillFigures:
    found = DrillFigures(
        moved=len(tally.left),
        tilt_before_mean_deg=None,
        tilt_left_mean_deg=None,
        tilt_left_max_deg=None,
        refused=len(tally.refused),
        without_answer=len(tally.silent),
        alarms=", ".join(tally.alarms),
        datagrams=tally.sent,
    )
    if not tally.left:
        return found
    before, left = (np.hypot(*np.array(each).T) / DEG for each in (tally.before, tally.left))
    return replace(
        found,
        tilt_before_mean_deg=float(before.mean()),
        tilt_left_mean_deg=float(left.mean()),
        tilt_left_max_deg=float(left.max()),
    )


def _foot_text(machine: DrillingMachine) -> str:
    foot = machine.foot
    radii = ", ".join(f"{v / MM:g}" for v in foot.radius)
    angles = ", ".join(f"{v / DEG:g}" for v in foot.angle)
    pivot = ", ".join(f"{v / MM:g}" for v in PIVOT)
    return (
        "# simulated machine: robotrue simulate drill\n"
        f"[foot]\nradius_mm = [{radii}]\nangles_deg = [{angles}]\n"
        f"reading_sigma_um = {machine.noise / UM:g}\n\n"
        f'[head]\norder = "{machine.order}"\npivot_to_tip_mm = [{pivot}]\n'
    )
