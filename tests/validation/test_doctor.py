"""The data doctor names what is wrong with measured rows, and nothing in clean ones."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.calibration.methods import fit
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.presets import preset
from robotrue.validation.doctor import (
    SIX_WORDS,
    cure_rows,
    describe_diagnosis,
    diagnose,
    diagnosis_document,
    with_cure,
)
from robotrue.validation.evaluation import evaluate

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from data_doctor import SETS, draw, scale, write_section

PAGE = Path(__file__).parents[2] / "docs/howto/find-wrong-measurements.md"

ROBOT = preset("kr160").with_tool(pose(np.eye(3), np.array([0.05, 0.02, 0.1])))
TURN = matrix_from_rotation_vector(np.array([0.3, -0.5, 1.0]))
COUNT = 45


@pytest.fixture(scope="module")
def clean() -> MeasurementSet:
    """Simulated: geometric errors, noise of 15 um per axis, a tracker frame."""
    rng = np.random.default_rng(5)
    low, high = np.clip(ROBOT.limits, -1.6, 1.6).T
    joints = (low + high) / 2.0 + 0.35 * (high - low) * rng.uniform(-1.0, 1.0, (COUNT, 6))
    errors = np.zeros(len(ROBOT.errors))
    for group, sd in (("theta", 5e-4), ("d", 3e-4), ("a", 3e-4)):
        errors[parameter_slice(6, group)] = sd * rng.normal(size=6)
    points = forward(ROBOT.with_errors(errors), joints)[:, :3, 3] @ TURN.T + [1.0, -2.0, 0.5]
    return MeasurementSet(
        joints=joints,
        position=points + 1.5e-5 * rng.normal(size=points.shape),
        covariance=np.broadcast_to(1.5e-5**2 * np.eye(3), (COUNT, 3, 3)),
        frame="tracker",
        source_row=np.arange(2, COUNT + 2),
    )


def late(first: int) -> np.ndarray:
    return (np.arange(COUNT) >= first)[:, None]


def bump(rows: MeasurementSet) -> MeasurementSet:
    return replace(rows, position=rows.position + late(25) * [0.0, 3e-4, 2e-4])


def reflector(rows: MeasurementSet) -> MeasurementSet:
    flange = TURN @ forward(ROBOT, rows.joints)[:, :3, :3]
    return replace(rows, position=rows.position + late(30) * (flange @ [1e-3, 0.0, 5e-4]))


def inches(rows: MeasurementSet) -> MeasurementSet:
    return replace(rows, position=np.where(late(33), rows.position / 25.4, rows.position))


def outliers(rows: MeasurementSet) -> MeasurementSet:
    wrong = (np.arange(COUNT) % 5 == 2)[:, None]
    return replace(rows, position=rows.position + wrong * [0.0, 1e-3, 0.0])


def early(rows: MeasurementSet) -> MeasurementSet:
    scatter = np.random.default_rng(1).normal(size=rows.joints.shape)
    return replace(rows, joints=rows.joints + 0.04 * DEG * scatter)


def sign(rows: MeasurementSet) -> MeasurementSet:
    return replace(rows, joints=rows.joints * [1, 1, 1, -1, 1, 1])


def doubled(rows: MeasurementSet) -> MeasurementSet:
    return rows.subset(np.append(np.arange(COUNT), [3, 9]))


WRONG = {
    "instrument-moved": (bump, range(25, COUNT)),
    "reflector": (reflector, range(30, COUNT)),
    "one-direction": (outliers, range(2, COUNT, 5)),
    "joints-early": (early, range(COUNT)),
    "joint-sign": (sign, range(COUNT)),
    "duplicates": (doubled, range(COUNT, COUNT + 2)),
}


def test_clean_rows_are_not_suspected(clean):
    diagnosis = diagnose(ROBOT, clean)
    assert diagnosis.findings == ()
    assert diagnosis.error < 0.2 * MM
    with pytest.raises(ConfigurationError, match="finds nothing"):
        cure_rows(ROBOT, clean, None, "drift")
    assert diagnose(ROBOT, clean.subset(np.arange(10))).findings == ()


@pytest.mark.parametrize("cause", WRONG)
def test_the_cause_is_named_with_its_rows_and_cured(cause, clean):
    corrupt, concerned = WRONG[cause]
    rows = corrupt(clean)
    before = rows.position.copy(), rows.joints.copy()
    cured, finding = cure_rows(ROBOT, rows, None, cause)
    np.testing.assert_array_equal(finding.hypothesis.rows, list(concerned))
    assert finding.odds > 100.0
    np.testing.assert_array_equal(rows.position, before[0])  # the raw rows stay
    np.testing.assert_array_equal(rows.joints, before[1])
    if cause not in ("joints-early", "duplicates"):
        wanted = clean.position if cause != "joint-sign" else clean.joints
        got = cured.position if cause != "joint-sign" else cured.joints
        wrong = rows.position if cause != "joint-sign" else rows.joints
        assert np.abs(got - wanted).max() < 0.3 * np.abs(wrong - wanted).max()
        assert finding.after < 0.6 * finding.before


def test_a_lag_of_the_joints_is_removed_to_second_order(clean):
    lag, step = 0.04, np.diff(clean.joints, axis=0, prepend=clean.joints[:1])
    cured, finding = cure_rows(
        ROBOT, replace(clean, joints=clean.joints - lag * step), None, "clock"
    )
    assert "joints are 4 % of the way to those of the row before" in finding.hypothesis.text
    np.testing.assert_allclose(cured.joints, clean.joints[1:], atol=5e-4)  # of steps of radians
    np.testing.assert_array_equal(cured.source_row, clean.source_row[1:])


@pytest.mark.parametrize(("step", "word"), [(1, "before"), (-1, "after")])
def test_shifted_rows_lose_the_row_without_joints(clean, step, word):
    kept = slice(1, None) if step > 0 else slice(0, -1)
    file = replace(clean, joints=np.roll(clean.joints, step, axis=0)).subset(np.arange(COUNT)[kept])
    cured, finding = cure_rows(ROBOT, file, None, "shifted-rows")
    assert f"those of the row {word}" in finding.hypothesis.text
    whole = clean.subset(np.searchsorted(clean.source_row, cured.source_row))
    assert len(cured) == COUNT - 2
    np.testing.assert_array_equal(cured.joints, whole.joints)


def test_a_cured_joint_offset_takes_the_zero_error_of_the_arm_along(clean):
    """Rows read and cured alike are predicted as well as by clean rows: all that they can tell."""
    fitted, held_out = clean.subset(np.arange(0, COUNT, 2)), clean.subset(np.arange(1, COUNT, 2))
    offset = np.array([0.0, 0.0, 4.0 * DEG, 0.0, 0.0, 0.0])
    file = replace(fitted, joints=fitted.joints + offset)
    cured, finding = cure_rows(ROBOT, file, None, "joint-offset")
    removed = file.joints[0] - cured.joints[0]
    own = fit(ROBOT, fitted, method="elastic").errors[parameter_slice(6, "theta")]
    np.testing.assert_allclose(removed - offset, [0.0, 0.0, -own[2], 0.0, 0.0, 0.0], atol=2e-4)
    assert "the arm's own zero error included (sd 0.057 deg, " in finding.hypothesis.text

    def error(rows, judged):
        after = evaluate(fit(ROBOT, rows, method="elastic"), judged).after
        return float(np.linalg.norm(after, axis=1).mean())

    alike = replace(held_out, joints=held_out.joints + offset - removed)
    assert error(cured, alike) < 1.15 * error(fitted, held_out)


@pytest.mark.parametrize("first", [20, 30])
def test_a_small_factor_is_not_removed_where_either_part_may_be_wrong(clean, first):
    rows = replace(clean, position=clean.position * np.where(late(first), 1.0004, 1.0))
    (finding,) = diagnose(ROBOT, rows).findings
    text = finding.hypothesis.text
    assert "-398 um/m" in text
    assert "+398 um/m" in text
    assert text.endswith("the rows do not show which")
    with pytest.raises(ConfigurationError, match="cannot correct rows"):
        cure_rows(ROBOT, rows, None, "scale")


def test_the_lengths_of_the_arm_show_which_part_is_in_inches(data_dir):
    case = draw(40298, SETS)
    rows = scale(case.rows, case.robot, np.random.default_rng([40298, 5]))
    cured, finding = cure_rows(case.robot, rows, case.settings, "scale")
    wrong = np.flatnonzero((rows.position != case.rows.position).any(axis=1))
    np.testing.assert_array_equal(finding.hypothesis.rows, wrong)
    np.testing.assert_allclose(cured.position, case.rows.position, atol=2e-3)


def test_exchanged_columns_beyond_limits_are_no_full_turn(clean):
    joints = clean.joints.copy()
    joints[:, [1, 3]] = joints[:, [3, 1]]
    joints[3, 1] = ROBOT.limits[1, 1] + 0.2  # a turn back is beyond the other limit
    (finding,) = diagnose(ROBOT, replace(clean, joints=joints)).findings
    assert finding.hypothesis.cause == "joints-exchanged"


def test_the_report_has_six_words_lines_odds_and_cure(clean):
    rows = inches(clean)
    diagnosis = diagnose(ROBOT, rows)
    (line,) = describe_diagnosis(diagnosis, rows)
    assert line.startswith("data doctor: Positions have another scale or unit: ")
    assert "lines 35 to 46 (12 rows)" in line
    assert "--cure scale" in line
    assert diagnosis.findings[0].hypothesis.cured is not None
    np.testing.assert_allclose(diagnosis.findings[0].hypothesis.cured.position, clean.position,
                               atol=2e-3)  # fmt: skip
    document = diagnosis_document(diagnosis, rows)
    assert document["findings"][0]["lines"] == list(range(35, 47))
    assert all(len(words.split()) == 6 for words in SIX_WORDS.values())


@pytest.mark.parametrize("kind", ["duplicates", "drift", "preset"])
def test_the_page_shows_what_the_doctor_says(kind):
    assert write_section(kind).partition("; odds")[0] in PAGE.read_text(encoding="utf-8")


def test_the_page_has_a_report_for_every_cause():
    page = PAGE.read_text(encoding="utf-8")
    for kind, words in SIX_WORDS.items():
        assert f"### `{kind}`: {words}\n\n```text\ndata doctor: {words}: " in page


def test_a_model_of_cured_rows_says_so_in_summary_and_lineage(clean):
    raw = doubled(clean)
    cured, finding = cure_rows(ROBOT, raw, None, "duplicates")
    model = with_cure(fit(ROBOT, cured, method="nominal"), finding, raw)
    summary = model.training_summary()
    assert [step["step"] for step in summary.lineage] == ["cure", "fit"]
    assert summary.lineage[0]["rows"] == COUNT + 2
    assert summary["cure"]["cause"] == "duplicates"
    assert "--cure duplicates" in summary.warnings[0]
