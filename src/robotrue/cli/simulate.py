"""``robotrue simulate``: controllers and a force sensor on this computer, until Ctrl-C.

All of them live through the same cycle at the same time, so that a robot and a sensor started in
two terminals belong together.
"""

from __future__ import annotations

import asyncio
import signal
import socket
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_facts, emit_json, say
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.dynamics.formats.sensor_csv import sensor_csv
from robotrue.errors import ConfigurationError
from robotrue.online.egm import RobotWare
from robotrue.online.rdt import RdtDevice
from robotrue.online.rsi_config import read_rsi_config, usual_rsi_config
from robotrue.online.samples import CorrectionMode
from robotrue.online.udp import prompt_answers
from robotrue.simulation import egm_controller, rsi_controller
from robotrue.simulation.online_faults import parse_fault
from robotrue.simulation.online_scenario import (
    CYCLE,
    KNOCKS,
    PASS,
    OnlineScenario,
    ScenarioMotion,
    online_scenario,
)
from robotrue.simulation.rdt_sensor import FAULTS as SENSOR_FAULTS
from robotrue.simulation.rdt_sensor import RdtSensor, RdtSensorSettings, netftapi_page
from robotrue.simulation.rtde_controller import RtdeController, RtdeControllerSettings
from robotrue.simulation.wire_faults import FAULTS as CONTROLLER_FAULTS

_RSI_PORT: Final = 49152
SENSOR: Final = Provenance(simulated=True, instrument="force sensor")
_WRIST: Final = matrix_from_abc(
    np.array([[0, 0, 0], [0, 0, 180], [0, 0, 90], [0, 0, -90], [0, 90, 0], [0, -90, 0]]) * DEG
)
"""The flange up, down and to four sides: attitudes in which what hangs on it is weighed."""
_LABELS: Final[Mapping[str, str]] = {
    "largest_mm": "largest correction, mm",
    "largest_step_mm": "largest step of it, mm",
    "correction": "correction at the end, mm and deg",
    "offset": "offset at the end, mm",
    "left_out": "left out, this computer was busy",
    "withheld": "withheld by a fault",
    "late": "late",
    "overslept": "of these, in cycles the simulator cut short",
    "broke_off": "broke off",
    "stopped": "stopped",
    "moved": "holes moved for",
    "tilt_before_mean_deg": "true tilt before, mean deg",
    "tilt_left_mean_deg": "true tilt left, mean deg",
    "tilt_left_max_deg": "true tilt left, largest deg",
    "without_answer": "without an answer",
}


def run_rsi(
    host: str,
    port: int | None,
    *,
    config: Path | None,
    cycle_ms: int,
    mode: str,
    robot: str | None,
    seconds: float | None,
    seed: int,
    faults: Sequence[str],
    as_json: bool,
) -> None:
    """Sends what a KUKA controller sends."""
    kind = _chosen(mode, {m.value: m for m in CorrectionMode}, "mode")
    agreed = usual_rsi_config(host, _RSI_PORT, hold=kind is CorrectionMode.ABSOLUTE)
    if config is not None:
        agreed = replace(read_rsi_config(config), host=host)
    if port is not None:
        agreed = replace(agreed, port=port or _free_port())
    scenario = online_scenario(seed, robot)
    settings = rsi_controller.RsiControllerSettings(
        config=agreed,
        mode=kind,
        cycle_ms=cycle_ms,
        motion=ScenarioMotion(scenario=scenario, begun=time.monotonic()),
        faults=tuple(parse_fault(text, CONTROLLER_FAULTS) for text in faults),
        keeps_time=True,
    )
    options = f"?cycle={cycle_ms}ms&mode={kind.value}"
    options += f"&config={config}" if config is not None else ""
    _announce(
        f"KUKA controller, sends to udp {agreed.host}:{agreed.port} every {cycle_ms} ms",
        scenario,
        f"--robot 'rsi://{agreed.host}:{agreed.port}{options}'",
    )
    until_stopped(
        "KUKA controller",
        lambda stop: rsi_controller.run(settings, stop=stop),
        seconds=seconds,
        as_json=as_json,
    )


def run_egm(
    host: str,
    port: int,
    *,
    robotware: int,
    force: bool,
    robot: str | None,
    seconds: float | None,
    seed: int,
    faults: Sequence[str],
    as_json: bool,
) -> None:
    """Sends what an ABB controller sends."""
    generation = _chosen(str(robotware), {"6": RobotWare.SIX, "7": RobotWare.SEVEN}, "robotware")
    scenario = online_scenario(seed, robot)
    begun = time.monotonic()
    port = port or _free_port()

    def felt(elapsed: float) -> tuple[float, ...]:
        return tuple(scenario.sensor_wrench(np.array([begun + elapsed]))[0].tolist())

    settings = egm_controller.EgmControllerSettings(
        target=(host, port),
        generation=generation,
        motion=ScenarioMotion(scenario=scenario, begun=begun),
        force=felt if force else None,
        faults=tuple(parse_fault(text, CONTROLLER_FAULTS) for text in faults),
        keeps_time=True,
    )
    address = f"'egm://{host}:{port}?robotware={robotware}'"
    _announce(
        f"ABB controller with RobotWare {robotware}, sends to udp {host}:{port} every 4 ms",
        scenario,
        f"--robot {address}" + (f" --force {address}" if force else ""),
    )
    until_stopped(
        "ABB controller",
        lambda stop: egm_controller.run(settings, stop=stop),
        seconds=seconds,
        as_json=as_json,
    )


def run_rtde(
    host: str,
    port: int,
    *,
    robot: str | None,
    seconds: float | None,
    seed: int,
    faults: Sequence[str],
    as_json: bool,
) -> None:
    """Serves what a Universal Robots controller serves."""
    scenario = online_scenario(seed, robot)
    settings = RtdeControllerSettings(
        host=host,
        port=port,
        seed=seed,
        faults=tuple(parse_fault(text, CONTROLLER_FAULTS) for text in faults),
    )

    async def serve(stop: asyncio.Event) -> Any:
        controller = RtdeController(settings, scenario)
        serving = asyncio.create_task(controller.run(stop=stop))
        listening = asyncio.create_task(controller.listening.wait())
        await asyncio.wait((serving, listening), return_when=asyncio.FIRST_COMPLETED)
        listening.cancel()
        if not serving.done():
            _announce(
                f"Universal Robots controller, tcp {host}:{controller.port}",
                scenario,
                f"--robot 'rtde://{_reached(host)}:{controller.port}?rate=500Hz'",
            )
        return await serving

    until_stopped("Universal Robots controller", serve, seconds=seconds, as_json=as_json)


def run_rdt(
    host: str,
    port: int,
    *,
    rate: float,
    device: str,
    page_port: int | None,
    scale: Path | None,
    poses: Path | None,
    robot: str | None,
    seconds: float | None,
    seed: int,
    faults: Sequence[str],
    as_json: bool,
) -> None:
    """Serves what an ATI sensor serves."""
    settings = RdtSensorSettings(
        host=host,
        port=port,
        page_port=page_port,
        device=_chosen(device, {d.value: d for d in RdtDevice}, "device"),
        rate=rate,
        seed=seed,
        faults=tuple(parse_fault(text, SENSOR_FAULTS) for text in faults),
    )
    if scale is not None:
        check_output(scale, [])
        write_atomic(scale, netftapi_page(settings))
        say(f"scale of the simulated sensor written to {scale}")
    scenario = online_scenario(seed, robot)
    if poses is not None:
        check_output(poses, [])
        write_atomic(poses, sensor_csv(_WRIST, scenario.at_rest(_WRIST, seed), SENSOR))
        say(f"six simulated readings at rest written to {poses}: robotrue dynamics sensor {poses}")

    async def serve(stop: asyncio.Event) -> Any:
        sensor = RdtSensor(settings, scenario)
        serving = asyncio.create_task(sensor.run(stop=stop))
        await asyncio.sleep(0)  # until its page is served, where there is one
        while page_port is not None and sensor.page_port is None and not serving.done():
            await asyncio.sleep(0.01)
        where = scale if scale is not None else "netftapi2.xml"
        if page_port is not None:
            where = f"http://{_reached(host)}:{sensor.page_port}/netftapi2.xml"
        _announce(
            f"ATI force sensor, udp {host}:{sensor.port}, {rate:g} records per second once asked",
            scenario,
            f"--force 'rdt://{_reached(host)}:{sensor.port}?scale={where}&rate={rate:g}Hz&device={device}'",
        )
        return await serving

    until_stopped("ATI force sensor", serve, seconds=seconds, as_json=as_json)


def _free_port() -> int:
    """A UDP port that nobody has here: who listens for the controller can have it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        trial.bind(("", 0))
        return int(trial.getsockname()[1])


def _announce(what: str, scenario: OnlineScenario, option: str) -> None:
    say(f"SIMULATED {what}; {scenario.robot.name}, cutter of seed {scenario.seed}.")
    say(
        f"simulated: {len(KNOCKS)} knocks from {KNOCKS[0]:g} s, a milling pass from {PASS[0]:g} to "
        f"{PASS[1]:g} s, then back; again every {CYCLE:g} s."
    )
    say(f"robotrue sense CELL ... {option}")
    say("Ctrl-C ends it.")


def until_stopped(
    what: str,
    run: Callable[[asyncio.Event], Awaitable[Any]],
    *,
    seconds: float | None,
    as_json: bool,
) -> None:
    """Runs until Ctrl-C, its own end or that of the time, then says what came of it."""
    if seconds is not None and not seconds > 0.0:
        raise ConfigurationError(f"{seconds:g} seconds, expected more than none.")
    begun = time.monotonic()
    # a controller's clock waits for nobody, and these sleep most of the time
    with prompt_answers(first=True):
        report = asyncio.run(_stoppable(run, seconds))
    took = time.monotonic() - begun
    found = {name: _shown(name, value) for name, value in asdict(report).items()}
    if as_json:
        emit_json({"simulated": what, "seconds": took, **found})
        return
    rows = [("ran", f"{took:.1f} s")]
    rows += [(_LABELS.get(name, name), _text(value)) for name, value in found.items()]
    emit_facts(f"SIMULATED {what}", rows)


async def _stoppable(run: Callable[[asyncio.Event], Awaitable[Any]], seconds: float | None) -> Any:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    if seconds is not None:
        loop.call_later(seconds, stop.set)

    def stopped(*_: object) -> None:
        loop.call_soon_threadsafe(stop.set)

    before = signal.signal(signal.SIGINT, stopped)
    try:
        return await run(stop)
    finally:
        signal.signal(signal.SIGINT, before)


def _chosen(text: str, known: Mapping[str, Any], what: str) -> Any:
    if text not in known:
        raise ConfigurationError(f"{what} {text!r}, expected {' or '.join(known)}.")
    return known[text]


def _reached(host: str) -> str:
    """The address under which a client on this computer reaches a server."""
    return "127.0.0.1" if host == "0.0.0.0" else host  # noqa: S104


def _shown(name: str, value: Any) -> Any:
    if name == "offset":
        value = np.asarray(value) / MM
    return value.tolist() if isinstance(value, np.ndarray) else value


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(f"{v:.4f}" for v in value)
    if isinstance(value, float):
        return f"{value:.4f}"
    return "no" if value in ("", None) else str(value)
