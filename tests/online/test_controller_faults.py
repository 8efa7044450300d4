"""Faults of simulated controllers over real sockets: each is flagged at once by the link."""

import asyncio
import time

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Flag
from robotrue.online.egm import RobotWare
from robotrue.online.egm_link import EgmSettings, EgmSource
from robotrue.online.guard import CorrectionGuard, CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.online.rsi_link import RsiSettings, RsiSource
from robotrue.robot.presets import preset
from robotrue.simulation import egm_controller, rsi_controller
from robotrue.simulation.cyclic_controller import Jog
from robotrue.simulation.online_faults import FAULTS, Fault, FaultKind, FaultyWire, parse_fault

ABSOLUTE = CorrectionMode.ABSOLUTE
CYCLES = 80


def _jog():
    return Jog(robot=preset("kr160"), joints=np.array([0.0, 30.0, -30.0, 0.0, 60.0, 0.0]) * DEG)


def _source(scheme, corrector=None):
    given = {"name": scheme, "mode": ABSOLUTE, "host": "127.0.0.1", "port": 0}
    if scheme == "rsi":
        config = usual_rsi_config("127.0.0.1", 1)
        return RsiSource(
            RsiSettings(config=config, cycle_ms=4, trust_restart=True, **given), corrector
        )
    return EgmSource(EgmSettings(generation=RobotWare.SEVEN, **given), corrector)


def _run(scheme, source, faults, cycles=CYCLES):
    given = {"motion": _jog(), "cycles": cycles, "faults": faults}
    if scheme == "rsi":
        config = usual_rsi_config(*source.address)
        settings = rsi_controller.RsiControllerSettings(
            config=config, mode=ABSOLUTE, timeout_packets=10_000, **given
        )
        return rsi_controller.RsiController(settings).run()
    settings = egm_controller.EgmControllerSettings(
        target=source.address, generation=RobotWare.SEVEN, **given
    )
    return egm_controller.EgmController(settings).run()


@pytest.mark.parametrize("scheme", ["rsi", "egm"])
@pytest.mark.parametrize(
    ("kind", "flag"),
    [
        (FaultKind.GAP, Flag.GAP),
        (FaultKind.REPEAT, Flag.REPEATED),
        (FaultKind.REORDER, Flag.REORDERED),
        (FaultKind.NAN, Flag.NOT_FINITE),
        (FaultKind.JUMP, Flag.CLOCK_JUMP),
        (FaultKind.GARBLE, Flag.GAP),
        (FaultKind.LATE, Flag.LATE),
    ],
)
def test_each_fault_is_flagged(scheme, kind, flag):
    fault = Fault(kind=kind, start=0.1, duration=0.04)

    async def session():
        source = _source(scheme)
        report = await asyncio.wait_for(_run(scheme, source, (fault,)), 30.0)
        await source.close()
        return source.health(), [block async for block in source.blocks()], report

    health, blocks, report = asyncio.run(session())
    flags = np.concatenate([b.flags for b in blocks])
    assert (flags & int(flag)).any()
    sound = flags & int(Flag.INVALID | Flag.GAP) == 0
    assert sound[:20].all(), "before the fault"
    assert sound[-20:].all(), "after it"
    assert np.isfinite(np.concatenate([b.joints for b in blocks])[sound]).all()
    assert report.cycles == CYCLES
    refused = health.refused
    assert refused == (10 if kind is FaultKind.GARBLE else 0)


@pytest.mark.parametrize("scheme", ["rsi", "egm"])
def test_a_controller_that_falls_silent_comes_back_without_a_correction(scheme):
    limits = CorrectionLimits(
        shift=1 * MM, shift_rate=20 * MM, cycle=4e-3, timeout=5.0, ramp=0.0, late_answers=10_000
    )
    guard = CorrectionGuard(limits, ABSOLUTE)
    fault = Fault(kind=FaultKind.SILENCE, start=0.25, duration=0.25)
    wanted = Correction(shift=np.array([0.1, 0.0, 0.0]) * MM, turn=np.zeros(3), mode=ABSOLUTE)

    async def session():
        source = _source(scheme, guard)
        robot = asyncio.create_task(_run(scheme, source, (fault,), 200))

        async def read():
            async for _ in source.blocks():
                guard.want(wanted, time.monotonic())

        reader = asyncio.create_task(read())
        report = await asyncio.wait_for(robot, 30.0)
        health = source.health()
        await source.close()
        await reader
        return report, health

    report, health = asyncio.run(session())
    # a machine that sleeps for long adds silences of its own
    assert health.reconnects >= 1
    assert guard.trips == 1
    assert 0.0 < report.largest_mm < 0.1 + 1e-6
    held = report.correction[:3] if scheme == "rsi" else report.offset / MM
    np.testing.assert_allclose(held, 0.0, atol=1e-3)


def test_faults_end_and_what_was_held_back_follows():
    wire = FaultyWire([Fault(kind=FaultKind.LATE, start=1.0, duration=1.0)])
    assert wire.transmit([b"a"], 0.5) == [b"a"]
    assert wire.transmit([b"b"], 1.0) == []
    assert wire.transmit([b"c"], 1.5) == []
    assert wire.transmit([b"d"], 2.0) == [b"b", b"c", b"d"]
    with pytest.raises(ConfigurationError, match="expected KIND@START_S"):
        parse_fault("hang@1", FAULTS)
