"""The nominal arm as an error model: it corrects nothing and says how far its type errs."""

from __future__ import annotations

import numpy as np
import pytest
from planted_arm import arm, planted, postures

from robotrue.calibration.archive import open_model
from robotrue.calibration.model import Query, identity_of
from robotrue.calibration.nominal import NominalModel
from robotrue.core.archive import archive_bytes
from robotrue.core.conditions import ArmConditions, no_conditions
from robotrue.errors import ConfigurationError, ModelMismatchError, ShapeError
from robotrue.robot.forward import forward
from robotrue.robot.model import nominal_identity


def test_it_corrects_nothing_and_covers_arms_of_its_type():
    rng = np.random.default_rng(7)
    robot = arm()
    model = NominalModel(robot=robot)
    query = Query(joints=postures(robot, 20, rng))
    stated = model.predict(query)
    assert not stated.error.any()
    assert not stated.rotation_error.any()
    inside = []
    for _ in range(20):
        actual = planted(robot, rng)
        off = forward(actual, query.joints)[:, :3, 3] - forward(robot, query.joints)[:, :3, 3]
        inside.append((off * np.linalg.solve(stated.covariance, off[:, :, None])[:, :, 0]).sum(1))
    assert (np.array(inside) < 7.815).mean() > 0.9
    joint = model.joint_covariance(query)
    np.testing.assert_allclose(joint[3:6, 3:6], stated.covariance[1], rtol=1e-9)


def test_its_identity_is_the_geometry_and_its_archive_comes_back():
    model = NominalModel(robot=planted(arm(), np.random.default_rng(8)))
    assert not model.calibrated
    assert identity_of(model) == nominal_identity(arm())
    again = open_model(model.to_archive())
    assert archive_bytes(again.to_archive()) == archive_bytes(model.to_archive())
    assert model.at_reflector(0) is model
    assert model.training_summary()["rows"] == 0
    assert not model.mean_tables().robot.errors.any()


def test_what_it_does_not_know_is_refused():
    model = NominalModel(robot=arm())
    with pytest.raises(ModelMismatchError, match="reflector 1"):
        model.at_reflector(1)
    with pytest.raises(ShapeError):
        model.predict(Query(joints=np.zeros((2, 5))))


def test_conditions_leave_a_model_without_such_terms_alone_and_cannot_be_stated():
    model = NominalModel(robot=arm())
    warm = ArmConditions(temperature=np.array([[303.15]]))
    assert model.remarks_on(warm) == []
    model.require_stated(no_conditions(3))
    with pytest.raises(ConfigurationError, match="no part of the model depends on it"):
        model.under(warm)
