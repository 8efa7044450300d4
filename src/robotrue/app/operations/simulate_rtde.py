"""A Universal Robots controller: joints, tool point and force, 500 times a second."""

from __future__ import annotations

import asyncio
from typing import Annotated, Final

from robotrue.app import simulated_service as service
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Option, Request
from robotrue.online.device_defaults import RTDE_PORT
from robotrue.simulation.device_defaults import LOCAL_HOST


class SimulateRtdeRequest(Request):
    """Which controller to simulate, and where it listens."""

    host: service.Host = LOCAL_HOST
    port: Annotated[int, Option(help="TCP port; 0 takes a free one.")] = RTDE_PORT
    robot: service.Robot = "UR10"
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


def run(request: SimulateRtdeRequest, context: Context) -> PlainResult:
    """Serves what a Universal Robots controller serves, until Ctrl-C.

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


OPERATION: Final = Operation(request=SimulateRtdeRequest, run=run, is_service=True)
