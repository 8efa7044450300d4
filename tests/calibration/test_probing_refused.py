"""The estimate from touches: wrong touches and bad input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from probing_cases import EXACT, SETTINGS, cell, frame_error, of, spoilt, touched

from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import (
    ProbingSettings,
    estimate_probing,
)
from robotrue.core.units import MM
from robotrue.errors import (
    ConfigurationError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
    RobotrueError,
)
from robotrue.measurement.probing_set import ProbingSet
from robotrue_reproductions.feng2018.machining_cell import (
    T_BASE_DRAWN,
    CellSizes,
    feng_cell,
    touch,
)

# Wrong touches


def test_wrong_touches_are_named_and_cost_nothing() -> None:
    where = cell(7)
    touches = touched(where, 10)
    clean = estimate_probing(NominalModel(robot=where.nominal), touches, SETTINGS)
    wrong = [3, 11, 12, 25]
    for by in (2.0 * MM, 15.0 * MM):
        found = estimate_probing(
            NominalModel(robot=where.nominal), spoilt(touches, wrong, by), SETTINGS
        )
        assert found.outliers == ("p4", "p12", "p13", "p26")
        assert found.believed.sum() == 26
        apart = frame_error(found.T_base_part[0], clean.T_base_part[0])
        assert np.linalg.norm(apart[:3]) < 0.3 * MM
        assert (found.distances[wrong] > 0.8 * by).all()
    assert not clean.outliers


def test_good_touches_of_a_poor_arm_are_kept() -> None:
    where = feng_cell(8, CellSizes(arm=3.0))
    found = estimate_probing(NominalModel(robot=where.nominal), touched(where, 10), SETTINGS)
    assert len(found.outliers) <= 1


def test_swapped_names_among_many_are_named() -> None:
    where = cell(7)
    touches = touched(where, 5)
    point = touches.point.copy()
    point[[2, 8]] = point[[8, 2]]
    found = estimate_probing(
        NominalModel(robot=where.nominal), replace(touches, point=point), SETTINGS
    )
    assert found.outliers == ("p3", "p9")


@pytest.mark.parametrize("count", [1, 2])
def test_swapped_names_among_few_are_refused(count: int) -> None:
    where = cell(7)
    touches = touched(where, count).subset(np.arange(3 * count)[: 3 if count == 1 else 4])
    point = touches.point.copy()
    point[[0, 2]] = point[[2, 0]]
    with pytest.raises(ImplausibleDataError):
        estimate_probing(NominalModel(robot=where.nominal), replace(touches, point=point), SETTINGS)


def test_touches_that_mostly_disagree_are_refused() -> None:
    where = cell(7)
    with pytest.raises(ImplausibleDataError, match=r"of part 0 disagree.*p1"):
        estimate_probing(
            NominalModel(robot=where.nominal),
            spoilt(touched(where, 3), [0, 2, 4, 6, 8], 9.0 * MM),
            SETTINGS,
        )


# Bad input


def test_points_that_fix_no_frame_are_refused() -> None:
    where = feng_cell(5, EXACT)
    rng = np.random.default_rng(0)
    line = np.linspace(0.1, 0.9, 6)[:, None] * np.array([0.4, 0.0, 0.3])
    with pytest.raises(ObservabilityError, match=r"p1, .* lie on one line of the part"):
        estimate_probing(
            NominalModel(robot=where.nominal), of(line, touch(where, line, "R", rng)), SETTINGS
        )
    same = np.tile([0.1, 0.0, 0.2], (5, 1))
    with pytest.raises(ObservabilityError, match="at 1 different places"):
        estimate_probing(
            NominalModel(robot=where.nominal), of(same, touch(where, same, "R", rng)), SETTINGS
        )
    with pytest.raises(ObservabilityError, match="p1, p2 are at 2 different places"):
        estimate_probing(
            NominalModel(robot=where.nominal), touched(where, 1).subset([0, 1]), SETTINGS
        )


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        (lambda t: replace(t, point=1e3 * t.point), ImplausibleDataError, r"span .* mm and the"),
        (lambda t: replace(t, point=t.point * [1, -1, 1]), ImplausibleDataError, "mirror image"),
        (lambda t: replace(t, joints=t.joints * [1, 1, -1, 1, 1, 1]), ImplausibleDataError, "."),
        (
            lambda t: replace(t, joints=t.joints[:, :5]),
            ModelMismatchError,
            "touches have 5 joints, the robot has 6",
        ),
        (
            lambda t: ProbingSet(names=t.names, point=t.point, position=t.point),
            ObservabilityError,
            "without the robot's joints",
        ),
        (lambda t: t.subset([]), ObservabilityError, "0 touches"),
        (lambda t: replace(t, part=np.full(12, -1)), ConfigurationError, "part number -1"),
    ],
)
def test_what_cannot_be_is_refused(
    changed: Callable[[ProbingSet], ProbingSet], error: type[RobotrueError], words: str
) -> None:
    where = cell(5)
    touches = changed(touched(where, 4))
    with pytest.raises(error, match=words):
        estimate_probing(NominalModel(robot=where.nominal), touches, SETTINGS)


@pytest.mark.parametrize("wrong", [{"touch_sigma": 0.1}, {"touch_sigma": 0.0}, {"tool_sigma": 0.3}])
def test_settings_refuse_millimetres_and_touches_without_noise(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigurationError, match=f"{next(iter(wrong))} .* mm, allowed"):
        ProbingSettings(**wrong)


def test_noise_above_what_was_stated_is_learned_and_said() -> None:
    where = feng_cell(5, CellSizes(touch=0.3 * MM))
    found = estimate_probing(NominalModel(robot=where.nominal), touched(where, 12), SETTINGS)
    assert len(found.outliers) <= 2
    assert 0.2 * MM < found.sigma < 0.4 * MM
    assert any("times the stated" in doubt for doubt in found.summary["doubts"])
    quiet = estimate_probing(NominalModel(robot=cell(5).nominal), touched(cell(5), 12), SETTINGS)
    assert not any("times the stated" in doubt for doubt in quiet.summary["doubts"])


def test_drawn_start_is_used_where_it_is_given() -> None:
    where = feng_cell(5, EXACT)
    settings = replace(SETTINGS, start={0: T_BASE_DRAWN})
    found = estimate_probing(NominalModel(robot=where.nominal), touched(where, 4), settings)
    np.testing.assert_allclose(found.T_base_part[0], where.T_base_part, atol=2e-8)
