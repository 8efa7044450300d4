"""A KUKA controller: sends a packet every cycle and judges each answer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app import simulated_service as service
from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.request import InputFile, Option, Request
from robotrue.online.device_defaults import RSI_CYCLE_MS, RSI_PORT
from robotrue.simulation.device_defaults import LOCAL_HOST


class SimulateRsiRequest(Request):
    """Which controller to simulate, and where it sends to."""

    host: service.Target = LOCAL_HOST
    port: Annotated[int | None, Option(help="UDP port that it sends to; 0 picks a free one.")] = (
        None
    )
    config: Annotated[
        Path | None, InputFile(help="EthernetConfig.xml; otherwise the usual one.")
    ] = None
    cycle_ms: Annotated[int, Option(help="4 (IPO_FAST) or 12 (IPO).")] = RSI_CYCLE_MS
    mode: Annotated[str, Option(help="Of corrections: absolute or relative.")] = "absolute"
    robot: service.Robot = None
    seconds: service.Seconds = None
    seed: service.Seed = 0
    fault: service.Faults = ()


def run(request: SimulateRsiRequest, context: Context) -> PlainResult:
    """Sends what a KUKA controller sends, until Ctrl-C.

    Raises:
        ConfigurationError: A mode, cycle or fault that does not exist, or a faulty config file.
    """
    import time
    from dataclasses import replace

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


OPERATION: Final = Operation(request=SimulateRsiRequest, run=run, is_service=True)
