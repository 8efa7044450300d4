"""Simulated controllers and a force sensor for ``sense``, until Ctrl-C."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import simulated_service as service
from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import PlainResult
from robotrue.app.request import InputFile, Output, Request
from robotrue.core.provenance import Provenance
from robotrue.online.device_defaults import EGM_PORT, RDT_PORT, RSI_CYCLE_MS, RSI_PORT, RTDE_PORT
from robotrue.simulation.device_defaults import LOCAL_HOST, RATE_HZ

if TYPE_CHECKING:
    from robotrue.simulation.online_scenario import OnlineScenario
    from robotrue.simulation.rdt_sensor import RdtSensorSettings


class SimulateRsiRequest(Request):
    """Simulated KUKA controller, and the address it sends to."""

    host: service.Target = LOCAL_HOST
    port: int | None = None
    """Destination UDP port; 0 picks a free one."""
    config: Annotated[Path | None, InputFile()] = None
    """EthernetConfig.xml; default: the usual one."""
    cycle_ms: int = RSI_CYCLE_MS
    """Cycle, 4 (IPO_FAST) or 12 (IPO)."""
    mode: str = "absolute"
    """Mode of corrections: absolute or relative."""
    robot: service.Robot = None
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


@operation("simulate_rsi", is_service=True)
def simulate_rsi(request: SimulateRsiRequest, context: Context) -> PlainResult:
    """Simulated KUKA controller: sends a packet every cycle and checks each answer.

    Raises:
        ConfigurationError: A mode, cycle or fault that does not exist, or a faulty config file.
    """
    from robotrue.online.robot_correction import CorrectionMode
    from robotrue.online.rsi_config import read_rsi_config, usual_rsi_config
    from robotrue.simulation import rsi_controller
    from robotrue.simulation.online_scenario import ScenarioMotion, online_scenario

    mode = service.choose(request.mode, {each.value: each for each in CorrectionMode}, "mode")
    config = usual_rsi_config(request.host, RSI_PORT, hold=mode is CorrectionMode.ABSOLUTE)
    if request.config is not None:
        config = replace(read_rsi_config(request.config), host=request.host)
    if request.port is not None:
        config = replace(config, port=request.port or service.free_port())
    scenario = online_scenario(request.seed, request.robot)
    settings = rsi_controller.RsiControllerSettings(
        config=config,
        mode=mode,
        cycle_ms=request.cycle_ms,
        motion=ScenarioMotion(scenario=scenario, begun=time.monotonic()),
        faults=service.controller_faults(request.fault),
        keeps_time=True,
    )
    query = f"?cycle={request.cycle_ms}ms&mode={mode.value}"
    query += f"&config={request.config}" if request.config is not None else ""
    address = f"{config.host}:{config.port}"
    service.announce(
        f"KUKA controller, sends to udp {address} every {request.cycle_ms} ms",
        scenario,
        f"--robot 'rsi://{address}{query}'",
        context,
    )
    return service.run_until_stopped(
        "KUKA controller",
        lambda stop: rsi_controller.RsiController(settings).run(stop=stop),
        seconds=request.seconds,
    )


class SimulateEgmRequest(Request):
    """Simulated ABB controller, and the address it sends to."""

    host: service.Target = LOCAL_HOST
    port: int = EGM_PORT
    """Destination UDP port; 0 picks a free one."""
    robotware: int = 7
    """RobotWare version, 6 or 7; the messages differ."""
    no_force: bool = False
    """Send no measured force."""
    robot: service.Robot = None
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


@operation("simulate_egm", is_service=True)
def simulate_egm(request: SimulateEgmRequest, context: Context) -> PlainResult:
    """Simulated ABB controller: sends a message every 4 ms and takes path corrections.

    Raises:
        ConfigurationError: A RobotWare or fault that does not exist.
    """
    import numpy as np

    from robotrue.online.egm import RobotWare
    from robotrue.simulation import egm_controller
    from robotrue.simulation.online_scenario import ScenarioMotion, online_scenario

    generations = {"6": RobotWare.SIX, "7": RobotWare.SEVEN}
    generation = service.choose(str(request.robotware), generations, "robotware")
    scenario = online_scenario(request.seed, request.robot)
    begun = time.monotonic()
    port = request.port or service.free_port()

    def measure_force(elapsed: float) -> tuple[float, ...]:
        return tuple(scenario.sensor_wrench(np.array([begun + elapsed]))[0].tolist())

    settings = egm_controller.EgmControllerSettings(
        target=(request.host, port),
        generation=generation,
        motion=ScenarioMotion(scenario=scenario, begun=begun),
        force=None if request.no_force else measure_force,
        faults=service.controller_faults(request.fault),
        keeps_time=True,
    )
    address = f"'egm://{request.host}:{port}?robotware={request.robotware}'"
    service.announce(
        f"ABB controller with RobotWare {request.robotware}, sends to udp {request.host}:{port} "
        "every 4 ms",
        scenario,
        f"--robot {address}" + ("" if request.no_force else f" --force {address}"),
        context,
    )
    return service.run_until_stopped(
        "ABB controller",
        lambda stop: egm_controller.EgmController(settings).run(stop=stop),
        seconds=request.seconds,
    )


class SimulateRtdeRequest(Request):
    """Simulated UR controller, and the address it listens on."""

    host: service.Host = LOCAL_HOST
    port: int = RTDE_PORT
    """TCP port; 0 picks a free one."""
    robot: service.Robot = "UR10"
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


@operation("simulate_rtde", is_service=True)
def simulate_rtde(request: SimulateRtdeRequest, context: Context) -> PlainResult:
    """Simulated Universal Robots controller: joints, tool point and force, 500 times a second.

    Raises:
        ConfigurationError: A robot or fault that does not exist, or a port that is taken.
    """
    from robotrue.simulation.online_scenario import online_scenario
    from robotrue.simulation.rtde_controller import RtdeController, RtdeControllerSettings

    host = request.host
    scenario = online_scenario(request.seed, request.robot)
    settings = RtdeControllerSettings(
        host=host,
        port=request.port,
        seed=request.seed,
        faults=service.controller_faults(request.fault),
    )

    async def serve(stop: asyncio.Event) -> object:
        controller = RtdeController(settings, scenario)
        serving = asyncio.create_task(controller.run(stop=stop))
        listening = asyncio.create_task(controller.listening.wait())
        await asyncio.wait((serving, listening), return_when=asyncio.FIRST_COMPLETED)
        listening.cancel()
        if not serving.done():
            service.announce(
                f"Universal Robots controller, tcp {host}:{controller.port}",
                scenario,
                f"--robot 'rtde://{service.reachable_host(host)}:{controller.port}?rate=500Hz'",
                context,
            )
        return await serving

    return service.run_until_stopped("Universal Robots controller", serve, seconds=request.seconds)


SENSOR: Final = Provenance(simulated=True, instrument="force sensor")


class SimulateRdtRequest(Request):
    """Simulated force sensor, and the address it listens on."""

    host: service.Host = LOCAL_HOST
    port: int = RDT_PORT
    """UDP port; 0 picks a free one."""
    rate: float = RATE_HZ
    """Records per second."""
    device: str = "net"
    """Device, net or axia; the status words differ."""
    page_port: int | None = None
    """Port that serves netftapi2.xml over HTTP; 0 picks a free one."""
    scale: Annotated[Path | None, Output(what="XML", suffixes=(".xml",))] = None
    """Write netftapi2.xml to this file."""
    poses: Annotated[Path | None, Output(what="a CSV table", suffixes=(".csv",))] = None
    """Write readings at rest in six attitudes, for `dynamics sensor`."""
    robot: service.Robot = None
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


@operation("simulate_rdt", is_service=True)
def simulate_rdt(request: SimulateRdtRequest, context: Context) -> PlainResult:
    """Simulated ATI force sensor: sends counts over UDP on request.

    Raises:
        ConfigurationError: A device or fault that does not exist, or a port that is taken.
    """
    from robotrue.online.rdt import RdtDevice
    from robotrue.simulation.online_faults import parse_fault
    from robotrue.simulation.online_scenario import online_scenario
    from robotrue.simulation.rdt_sensor import FAULTS, RdtSensor, RdtSensorSettings, netftapi_page

    settings = RdtSensorSettings(
        host=request.host,
        port=request.port,
        page_port=request.page_port,
        device=service.choose(request.device, {each.value: each for each in RdtDevice}, "device"),
        rate=request.rate,
        seed=request.seed,
        faults=tuple(parse_fault(text, FAULTS) for text in request.fault),
    )
    if request.scale is not None:
        context.write(request.scale, netftapi_page(settings), "scale of the simulated sensor")
    scenario = online_scenario(request.seed, request.robot)
    if request.poses is not None:
        context.write(
            request.poses,
            _rest_readings(scenario, request.seed),
            "six simulated readings at rest",
            f": robotrue dynamics sensor {request.poses}",
        )

    async def serve(stop: asyncio.Event) -> object:
        sensor = RdtSensor(settings, scenario)
        serving = asyncio.create_task(sensor.run(stop=stop))
        await asyncio.sleep(0)  # until its page is served, where there is one
        while request.page_port is not None and sensor.page_port is None and not serving.done():
            await asyncio.sleep(0.01)
        _announce_sensor(sensor.port, sensor.page_port, request, settings, scenario, context)
        return await serving

    return service.run_until_stopped("ATI force sensor", serve, seconds=request.seconds)


def _rest_readings(scenario: OnlineScenario, seed: int) -> bytes:
    from robotrue.dynamics.formats.dynamics_csv import sensor_csv
    from robotrue.simulation.online_scenario import WRIST_ATTITUDES

    readings = scenario.at_rest(WRIST_ATTITUDES, seed)
    return sensor_csv(WRIST_ATTITUDES, readings, SENSOR)


def _announce_sensor(
    port: int,
    page_port: int | None,
    request: SimulateRdtRequest,
    settings: RdtSensorSettings,
    scenario: OnlineScenario,
    context: Context,
) -> None:
    """Reports where the sensor listens and where its scale is."""
    host = service.reachable_host(settings.host)
    scale = request.scale if request.scale is not None else "netftapi2.xml"
    if request.page_port is not None:
        scale = f"http://{host}:{page_port}/netftapi2.xml"
    query = f"scale={scale}&rate={settings.rate:g}Hz&device={request.device}"
    service.announce(
        f"ATI force sensor, udp {settings.host}:{port}, {settings.rate:g} records per second on "
        "request",
        scenario,
        f"--force 'rdt://{host}:{port}?{query}'",
        context,
    )
