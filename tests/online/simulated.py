"""Simulators and sources together on loopback, within one event loop and a time limit."""

import asyncio
from contextlib import asynccontextmanager
from functools import cache

from robotrue.online.rdt_link import RdtSettings, RdtSource
from robotrue.online.rtde_link import RtdeSettings
from robotrue.simulation.online_faults import FAULTS as CONTROLLER_FAULTS
from robotrue.simulation.online_faults import parse_fault
from robotrue.simulation.online_scenario import online_scenario
from robotrue.simulation.rdt_sensor import FAULTS as SENSOR_FAULTS
from robotrue.simulation.rdt_sensor import RdtSensor, RdtSensorSettings
from robotrue.simulation.rtde_controller import RtdeController, RtdeControllerSettings

LIMIT = 120.0
"""s; only a test that hangs takes so long."""
_ATTEMPTS = 8
_ROWS = 600
"""Samples in which a fault shows, if the machine lets the simulator run while it lasts."""


def timed(work):
    """Runs a coroutine with the time limit of a test."""
    return asyncio.run(asyncio.wait_for(work, LIMIT))


@cache
def scenario():
    return online_scenario()


@asynccontextmanager
async def sensor(*faults, **settings):
    """A simulated sensor that runs; ends with the block."""
    stated = {"port": 0, "rate": 1000.0, **settings}
    found = RdtSensor(
        RdtSensorSettings(faults=tuple(parse_fault(f, SENSOR_FAULTS) for f in faults), **stated),
        scenario(),
    )
    stop = asyncio.Event()
    running = asyncio.create_task(found.run(stop=stop))
    try:
        yield found
    finally:
        stop.set()
        await running


@asynccontextmanager
async def controller(*faults, port=0, started=100.0):
    """A simulated UR controller that listens; ends with the block."""
    settings = RtdeControllerSettings(
        port=port,
        started=started,
        faults=tuple(parse_fault(f, CONTROLLER_FAULTS) for f in faults),
    )
    found = RtdeController(settings, scenario())
    stop = asyncio.Event()
    running = asyncio.create_task(found.run(stop=stop))
    await found.listening.wait()
    try:
        yield found
    finally:
        stop.set()
        await running


def rdt_source(port, **settings):
    stated = {"scale": RdtSensorSettings().scale, "rate": 1000.0, "silence": 0.3, **settings}
    return RdtSource(RdtSettings(name="rdt://test", host="127.0.0.1", port=port, **stated))


def rtde_settings(port, **settings):
    stated = {"rate": 500.0, "silence": 0.5, **settings}
    return RtdeSettings(name="rtde://test", host="127.0.0.1", port=port, **stated)


async def until(source, enough):
    """The blocks of a source until ``enough(blocks)``; it is closed then."""
    found = []
    async for block in source.blocks():
        found.append(block)
        if enough(found):
            break
    await source.close()
    return found


async def until_shown(simulator, source, enough):
    """The blocks until ``enough(blocks)``, what read them, and what sent them.

    A fault lasts a fraction of a second of real time. Where this computer is busy elsewhere in just
    that time it does not show; simulator and source then start again.

    Args:
        simulator: Makes the simulator with its fault.
        source: Makes the source for a port.
        enough: Of the blocks.
    """
    for _ in range(_ATTEMPTS):
        async with simulator() as there:
            reading = source(there.port)
            found = await until(reading, lambda blocks: enough(blocks) or rows(_ROWS)(blocks))
        if enough(found):
            return found, reading, there
    raise AssertionError(f"the fault has not shown in {_ATTEMPTS} runs of {_ROWS} samples")


def rows(count):
    """Enough once so many samples have come."""
    return lambda blocks: sum(map(len, blocks)) >= count


def flagged(flag, after=0):
    """Enough once a flag has come, and so many samples after it."""

    def enough(blocks):
        seen = 0
        for block in reversed(blocks):
            at = (block.flags & int(flag)).nonzero()[0]
            if len(at):
                return seen + len(block) - 1 - at[-1] >= after
            seen += len(block)
        return False

    return enough
