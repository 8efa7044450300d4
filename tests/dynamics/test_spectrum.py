"""Lines of a force record are those of spindle and teeth."""

import numpy as np
import pytest

from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.force import ForceRecord, spindle_lines
from robotrue.dynamics.milling_force import force_over_time
from robotrue.errors import ConfigurationError

STEEL = CuttingCoefficients(tangential=8e8, radial=1.7e8, axial=2.2e8)
CUT = CutterEngagement(mode="up", depth=1e-3, width=6e-3, feed_per_tooth=5e-5, spindle=60.0)


def cutting(runout):
    cutter = EndMill(kind="flat", diameter=0.016, teeth=3, helix=0.5, runout=runout)
    return force_over_time(cutter, CUT, STEEL, rate=18000.0, duration=2.0)


def test_a_plain_cosine_is_one_line():
    t = np.arange(4000) / 4000.0
    force = np.zeros((4000, 3))
    force[:, 1] = 7.0 + 3.0 * np.cos(2 * np.pi * 120.0 * t + 0.4)
    record = ForceRecord(start=0.0, rate=4000.0, force=force, source="cosine")
    found = spindle_lines(record, spindle=60.0, teeth=2)
    assert found.mean[1] == pytest.approx(7.0)
    assert found.amplitude[1, 1] == pytest.approx(3.0 * np.exp(0.4j))
    assert np.abs(np.delete(found.amplitude[:, 1], 1)).max() < 1e-9
    assert found.tooth_share == pytest.approx(1.0)


def test_runout_moves_power_off_the_tooth_lines():
    even = spindle_lines(cutting(0.0), spindle=60.0, teeth=3)
    assert even.tooth_share == pytest.approx(1.0, abs=1e-3)
    assert even.runout_share < 1e-9
    odd = spindle_lines(cutting(8e-6), spindle=60.0, teeth=3)
    assert odd.runout_share > 0.02
    assert odd.tooth_share + odd.runout_share == pytest.approx(1.0, abs=1e-3)
    assert odd.frequency[odd.is_tooth][:2] == pytest.approx([180.0, 360.0])


def test_a_record_too_short():
    with pytest.raises(ConfigurationError, match="1 turns of"):
        spindle_lines(cutting(0.0), spindle=0.6, teeth=3)
