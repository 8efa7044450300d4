"""Transfer on a simulated arm: what is carried, what is learned back, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_arm import PAYLOAD, arm, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.drift_prior import DEFAULTS, drift_of, prior_of
from robotrue.calibration.learned import LearnedMethod, LearnedParts
from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query, model_hash
from robotrue.calibration.transfer import TransferSource, carry_source, fit_transfer, student
from robotrue.core.archive import read_archive, write_archive
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import deflect_arm

SETTINGS = FitSettings(payload=PAYLOAD)
NOISE = 2e-5
STAND = pose(matrix_from_rotation_vector(np.array([0.1, 0.2, -0.7])), np.array([3.0, 1.0, 0.5]))
TRUE = planted(arm(), np.random.default_rng(51))


def visit(actual, joints, seed, T=None):
    """Measured positions of an arm with ripple in joint 2; in base, or in a tracker frame."""
    rng = np.random.default_rng(seed)
    shift = np.zeros_like(joints)
    shift[:, 1] = 8e-5 * np.sin(9.0 * joints[:, 1])
    points = deflect_arm(actual, joints, PAYLOAD, shift)[0].position
    points = points + NOISE * rng.standard_normal(points.shape)
    if T is not None:
        points = points @ T[:3, :3].T + T[:3, 3]
    return MeasurementSet(
        joints=joints,
        position=points,
        covariance=np.tile(NOISE**2 * np.eye(3), (len(joints), 1, 1)),
        frame="base" if T is None else "tracker",
    )


def remounted(shift):
    errors = TRUE.errors.copy()
    errors[parameter_slice(6, "tool")][:3] += shift
    return TRUE.with_errors(errors)


@pytest.fixture(scope="module")
def source():
    rows = visit(TRUE, postures(arm(), 150, np.random.default_rng(52)), 53)
    return LearnedMethod(name="ripple", parts=LearnedParts(smooth=False, highest=16))(
        arm(), rows, SETTINGS
    )


@pytest.fixture(scope="module")
def moved():
    """Another campaign: reflector off by 0.6 mm, tracker elsewhere; 12 rows and 60 to test."""
    actual = remounted(np.array([6e-4, 0.0, -2e-4]))
    joints = postures(arm(), 72, np.random.default_rng(54))
    rows = visit(actual, joints, 55, STAND)
    return rows.subset(np.arange(12)), rows.subset(np.arange(12, 72))


def examined(model, rows):
    rows = model.in_base(rows)
    stated = model.predict(Query(joints=rows.joints, load=PAYLOAD))
    off = rows.position - forward(model.robot, rows.joints)[:, :3, 3] - stated.error
    solved = np.linalg.solve(stated.covariance + rows.covariance, off[:, :, None])[:, :, 0]
    return float(np.linalg.norm(off, axis=1).mean()), float(((off * solved).sum(1) < 7.815).mean())


def carried(source, target, **more):
    given = [TransferSource(model=source, relation="campaign", name="July")]
    return fit_transfer(arm(), target, given, SETTINGS, **more)


def test_twelve_points_of_another_campaign(source, moved):
    known, test = moved
    model = carried(source, known)
    mean, cover = examined(model, test)
    alone = fit(arm(), known, settings=replace(SETTINGS, lean_on_prior=True))
    assert mean < 6e-5
    assert mean < 0.4 * examined(alone, test)[0]
    assert 0.9 <= cover <= 1.0
    learned = model.training_summary()["drift_scales"]["tool"]
    assert 1e-4 < learned < 2e-3  # planted 0.6 and 0.2 mm


def test_without_target_rows_it_is_the_source_with_honest_width(source):
    joints = postures(arm(), 30, np.random.default_rng(56))
    query = Query(joints=joints, load=PAYLOAD)
    model, before = carried(source, None), source.predict(query)
    after = model.predict(query)
    keep = np.cos(np.arctan(DEFAULTS["campaign"].ripple))
    assert np.linalg.norm(after.error - before.error, axis=1).max() < 2e-4 * (1.0 - keep) * 10
    wider = np.linalg.eigvalsh(after.covariance - before.covariance)[:, 0]
    assert (wider > 0.0).all()
    assert model.training_summary()["target_rows"] == 0


def test_order_of_target_rows_does_not_matter(source, moved):
    known, test = moved
    query = Query(joints=test.joints, load=PAYLOAD)
    one = carried(source, known).predict(query)
    other = carried(source, known.subset(np.arange(11, -1, -1))).predict(query)
    np.testing.assert_allclose(other.error, one.error, rtol=0, atol=2e-6)
    np.testing.assert_allclose(
        np.trace(other.covariance, axis1=1, axis2=2),
        np.trace(one.covariance, axis1=1, axis2=2),
        rtol=0.05,
    )


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_scale_ten_times_off_is_learned_back(source, moved, factor):
    known, test = moved
    right = carried(source, known)
    tool = factor * 4e-4
    wrong = carried(source, known, scales=replace(DEFAULTS["campaign"], tool=tool))
    learned = wrong.training_summary()["drift_scales"]["tool"]
    assert abs(np.log(learned / 4e-4)) < 0.6 * abs(np.log(factor))
    assert examined(wrong, test)[0] < 1.15 * examined(right, test)[0]


def test_a_gross_target_row_is_screened(source, moved):
    known, test = moved
    position = known.position.copy()
    position[4] += [0.0, 0.0, 8e-3]
    model = carried(source, replace(known, position=position))
    assert model.training_summary()["screened_rows"] == [4]
    assert examined(model, test)[0] < 1.3 * examined(carried(source, known), test)[0]


def test_a_contaminated_source_is_screened_by_its_own_fit(moved):
    known, test = moved
    rows = visit(TRUE, postures(arm(), 80, np.random.default_rng(57)), 58)
    rng = np.random.default_rng(59)
    position = rows.position.copy()
    position[rng.choice(80, 8, replace=False)] += 4e-3 * rng.standard_normal((8, 3))
    bad = replace(rows, position=position)
    found = []
    for measurements in (rows, bad):
        given = [TransferSource(measurements=measurements, relation="campaign")]
        model = fit_transfer(arm(), known, given, SETTINGS, method="elastic")
        found.append(examined(model, test)[0])
    assert found[1] < 1.2 * found[0]


def test_shuffled_labels_give_a_wide_answer_and_no_crash(source, moved):
    known, _ = moved
    order = np.random.default_rng(60).permutation(12)
    base = visit(TRUE, known.joints, 61)
    offsets = base.position - forward(arm(), base.joints)[:, :3, 3]
    position = forward(arm(), base.joints)[:, :3, 3] + offsets[order]
    model = carried(source, replace(base, position=position))
    assert model.training_summary()["white_sd_m"] > 3.0 * source.training_summary()["white_sd_m"]


def test_a_source_as_it_is_only_learns_where_the_new_tracker_is(source, moved):
    known, test = moved
    given = TransferSource(model=source)
    model = carry_source(arm(), known, given, SETTINGS)
    before = fit_transfer(arm(), None, [given], SETTINGS)
    np.testing.assert_array_equal(model.errors, before.errors)
    error, inside = examined(model, test)
    assert examined(carried(source, known), test)[0] < error < 8e-4  # the reflector is 0.6 mm off
    assert inside >= 0.9
    assert carry_source(arm(), None, given, SETTINGS).T_tracker_base == {}


def test_two_campaigns_know_more_than_one(source, moved):
    second = fit(
        arm(), visit(TRUE, postures(arm(), 60, np.random.default_rng(62)), 63), settings=SETTINGS
    )
    query = Query(joints=moved[1].joints, load=PAYLOAD)
    one = carried(source, None)
    both = fit_transfer(
        arm(),
        None,
        [TransferSource(model=source, name="July"), TransferSource(model=second, name="May")],
        SETTINGS,
    )
    size = [np.trace(m.predict(query).covariance, axis1=1, axis2=2).mean() for m in (one, both)]
    assert size[1] < size[0]
    assert [s["name"] for s in both.training_summary()["transfer_sources"]] == ["July", "May"]


def test_other_units_tell_the_type(source):
    """Three arms that share 0.5 mm in a link: the type's mean has it, nominal tables have not."""
    robot = arm()
    type_errors = np.zeros(len(robot.errors))
    type_errors[robot.dof * 2 + 2] = 1.5e-3  # a3
    given, arms = [], []
    for seed in range(70, 73):
        rng = np.random.default_rng(seed)
        actual = planted(robot, rng)
        arms.append(actual.with_errors(actual.errors + type_errors))
        rows = visit(arms[-1], postures(robot, 50, rng), seed)
        given.append(TransferSource(model=fit(robot, rows, settings=SETTINGS), relation="unit"))
    model = fit_transfer(robot, None, given, SETTINGS)
    found = model.errors[robot.dof * 2 + 2]
    spread = np.sqrt(model.covariance[robot.dof * 2 + 2, robot.dof * 2 + 2])
    assert abs(found - 1.5e-3) < 2.5 * spread
    assert spread > DEFAULTS["unit"].length  # the next arm is one more unit


def test_lineage_sources_and_archive(source, moved, tmp_path):
    model = carried(source, moved[0])
    write_archive(tmp_path / "t.rtm", model.to_archive())
    again = open_model(read_archive(tmp_path / "t.rtm"))
    query = Query(joints=moved[1].joints, load=PAYLOAD)
    np.testing.assert_array_equal(again.predict(query).error, model.predict(query).error)
    summary = again.training_summary()
    assert summary["lineage"][-1]["step"] == "transfer"
    assert summary["lineage"][-1]["parents_sha256"] == [model_hash(source)]
    assert summary["transfer_sources"] == [{"name": "July", "relation": "campaign", "rows": 150}]
    assert set(summary["drift_scales"]) == set(summary["drift_defaults"])


def test_another_reflector_makes_its_place_unknown(source):
    tool = arm().T_flange_tool.copy()
    tool[:3, 3] += [0.1, 0.0, 0.0]
    model = fit_transfer(
        arm().with_tool(tool), None, [TransferSource(model=source, relation="campaign")], SETTINGS
    )
    place = parameter_slice(6, "tool")
    assert not model.errors[place].any()
    spread = np.sqrt(np.diagonal(model.covariance)[place][:3])
    assert (spread >= SETTINGS.scales.tool).all()


def test_what_cannot_be_a_source_is_refused(source, moved):
    other = replace(arm(), d=arm().d + np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0]))
    with pytest.raises(ModelMismatchError, match=r"d of joint 4 differs by 0\.1"):
        fit_transfer(other, moved[0], [TransferSource(model=source, name="June")], SETTINGS)
    with pytest.raises(ConfigurationError, match="at least one source"):
        fit_transfer(arm(), moved[0], [], SETTINGS)
    with pytest.raises(ConfigurationError, match="either measurements or a model"):
        TransferSource(name="nothing")
    with pytest.raises(ConfigurationError, match="relation 'twin'"):
        TransferSource(model=source, relation="twin")  # type: ignore[arg-type]


def test_prior_of_a_drift_is_wider_by_its_groups(source):
    belief = source.belief()
    prior = prior_of(drift_of(belief, "campaign"))
    theta = parameter_slice(6, "theta")
    wide = max(source.inflation, 1.0)  # a narrow source is not carried over narrower
    added = prior.variance[theta] - wide * belief.variance[theta]
    scale = DEFAULTS["campaign"].theta
    np.testing.assert_allclose(added, scale**2, rtol=1e-6)


def test_student_narrows_with_rows():
    widths = [student(n, "campaign") for n in (0, 5, 20, 1000)]
    assert widths == sorted(widths, reverse=True)
    assert widths[-1] == pytest.approx(1.0, abs=0.01)
    assert student(0, "region") < student(0, "campaign")


def test_a_compact_transfer_is_the_same_with_a_shorter_root(source, moved):
    known, test = moved
    model = fit_transfer(arm(), known, [TransferSource(model=source)], SETTINGS)
    compact = model.compact()
    assert len(compact.root) <= compact.root.shape[1] < len(model.root)
    assert compact.compact() is compact
    query = Query(joints=test.joints, load=PAYLOAD)
    stated, again = model.predict(query), compact.predict(query)
    np.testing.assert_array_equal(again.error, stated.error)
    np.testing.assert_allclose(again.covariance, stated.covariance, rtol=1e-6)
