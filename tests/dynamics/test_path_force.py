"""The force along a path, in the axes of the path and in base."""

import numpy as np
import pytest

from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.milling_force import MillingAlongPath, mean_force
from robotrue.errors import ConfigurationError
from robotrue.program.cut_path import CutPath
from robotrue.program.program import Motion

STEEL = CuttingCoefficients(tangential=8e8, radial=1.7e8, axial=2.2e8)
FLAT = EndMill(kind="flat", diameter=0.016, teeth=2)
CUT = CutterEngagement(mode="up", depth=1e-3, width=6e-3, feed_per_tooth=5e-5, spindle=60.0)


def model(**change):
    parts = {
        "cutter": FLAT,
        "coefficients": STEEL,
        "cut": CUT,
        "along": np.array([0.01, 0.05]),
        "depth": np.array([1e-3, 2e-3]),
        "width": np.array([6e-3, 6e-3]),
    }
    return MillingAlongPath(**(parts | change))


def path(direction):
    """Four targets straight along a direction, tool down, the first by a joint move."""
    n = 4
    pose = np.tile(np.eye(4), (n, 1, 1))
    return CutPath(
        T_base_tool=pose,
        tool_axis=np.tile([0.0, 0.0, 1.0], (n, 1)),
        feed_direction=np.vstack([np.full(3, np.nan), np.tile(direction, (n - 1, 1))]),
        feeding=np.array([False, True, True, True]),
        feed=np.array([np.inf, np.nan, 0.006, 0.006]),
        along=np.array([0.0, 0.005, 0.03, 0.05]),
        motion=np.array([Motion.PTP, *[Motion.LIN] * 3]),
        line=np.arange(1, n + 1),
    )


def test_engagement_between_rows_and_none_beyond():
    force = model().at(np.array([0.0, 0.01, 0.03, 0.05, 0.06]))
    assert not force[[0, 4]].any()
    deep = mean_force(FLAT, CutterEngagement(mode="up", depth=1.5e-3, width=6e-3,
                                             feed_per_tooth=5e-5, spindle=60.0), STEEL)  # fmt: skip
    np.testing.assert_allclose(force[1], mean_force(FLAT, CUT, STEEL))
    np.testing.assert_allclose(force[2], deep)


@pytest.mark.parametrize(
    ("direction", "turn"),
    [((1, 0, 0), np.eye(3)), ((0, 1, 0), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])],
)
def test_base_axes_turn_with_the_feed(direction, turn):
    wrench = model().wrench(path(np.array(direction, dtype=float)))
    assert not wrench[:2].any()
    np.testing.assert_allclose(wrench[3, :3], np.array(turn) @ (2 * mean_force(FLAT, CUT, STEEL)))
    assert not wrench[:, 3:].any()


def test_refused():
    with pytest.raises(ConfigurationError, match="have to rise"):
        model(along=np.array([0.05, 0.01]))
    with pytest.raises(ConfigurationError, match="depth is -1 mm at 10 mm"):
        model(depth=np.array([-1e-3, 1e-3]))
