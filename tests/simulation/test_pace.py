"""Cycles that a simulator cut short, on a clock that the test moves."""

import asyncio
from types import SimpleNamespace

from robotrue.simulation import cyclic_controller
from robotrue.simulation.cyclic_controller import Pace


def test_the_pace_says_which_cycles_it_cut_short(monkeypatch):
    class Clock:
        now = 100.0

        def time(self):
            return self.now

        async def sleep(self, seconds):
            self.now += seconds

    clock = Clock()
    stands_in = SimpleNamespace(get_running_loop=lambda: clock, sleep=clock.sleep)
    monkeypatch.setattr(cyclic_controller, "asyncio", stands_in)

    async def paced():
        found = Pace(0.2)
        whole = await found.wait()
        clock.now += 0.3
        return whole, await found.wait()

    assert asyncio.run(paced()) == (False, True)
