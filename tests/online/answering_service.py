"""A service that leads a robot by 0.2 mm through an answering process, until it is killed."""

import asyncio
import sys
import time

import numpy as np

from robotrue.core.units import MM
from robotrue.online.answering_link import AnsweringLink
from robotrue.online.answering_wire import RemoteGuard
from robotrue.online.guard import CorrectionLimits
from robotrue.online.robot_correction import Correction, CorrectionMode
from robotrue.online.rsi_config import usual_rsi_config
from robotrue.online.rsi_link import RsiSettings

ABSOLUTE = CorrectionMode.ABSOLUTE
LIMITS = CorrectionLimits(
    shift=0.5 * MM, shift_rate=5.0 * MM, cycle=4e-3, timeout=5.0, ramp=0.0, late_answers=100_000
)
WANTED = Correction(shift=np.array([0.2 * MM, 0.0, 0.0]), turn=np.zeros(3), mode=ABSOLUTE)


def settings(**changes):
    config = usual_rsi_config("127.0.0.1", 49152)
    given = {"name": "rsi://test", "config": config, "cycle_ms": 4, "host": "127.0.0.1", "port": 0}
    return RsiSettings(**(given | {"mode": ABSOLUTE} | changes))


async def lead():
    guard = RemoteGuard(LIMITS, ABSOLUTE)
    source = AnsweringLink(settings(), guard)
    sys.stdout.write(f"{source.address[1]}\n")
    sys.stdout.flush()
    async for _ in source.blocks():
        guard.want(WANTED, time.monotonic())


if __name__ == "__main__":
    sys.exit(asyncio.run(lead()))
