"""An ATI force sensor: sends counts over UDP on request."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app import simulated_service as service
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Option, Output, Request
from robotrue.core.provenance import Provenance
from robotrue.online.device_defaults import RDT_PORT
from robotrue.simulation.device_defaults import LOCAL_HOST, RATE_HZ

if TYPE_CHECKING:
    from robotrue.simulation.online_scenario import OnlineScenario
    from robotrue.simulation.rdt_sensor import RdtSensorSettings

SENSOR: Final = Provenance(simulated=True, instrument="force sensor")


class SimulateRdtRequest(Request):
    """Which sensor to simulate, and where it listens."""

    host: service.Host = LOCAL_HOST
    port: Annotated[int, Option(help="UDP port; 0 takes a free one.")] = RDT_PORT
    rate: Annotated[float, Option(help="Records per second.")] = RATE_HZ
    device: Annotated[str, Option(help="net or axia: their status words differ.")] = "net"
    page_port: Annotated[
        int | None, Option(help="Serves netftapi2.xml over HTTP there; 0 takes a free one.")
    ] = None
    scale: Annotated[
        Path | None,
        Output(what="XML", suffixes=(".xml",), help="Writes netftapi2.xml to this file."),
    ] = None
    poses: Annotated[
        Path | None,
        Output(
            what="a CSV table",
            suffixes=(".csv",),
            help="Writes readings at rest in six attitudes, for `dynamics sensor`.",
        ),
    ] = None
    robot: service.Robot = None
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


def run(request: SimulateRdtRequest, context: Context) -> PlainResult:
    """Serves what an ATI sensor serves, until Ctrl-C.

    Raises:
        ConfigurationError: A device or fault that does not exist, or a port that is taken.
    """
    from robotrue.core.files import write_atomic
    from robotrue.online.rdt import RdtDevice
    from robotrue.simulation.online_faults import parse_fault
    from robotrue.simulation.online_scenario import online_scenario
    from robotrue.simulation.rdt_sensor import (
        FAULTS,
        RdtSensor,
        RdtSensorSettings,
        netftapi_page,
    )

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
        scale = context.output(request.scale)
        write_atomic(scale, netftapi_page(settings))
        context.inform(f"scale of the simulated sensor written to {scale}")
    scenario = online_scenario(request.seed, request.robot)
    if request.poses is not None:
        poses = context.output(request.poses)
        _write_readings(poses, scenario, request.seed)
        context.inform(
            f"six simulated readings at rest written to {poses}: robotrue dynamics sensor {poses}"
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


def _write_readings(path: Path, scenario: OnlineScenario, seed: int) -> None:
    from robotrue.core.files import write_atomic
    from robotrue.dynamics.formats.dynamics_csv import sensor_csv
    from robotrue.simulation.online_scenario import WRIST_ATTITUDES

    readings = scenario.at_rest(WRIST_ATTITUDES, seed)
    write_atomic(path, sensor_csv(WRIST_ATTITUDES, readings, SENSOR))


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
        f"ATI force sensor, udp {settings.host}:{port}, {settings.rate:g} records per second "
        "once asked",
        scenario,
        f"--force 'rdt://{host}:{port}?{query}'",
        context,
    )


OPERATION: Final = Operation(request=SimulateRdtRequest, run=run, is_service=True)
