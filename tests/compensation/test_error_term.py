"""An error term is one file: here a toy of drives that turn as they warm, of a package outside.

It is registered by the entry point of ``examples/extension``, its planted coefficients are
recovered from simulated poses with an honest covariance, its model comes back from its archive and
takes new poses, and a program is compensated by the ordinary chain.
"""

from __future__ import annotations

from collections.abc import Iterator

import cases
import numpy as np
import pytest

from extension_example import USUAL, WarmDrives, installed_example
from robotrue.calibration.archive import open_model
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.terms import term_registry
from robotrue.calibration.transfer import TransferSource, fit_transfer
from robotrue.calibration.update import update_model
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.core.archive import archive_bytes
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions
from robotrue.errors import ArchiveError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import deflect_arm
from robotrue.validation.validate import validate

PLANTED = np.array([2e-5, -3e-5, 1.5e-5, 0.0, 2e-5, 0.0])
"""rad/K."""
NOISE = 2e-5


@pytest.fixture(scope="module", autouse=True)
def registered(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with installed_example(tmp_path_factory.mktemp("site")):
        yield


def true_points(robot: RobotModel, joints: Array, temperature: Array) -> Array:
    shift = PLANTED * (temperature - 293.15)[:, None]
    return np.asarray(deflect_arm(robot, joints, shift=shift)[0].position)


def poses(n: int, seed: int) -> Array:
    robot, rng = cases.kr160(), np.random.default_rng(seed)
    low, high = np.clip(robot.limits, -1.5, 1.5).T
    return np.asarray(low + (high - low) * rng.random((n, robot.dof)))


def measured(n: int, seed: int, *, stated: bool = True) -> MeasurementSet:
    """Simulated poses over a morning in which the hall warms from 15 to 30 degC."""
    joints, rng = poses(n, seed), np.random.default_rng(seed + 1)
    temperature = rng.uniform(288.15, 303.15, n)
    points = true_points(arm(), joints, temperature)
    return MeasurementSet(
        joints=joints,
        position=points + NOISE * rng.standard_normal((n, 3)),
        covariance=np.tile(NOISE**2 * np.eye(3), (n, 1, 1)),
        temperature=temperature if stated else np.full(n, np.nan),
        sources=("simulated poses",),
    )


def arm() -> RobotModel:
    return cases.with_errors(cases.kr160(), 5, size=0.5)


@pytest.fixture(scope="module")
def model() -> CalibratedModel:
    found = fit(cases.kr160(), measured(120, 1), method="ripple", settings=FitSettings())
    assert isinstance(found, CalibratedModel)
    return found


def coefficients(model: ErrorModel) -> tuple[Array, Array]:
    """Coefficients and their sd, rad/K."""
    belief = model.belief()
    assert belief is not None
    place = belief.place(WarmDrives.name)
    return belief.mean[place], np.sqrt(belief.inflation * belief.variance[place])


def coverage(model: ErrorModel, seed: int) -> tuple[float, float]:
    """Mean error, m, and share of new poses at their own temperatures in their 95 % region."""
    check = measured(300, seed)
    stated = model.predict(Query(joints=check.joints, conditions=check.conditions))
    off = check.position - forward(model.robot, check.joints)[:, :3, 3] - stated.error
    solved = np.linalg.solve(stated.covariance + check.covariance, off[:, :, None])[:, :, 0]
    return (
        float(np.linalg.norm(off, axis=1).mean()),
        float(((off * solved).sum(axis=1) < 7.815).mean()),
    )


def test_planted_coefficients_are_recovered_within_their_uncertainty(
    model: CalibratedModel,
) -> None:
    value, sd = coefficients(model)
    assert (np.abs(value - PLANTED) < 3.5 * sd).all()
    assert (sd[:5] < 3e-6).all()  # the last joint has hardly a lever
    assert np.abs(value[:3] - PLANTED[:3]).max() < 2e-6


def test_predictions_at_other_temperatures_are_better_and_honest(model: CalibratedModel) -> None:
    mean, cover = coverage(model, 11)
    blind = fit(cases.kr160(), measured(120, 1, stated=False), method="ripple")
    assert mean < 0.5 * coverage(blind, 11)[0]
    assert 0.9 < cover <= 1.0
    assert blind.belief().place(WarmDrives.name) == slice(*[len(blind.belief().mean)] * 2)


def test_validation_takes_the_temperature_of_each_row(model: CalibratedModel) -> None:
    check = measured(300, 11)
    assert validate(model, check).after.mean == pytest.approx(coverage(model, 11)[0], rel=1e-9)


def test_new_poses_and_another_campaign_move_it_too(model: CalibratedModel) -> None:
    more = update_model(model, measured(60, 21))
    assert (coefficients(more)[1] < coefficients(model)[1] + 1e-12).all()
    assert coverage(more, 11)[1] > 0.9
    moved = fit_transfer(cases.kr160(), measured(12, 31), [TransferSource(model=model)])
    value, sd = coefficients(moved)
    assert (np.abs(value - PLANTED) < 4.0 * sd).all()


def test_archive_gives_the_term_back_and_needs_it_registered(model: CalibratedModel) -> None:
    archive = model.to_archive()
    again = open_model(archive)
    assert archive_bytes(again.to_archive()) == archive_bytes(archive)
    query = Query(joints=poses(10, 3), conditions=ArmConditions(temperature=[[295.0]]))
    np.testing.assert_array_equal(again.predict(query).error, model.predict(query).error)
    term_registry.unregister(WarmDrives.name)
    try:
        with pytest.raises(ArchiveError, match="an error term 'warm-drives'"):
            open_model(archive)
    finally:
        term_registry.register(WarmDrives)


def test_a_program_is_compensated_by_the_ordinary_chain(model: CalibratedModel) -> None:
    joints = cases.path_joints(60)
    target = forward(model.robot, joints)
    program = cases.program_of(target)
    result = compensate(model, program, settings=CompensationSettings(home=joints[0]))
    assert (result.status == Status.COMPENSATED).all()
    hall = np.full(60, USUAL)

    def off(at: Array) -> float:
        gap = true_points(arm(), at, hall) - target[:, :3, 3]
        return float(np.linalg.norm(gap, axis=1).mean())

    assert off(result.joints) < 5e-5
    assert off(joints) > 10.0 * off(result.joints)
