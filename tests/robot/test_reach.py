"""How far the wrist gets: what the makers print of their arms."""

from __future__ import annotations

import pytest

from robotrue.robot.forward import wrist_reach
from robotrue.robot.presets import preset


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("KUKA KR160 R1570", 1.573),
        ("KUKA KR300 R2500", 2.496),
        ("ABB IRB 6660-205/1.9", 1.93),
        ("ABB IRB 120-3/0.6", 0.58),
        ("Yaskawa GP225", 2.702),
        ("KUKA LBR iiwa 14 R820", 0.82),
    ],
)
def test_the_reach_is_that_of_the_data_sheet(name: str, printed: float) -> None:
    assert wrist_reach(preset(name)) == pytest.approx(printed, rel=3e-3)
    assert wrist_reach(preset(name)) < preset(name).reach
