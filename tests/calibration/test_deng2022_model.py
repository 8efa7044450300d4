from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.archive import open_model
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.deng2022.transfer_gpr import fit_deng2022, fit_pose_gpr
from robotrue.calibration.model import Query
from robotrue.core.archive import Archive, archive_bytes
from robotrue.core.poses import pose
from robotrue.core.regions import CylinderRegion
from robotrue.core.units import DEG, MM
from robotrue.errors import (
    ArchiveError,
    ConfigurationError,
    ModelMismatchError,
    ObservabilityError,
    ReachError,
    ShapeError,
)
from robotrue.robot.forward import forward
from robotrue.simulation.plans import Region, random_joints
from robotrue.validation.validate import validate
from robotrue_reproductions.deng2022 import scenarios
from robotrue_reproductions.deng2022.sampling_plan import paper_domains


@pytest.fixture(scope="module")
def case():
    return scenarios.scenario("S1A", 1)


@pytest.fixture(scope="module")
def rows(case):
    return scenarios.paper(case)


def fitted(case, rows, **readings):
    return fit_deng2022(
        case.cell.known.measured_robot,
        rows.subset(rows.group == 0),
        rows.subset(rows.group == 1),
        paper_domains(),
        case.settings,
        DengReadings(rounds=4, **readings),
    )


@pytest.fixture(scope="module")
def model(case, rows):
    return fitted(case, rows)


def left(model, rows):
    commanded = forward(model.robot, rows.joints)[:, :3, 3]
    error = model.predict(Query(joints=rows.joints)).error
    return np.linalg.norm(rows.position - commanded - error, axis=1).mean()


def test_transfer_predicts_poses_of_another_day(case, model):
    check = scenarios.check(case)
    raw = np.linalg.norm(scenarios.raw_errors(case, check), axis=1).mean()
    assert left(model, check) < 0.06 * raw


def test_eq_25_as_printed_has_the_scale_of_its_logarithms(case, rows, model):
    literal = fitted(case, rows, combination="literal")
    betas = literal.experts[0].committee.betas
    factor = np.log(1.0 / betas).sum() * np.median(betas)
    assert abs(factor - 1.0) > 0.2
    query = Query(joints=case.plan.check)
    want = factor * model.predict(query).error
    size = np.linalg.norm(want, axis=1).mean()
    assert np.linalg.norm(literal.predict(query).error - want, axis=1).mean() < 0.1 * size
    check = scenarios.check(case)
    assert left(literal, check) > 5.0 * left(model, check)


def test_the_joined_model_asks_the_expert_of_the_domain(case, model):
    target, source = model.experts
    joints = np.concatenate([case.plan.source[:5], case.plan.check[:5]])
    features = np.zeros((3, 6))
    for row, angle in enumerate((-35.0, -30.0, 10.0)):  # the common boundary is the target's
        features[row, :3] = np.cos(angle * DEG), np.sin(angle * DEG), 0.9
    np.testing.assert_array_equal(model.speaker(features), [1, 0, 0])
    only_source = replace(model, experts=(source,), outside="nearest")
    only_target = replace(model, experts=(target,), outside="nearest")
    both = model.predict(Query(joints=joints)).error
    inside = np.arctan2(*forward(model.robot, joints)[:, 1::-1, 3].T[[0, 1]]) < -30.001 * DEG
    np.testing.assert_array_equal(
        both[inside], only_source.predict(Query(joints=joints[inside])).error
    )
    np.testing.assert_array_equal(
        both[~inside], only_target.predict(Query(joints=joints[~inside])).error
    )


def test_outside_all_domains_is_refused_or_asked_of_the_nearest(case, model):
    far = Region(angle=(-60 * DEG, -50 * DEG))
    joints = random_joints(case.cell.known.measured_robot, 4, seed=1, region=far)
    with pytest.raises(ReachError, match="4 of 4 poses lie in none of the measured domains"):
        model.predict(Query(joints=joints))
    near = replace(model, outside="nearest")
    alone = replace(near, experts=model.experts[1:])
    np.testing.assert_array_equal(
        near.predict(Query(joints=joints)).error, alone.predict(Query(joints=joints)).error
    )


def test_covariance_grows_where_nothing_was_measured_and_turns_are_unknown(case, model):
    known = model.predict(Query(joints=case.plan.target[:10]))
    far = Region(angle=(80 * DEG, 100 * DEG))
    joints = random_joints(case.cell.known.measured_robot, 10, seed=1, region=far)
    there = replace(model, outside="nearest").predict(Query(joints=joints))
    assert there.covariance[:, 0, 0].min() > 3.0 * known.covariance[:, 0, 0].max()
    assert np.isnan(known.rotation_error).all()
    assert (np.linalg.eigvalsh(known.covariance) > 0.0).all()
    assert model.mean_tables() is None


def test_validation_accepts_the_model_and_its_region_holds_most_poses(case, model):
    report = validate(model, scenarios.check(case), payload=case.settings.payload)
    assert 0.75 < report.coverage.share <= 1.0
    assert report.after.mean < 0.1 * MM


def test_another_tool_point_is_refused_and_the_same_point_turned_is_not(case, model):
    joints = case.plan.check[:3]
    same = model.robot.T_flange_tool @ pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    np.testing.assert_array_equal(
        model.predict(Query(joints=joints, T_flange_tool=same)).error,
        model.predict(Query(joints=joints)).error,
    )
    other = same.copy()
    other[0, 3] += 5 * MM
    with pytest.raises(ModelMismatchError, match=r"5\.000 mm from the measured point"):
        model.predict(Query(joints=joints, T_flange_tool=other))


@pytest.mark.parametrize("kernel", ["ard", "isotropic"])
def test_the_archive_gives_back_the_same_model(case, rows, kernel):
    model = fitted(case, rows, kernel=kernel, denominator="literal")
    again = open_model(model.to_archive())
    query = Query(joints=np.concatenate([case.plan.source[:20], case.plan.check]))
    want, got = model.predict(query), again.predict(query)
    np.testing.assert_allclose(got.error, want.error, rtol=0.0, atol=1e-12)
    # Of a nearly linear field little variance is left of a large amplitude: rounding shows.
    np.testing.assert_allclose(got.covariance, want.covariance, rtol=0.05)
    assert again.training_summary() == model.training_summary()
    assert archive_bytes(again.to_archive()) == archive_bytes(model.to_archive())


def test_a_damaged_archive_is_refused(model):
    whole = model.to_archive()
    missing = {k: v for k, v in whole.arrays.items() if k != "expert1/betas"}
    for archive, match in (
        (replace(whole, arrays=missing), "no array 'expert1/betas'"),
        (replace(whole, schema=3), "schema 3; this robotrue reads 1 to 2"),
    ):
        with pytest.raises(ArchiveError, match=match):
            open_model(archive)
    assert isinstance(whole, Archive)


def test_pose_gpr_knows_only_its_region(case, rows):
    robot = case.cell.known.measured_robot
    slab = CylinderRegion(angle=(-41 * DEG, -29 * DEG), radius=(0.7, 1.5), height=(0.6, 1.3))
    model = fit_pose_gpr(robot, rows.subset(rows.group == 0), slab, case.settings)
    assert left(model, rows.subset(np.arange(0, 126, 10))) < 0.05 * MM
    with pytest.raises(ReachError):
        model.predict(Query(joints=case.plan.check))


def test_what_the_method_cannot_use_is_refused(case, rows):
    robot, domains = case.cell.known.measured_robot, paper_domains()
    source, target = rows.subset(rows.group == 0), rows.subset(rows.group == 1)
    with pytest.raises(ShapeError, match="not conformable"):
        fitted(case, rows, transform="literal")
    with pytest.raises(ModelMismatchError, match="tracker frame"):
        fit_deng2022(robot, replace(source, frame="tracker"), target, domains, case.settings)
    with pytest.raises(ObservabilityError, match="no target pose in sub-space 5"):
        fit_deng2022(robot, source, target.subset(np.arange(64)), domains, case.settings)
    with pytest.raises(ObservabilityError, match="3 source poses, expected 8"):
        fit_deng2022(robot, source.subset([0, 1, 2]), target, domains, case.settings)
    lapped = replace(domains, sub_spaces=domains.sub_spaces * 2)
    with pytest.raises(ConfigurationError, match="rule 4"):
        fit_deng2022(robot, source, target, lapped, case.settings)
