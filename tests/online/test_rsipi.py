"""RSIPI's echo server, a controller by another project, answered by our link over a socket."""

import asyncio
import json
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from rsi_samples import write_rsi_config

from robotrue.core.units import MM
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.online.rsi_link import RsiSettings, RsiSource

pytestmark = [
    pytest.mark.peer,
    # not imported here: it makes a folder of logs wherever it is
    pytest.mark.skipif(find_spec("RSIPI") is None, reason="pip install RSIPI"),
]

SHIFT = np.array([0.05, -0.1, 0.2]) * MM
CYCLES = 150


async def _answered(folder, mode, guard):
    """What the server says at its end, the flags of its samples, our health."""
    config = usual_rsi_config("127.0.0.1", 1, hold=mode is CorrectionMode.ABSOLUTE)
    source = RsiSource(
        RsiSettings(
            name="rsi://rsipi", config=config, cycle_ms=4, mode=mode, host="127.0.0.1", port=0
        ),
        guard,
    )
    path = folder / "RSI_EthernetConfig.xml"
    path.write_bytes(
        write_rsi_config(usual_rsi_config(*source.address, hold=config.receive[0].hold))
    )
    robot = await asyncio.create_subprocess_exec(
        sys.executable,
        str(Path(__file__).with_name("rsipi_robot.py")),
        str(path),
        mode.value,
        str(CYCLES),
        cwd=folder,
        stdout=asyncio.subprocess.PIPE,
    )
    wanted = Correction(shift=SHIFT, turn=np.zeros(3), mode=CorrectionMode.ABSOLUTE)
    reach = []

    async def read():
        async for block in source.blocks():
            guard.want(wanted, time.monotonic())
            reach.append(block)

    reader = asyncio.create_task(read())
    try:
        out, _ = await asyncio.wait_for(robot.communicate(), 60.0)
    finally:
        if robot.returncode is None:
            robot.kill()
        health = source.health()
        await source.close()
        await reader
    return json.loads(out.splitlines()[-1]), reach, health


@pytest.mark.parametrize("mode", list(CorrectionMode))
def test_the_echo_server_takes_our_answers_and_moves_by_them(tmp_path, mode):
    limits = CorrectionLimits(
        shift=0.5 * MM, shift_rate=5.0 * MM, cycle=4e-3, timeout=5.0, ramp=0.1, late_answers=1000
    )
    guard = CorrectionGuard(limits, mode)
    result, blocks, health = asyncio.run(_answered(tmp_path, mode, guard))
    assert result["taken"] == CYCLES
    assert health.received >= CYCLES
    assert health.refused == 0
    assert 0.0 < health.turnaround_p50 < 1.0
    # it prints hundredths of a millimetre; a machine at its limits may lose an answer
    lost = result["faulty"] * limits.shift_rate * limits.cycle / MM
    pose = [result["pose"][axis] for axis in "XYZ"]
    np.testing.assert_allclose(pose, guard.state().held.shift / MM, atol=1e-4 + lost)
    seen = blocks[-1].T_frame_tool[-1, :3, 3]
    np.testing.assert_allclose(seen, guard.state().held.shift, atol=(0.031 + lost) * MM)
    if not guard.trips:  # a machine that sleeps for long is a fault
        np.testing.assert_allclose(pose, SHIFT / MM, atol=1e-4 + lost)
