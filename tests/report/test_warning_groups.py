"""Warnings of one cure become one line that says what they cost."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robotrue.calibration.methods import fit
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.report.warning_groups import (
    PREFIX,
    count_warnings,
    group_unseen,
    group_warnings,
    region_costs,
    without_unseen,
)
from robotrue.report.words import ReportTexts
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset


@pytest.fixture(scope="module")
def model():
    """A UR5 that 30 poses of a small region saw."""
    rng = np.random.default_rng(3)
    robot = preset("UR5").with_tool(pose(np.eye(3), np.array([0.05, 0.0, 0.1])))
    joints = rng.uniform(-0.3, 0.3, (30, 6)) + np.array([0.2, -1.3, 1.4, 0.4, 1.2, 0.0])
    points = forward(robot, joints)[:, :3, 3] + 2e-5 * rng.normal(size=(30, 3))
    covariance = np.broadcast_to(4e-10 * np.eye(3), (30, 3, 3))
    rows = MeasurementSet(joints=joints, position=points, covariance=covariance)
    return fit(robot, rows, method="elastic")


def test_each_cure_is_one_line_and_no_other_warning_is_lost(model):
    warnings = model.training_summary().warnings
    lines = group_warnings(model, [*warnings, "something else."])
    grouped = [line for line in lines if line.startswith(PREFIX)]
    cures = {u.cure for u in model.training_summary().unseen if not u.harmless}
    assert len(grouped) == len(cures) < len(warnings)
    assert lines[-1] == "something else."
    assert without_unseen(model, [*warnings, "something else."]) == ("something else.",)
    assert len(group_unseen(model)) < len(model.training_summary().unseen)


def test_a_reader_sees_counts_and_asks_for_names(model):
    """Parameters are named apart from the sentence; the rest of it stays."""
    warnings = model.training_summary().warnings
    counted = count_warnings(model, [*warnings, "something else."])
    lines = group_warnings(model, [*warnings, "something else."])
    assert counted[-1] == ("something else.", [])
    named = [(text, names) for text, names in counted if names]
    assert len(named) == len([line for line in lines if line.startswith(PREFIX)])
    for (text, names), line in zip(counted, lines, strict=True):
        assert (
            text.partition(": ")[2].partition(": ")[2] == line.partition(": ")[2].partition(": ")[2]
        )
        assert not any(name in text.partition(" parameters")[0] for name in names)
    for text, names in named:
        several = "" if len(names) == 1 else "s"
        assert text.startswith(f"{PREFIX}{len(names)} combination{several} of parameters")
        chinese = ReportTexts(lang="zh").sentence(text)
        assert chinese.startswith(f"数据未能确定：{len(names)} 个参数组合")


def test_the_cost_is_that_of_the_covariance_it_comes_from(model):
    """One parameter that only the prior holds adds its posterior sd times its lever."""
    harmful = [u for u in model.training_summary().unseen if not u.harmless]
    line = next(x for x in group_warnings(model, model.training_summary().warnings) if PREFIX in x)
    stated = float(re.search(r"adds ([\d.]+) mm", line)[1]) * MM
    first = [u.terms for u in harmful if u.cure == harmful[0].cure]
    whole = region_costs(model, [first])[0]
    assert whole == pytest.approx(stated, abs=1e-6)
    assert region_costs(model, [first[:1]])[0] <= whole * (1.0 + 1e-9)
    assert 0.0 < whole < 0.1 * MM
    assert region_costs(model, [[{"no such": 1.0}]])[0] is None
