"""What every error term promises; a new one joins by one line in ``TERMS``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from robotrue.calibration.arm import prepare_arm, term_columns
from robotrue.calibration.terms import term_registry
from robotrue.calibration.terms.backlash import Backlash
from robotrue.calibration.terms.rail_guide import RailGuide
from robotrue.calibration.terms.ripple import Ripple, harmonics
from robotrue.calibration.terms.rotary_table import RotaryTable
from robotrue.calibration.terms.smooth import SmoothBasis, SmoothResidual
from robotrue.calibration.terms.term import ArmPostures, Effect, Term, rigid_tables
from robotrue.calibration.terms.thermal import Thermal
from robotrue.core.arrays import Array
from robotrue.program.external_axes import ExternalAxis
from robotrue.robot.forward import forward, parameter_jacobian, sensitivity_of, walk
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.robot.statics import NO_LOAD, deflect_arm, drive_torque

ROBOT = preset("UR10")
RNG = np.random.default_rng(4)
JOINTS = RNG.uniform(-1.5, 1.5, (12, 6))
APPROACH = RNG.choice([-1.0, 1.0], JOINTS.shape)
BASIS = SmoothBasis(centres=RNG.standard_normal((5, 12)), scale=np.full(12, 0.7))
TERMS: dict[str, Term] = {
    "ripple": Ripple(dof=6, cycles=harmonics(4)),
    "backlash": Backlash(dof=6),
    "smooth": SmoothResidual(basis=BASIS, amplitude=1e-4),
    "thermal": Thermal(
        dof=6,
        driver="temperature",
        start=0.0,
        usual=np.linspace(1.0, 4.0, 6),
        spread=2.0,
        span=np.array([290.0, 300.0]),
    ),
    "table": RotaryTable(
        axes=(
            ExternalAxis(number=2, direction=np.array([0.0, 0.1, 1.0]), point=np.array([1, 0, 0])),
        ),
        low=np.array([-1.0]),
        high=np.array([1.0]),
        scatter=1e-6,
    ),
    "rail": RailGuide(number=1, direction=np.eye(3)[1], low=0.0, high=4.0, stated=1.3),
}
STEP = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Phased(Backlash):
    """A toy that is not linear: dq_1 = v_0 sin(q_1 + v_1)."""

    name: ClassVar[str] = "phased"
    linear: ClassVar[bool] = False

    @property
    def parameters(self) -> tuple[str, ...]:
        return ("size", "phase")

    def columns(self, robot: RobotModel, at: ArmPostures, by: Any, values: Array) -> Array:
        angle = at.joints[:, 0] + values[1]
        slope = np.stack([np.sin(angle), values[0] * np.cos(angle)], axis=1)
        return np.asarray(by.drive[:, :, :1] * slope[:, None, :])

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        shift = np.zeros_like(at.joints)
        shift[:, 0] = values[0] * np.sin(at.joints[:, 0] + values[1])
        return Effect(drive_shift=shift)


def values_of(term: Term) -> Array:
    # What moves the error vector does so to first order.
    size = 1e-9 if isinstance(term, Thermal | RailGuide | RotaryTable) else 1e-4
    return size * np.random.default_rng(5).standard_normal(term.size)


def error(term: Term, values: Array) -> Array:
    arm = prepare_arm(ROBOT, terms=(term,), values=values)
    at = arm.linearise(JOINTS, NO_LOAD, APPROACH)
    return at.error


@pytest.mark.parametrize("term", [*TERMS.values(), Phased(dof=6)], ids=[*TERMS, "not linear"])
def test_columns_are_the_derivative_of_the_error(term: Term) -> None:
    values = values_of(term) + (0.3 if isinstance(term, Phased) else 0.0)
    arm = prepare_arm(ROBOT, terms=(term,), values=values)
    at = arm.linearise(JOINTS, NO_LOAD, APPROACH)
    columns = at.columns[:, :, len(ROBOT.errors) :]
    assert columns.shape == (12, 3, term.size) == (12, 3, len(term.parameters))
    for k, step in enumerate(STEP * np.eye(term.size)):
        slope = (error(term, values + step) - error(term, values - step)) / (2.0 * STEP)
        np.testing.assert_allclose(columns[:, :, k], slope, atol=2e-7)


def test_a_term_that_is_not_linear_linearises_where_it_stands() -> None:
    term, true, near = Phased(dof=6), np.array([2e-4, 0.7]), np.array([1.8e-4, 0.6])
    at = ArmPostures(joints=JOINTS, torque=drive_torque(ROBOT, JOINTS))
    jacobian = parameter_jacobian(ROBOT, walk(ROBOT, JOINTS), JOINTS)[:, :3]
    residual = error(term, true)
    far, _ = term_columns(ROBOT, at, jacobian, (term,), np.array([2e-4, 0.0]))
    (columns,), shift = term_columns(ROBOT, at, jacobian, (term,), near)
    left = residual - shift - columns @ true
    assert np.abs(left).max() < 0.02 * np.abs(residual).max()
    assert np.abs(left).max() < 0.2 * np.abs(residual - far[0] @ true).max()


@pytest.mark.parametrize("name", TERMS)
def test_the_prior_names_every_parameter_once(name: str) -> None:
    term = TERMS[name]
    for few in (False, True):
        columns = np.concatenate([group.columns for group in term.groups(few=few)])
        np.testing.assert_array_equal(np.sort(columns), np.arange(term.size))


@pytest.mark.parametrize("name", TERMS)
def test_the_archive_gives_it_back_bit_for_bit(name: str) -> None:
    term, values = TERMS[name], values_of(TERMS[name])
    again, same = type(term).restore(ROBOT, term.document(), term.arrays(values))
    np.testing.assert_array_equal(same, values)
    assert again.parameters == term.parameters
    np.testing.assert_array_equal(error(again, same), error(term, values))
    assert term_registry.term_of(name) is type(term)


@pytest.mark.parametrize("name", TERMS)
def test_tables_say_what_the_effect_is_and_exports_can_leave_it_out(name: str) -> None:
    term, values = TERMS[name], values_of(TERMS[name])
    empty = rigid_tables(ROBOT)
    tables = term.in_tables(empty, values)
    assert tables is not None
    phase = JOINTS[:, :, None] * tables.harmonics
    shift = (tables.ripple_sin * np.sin(phase) + tables.ripple_cos * np.cos(phase)).sum(axis=2)
    state, _ = deflect_arm(tables.robot, JOINTS, NO_LOAD, shift + tables.backlash * APPROACH)
    found = state.position - forward(ROBOT.nominal(), JOINTS)[:, :3, 3]
    scaled = tables.scale * np.concatenate([np.sin(JOINTS), np.cos(JOINTS)], axis=1)
    square = ((scaled[:, None] - tables.centres) ** 2).sum(axis=2)
    found = found + np.exp(-0.5 * square) @ tables.weights
    np.testing.assert_allclose(found, error(term, values), rtol=0.0, atol=1e-12)
    if not term.export_name:  # the robot's errors hold it
        return
    bare = term_registry.export_parts()[term.export_name](tables)
    for left in (bare.ripple_sin, bare.ripple_cos, bare.backlash, bare.weights):
        assert not left.any()


def test_prior_variance_is_never_below_what_was_found() -> None:
    for term in TERMS.values():
        values = values_of(term)
        variance = np.full(term.size, 1e-10)
        assert term.prior_variance(values, variance).shape == (term.size,)
        assert (term.prior_variance(values, variance) > 0.0).all()


def test_a_residual_without_centres_is_no_residual() -> None:
    none = replace(TERMS["smooth"], basis=SmoothBasis(centres=np.zeros((0, 12)), scale=BASIS.scale))
    assert none.size == 0
    np.testing.assert_allclose(error(none, np.zeros(0)), 0.0, atol=1e-12)


def test_sensitivities_come_out_of_the_same_jacobian() -> None:
    jacobian = parameter_jacobian(ROBOT, walk(ROBOT, JOINTS), JOINTS)
    by = sensitivity_of(ROBOT, jacobian)
    np.testing.assert_allclose(by.shift[:, :3], np.broadcast_to(np.eye(3), (12, 3, 3)), atol=1e-15)
    assert by.drive.shape == (12, 6, 6)
