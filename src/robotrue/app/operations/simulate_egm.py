"""An ABB controller: sends a message every 4 ms and takes path corrections."""

from __future__ import annotations

from typing import Annotated, Final

from robotrue.app import simulated_service as service
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import Option, Request
from robotrue.online.device_defaults import EGM_PORT
from robotrue.simulation.device_defaults import LOCAL_HOST


class SimulateEgmRequest(Request):
    """Which controller to simulate, and where it sends to."""

    host: service.Target = LOCAL_HOST
    port: Annotated[int, Option(help="UDP port that it sends to; 0 picks a free one.")] = EGM_PORT
    robotware: Annotated[int, Option(help="6 or 7: their messages differ.")] = 7
    no_force: Annotated[bool, Option(help="Sends no measured force.")] = False
    robot: service.Robot = None
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


def run(request: SimulateEgmRequest, context: Context) -> PlainResult:
    """Sends what an ABB controller sends, until Ctrl-C.

    Raises:
        ConfigurationError: A RobotWare or fault that does not exist.
    """
    import time

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


OPERATION: Final = Operation(request=SimulateEgmRequest, run=run, is_service=True)
