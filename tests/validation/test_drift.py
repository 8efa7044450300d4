"""The drift check on simulated truths: false alarms at the stated level, power, causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from validation_fakes import FakeModel

from robotrue.calibration.calibrated_model import model_of
from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION, point_covariance
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load, deflect_arm
from robotrue.validation.drift_check import drift_check

REPEATABILITY = 1.4e-5
TRACKER = np.array([3.5, -2.0, 1.2])
PAYLOAD = Load(mass=np.array([50.0]), com=np.array([[0.02, 0.0, 0.12]]))
STIFFNESS = np.array([1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5])
POSES = 7
SETS = 400
LEVEL = 0.05


def nominal() -> RobotModel:
    tool = np.eye(4)
    tool[:3, 3] = [0.06, 0.04, 0.25]
    return preset("KUKA KR160 R1570").with_tool(tool)


def postures(n: int, rng: np.random.Generator) -> Array:
    axes = np.deg2rad([[-90, 90], [-110, -40], [40, 120], [-120, 120], [-100, 100], [-150, 150]])
    low, high = np.sort(nominal().controller.to_model(axes.T).T, axis=1).T
    return low + (high - low) * rng.random((n, 6))


def measured(arm: RobotModel, joints: Array, rng: np.random.Generator) -> MeasurementSet:
    """SIMULATED: one visit each, scatter and tracker as stated."""
    true = deflect_arm(arm, joints, PAYLOAD)[0].position
    covariance = point_covariance(DEFAULT_SPECIFICATION, true, TRACKER)
    noise = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), rng.standard_normal(true.shape))
    return MeasurementSet(
        joints=joints,
        position=true + REPEATABILITY * rng.standard_normal(true.shape) + noise,
        covariance=covariance,
    )


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(3)
    errors = np.zeros(len(nominal().errors))
    for group in ("theta", "d", "a", "alpha"):
        errors[parameter_slice(6, group)] = 3e-4 * rng.standard_normal(6)
    errors[parameter_slice(6, "compliance")] = 1.0 / STIFFNESS
    rows = measured(nominal().with_errors(errors), postures(50, rng), rng)
    settings = FitSettings(payload=PAYLOAD, repeatability=RP_PER_SIGMA * REPEATABILITY)
    found = fit(nominal(), rows, method="elastic", settings=settings)
    # The scatter that is drawn below is the repeatability alone.
    return replace(found, white=0.0)


class Shop:
    """Draws arms the model believes possible, changes them, and has them checked."""

    def __init__(self, model, seed: int) -> None:
        values, vectors = np.linalg.eigh(model.covariance)
        self.root = vectors * np.sqrt(np.maximum(values, 0.0))
        self.model, self.rng = model, np.random.default_rng(seed)

    def check(self, change: Array | None = None, *, level: float = LEVEL, wrong: float = 0.0):
        errors = self.model.errors + self.root @ self.rng.standard_normal(len(self.root))
        arm = self.model.robot.with_errors(errors if change is None else errors + change)
        rows = measured(arm, postures(POSES, self.rng), self.rng)
        if wrong:
            position = rows.position.copy()
            position[2, 1] += wrong
            rows = replace(rows, position=position)
        return drift_check(self.model, rows, payload=PAYLOAD, level=level)


def changed(group: str, index: int, by: float) -> Array:
    out = np.zeros(len(nominal().errors))
    out[parameter_slice(6, group).start + index] = by
    return out


def test_false_alarms_stay_at_the_stated_level(model):
    """400 sets without drift; the bound is the 99.9 % point of the stated rate."""
    shop = Shop(model, seed=11)
    alarms = sum(shop.check().changed for _ in range(SETS))
    assert alarms <= binom.ppf(0.999, SETS, LEVEL)
    # Bonferroni errs on the safe side, but the test must not be dead.
    assert alarms >= 2


def test_a_tool_that_moved_by_a_tenth_of_a_millimetre_is_seen_and_named(model):
    shop = Shop(model, seed=12)
    found = [shop.check(changed("tool", 0, 1e-4), level=0.01) for _ in range(20)]
    assert sum(f.changed for f in found) >= 19
    assert sum(f.best is not None and f.best.kind == "tool" for f in found) >= 18
    best = next(f.best for f in found if f.best is not None)
    assert best.shift[0] == pytest.approx(1e-4, abs=4.0 * best.sd[0])


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_a_joint_that_slipped_by_a_tenth_of_a_milliradian_is_seen_and_named(model, joint):
    shop = Shop(model, seed=20 + joint)
    found = [shop.check(changed("theta", joint - 1, 1e-4), level=0.01) for _ in range(15)]
    assert sum(f.changed for f in found) >= 14
    assert sum(f.best is not None and f.best.name == f"joint {joint}" for f in found) >= 13
    assert {f.verdict for f in found} <= {"update", "recalibrate", "keep"}


def test_a_joint_the_reflector_hardly_feels_is_said_not_to_be_seen(model):
    shop = Shop(model, seed=31)
    assert any("joint 6" in shop.check().not_seen for _ in range(5))


def test_one_wrong_reading_is_to_be_measured_again(model):
    shop = Shop(model, seed=32)
    found = shop.check(wrong=5e-4)
    assert found.verdict == "measure again"
    assert found.best is not None
    assert found.best.name == "reading 3"
    assert found.best.shift[1] == pytest.approx(5e-4, abs=1e-4)


def test_several_things_at_once_ask_for_a_calibration(model):
    change = changed("theta", 1, 4e-4) + changed("theta", 4, -8e-4) + changed("tool", 2, 4e-4)
    found = Shop(model, seed=33).check(change)
    assert found.verdict == "recalibrate"
    assert found.p < 1e-6


def test_rows_together_are_as_uncertain_as_alone_and_share_the_model(model):
    joints = postures(4, np.random.default_rng(4))
    query = Query(joints=joints, load=PAYLOAD)
    learned = model_of(model.belief(), {})
    for one in (model, learned):
        together = one.joint_covariance(query)
        alone = one.predict(query).covariance
        for i in range(4):
            place = slice(3 * i, 3 * i + 3)
            assert together[place, place] == pytest.approx(alone[i], rel=1e-9, abs=1e-18)
        assert np.abs(together[:3, 3:6]).max() > 1e-12
        assert np.linalg.eigvalsh(together).min() > 0.0


def test_what_cannot_be_judged_is_refused(model):
    rng = np.random.default_rng(5)
    rows = measured(model.actual, postures(3, rng), rng)
    with pytest.raises(ObservabilityError, match="3 poses; a drift check needs 4"):
        drift_check(model, rows)
    more = measured(model.actual, postures(6, rng), rng)
    with pytest.raises(ConfigurationError, match="level 2"):
        drift_check(model, more, level=2.0)
    with pytest.raises(ConfigurationError, match="no joint covariance"):
        drift_check(FakeModel(robot=nominal()), more)
