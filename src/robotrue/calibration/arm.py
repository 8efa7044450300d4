"""The calibrated arm at postures: its error, and the derivative of that by every coefficient.

    error = chain(actual, q + drive shifts of the terms) + tip shifts - chain(nominal, q)

Coefficients come in one order everywhere: the robot's error vector, then the parameters of each
term. :func:`robotrue.calibration.observations.linear_rows` makes the columns of whatever else is
observed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robotrue.calibration.terms.term import ArmPostures, Term
from robotrue.core.arrays import Array
from robotrue.core.conditions import ArmConditions, no_conditions
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.robot.forward import forward, parameter_jacobian, sensitivity_of, walk
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.robot.statics import Load, stated_torque


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearArm:
    """Some postures, linearised in every coefficient.

    Attributes:
        tip: (n, 3) m, actual tool point in base.
        error: (n, 3) m, actual minus commanded tool point, base axes.
        rotation: (n, 3, 3) actual orientation relative to the commanded one, base axes.
        columns: (n, 3, p) derivative of the error by the coefficients.
        uncarried: (n,) m^2 per axis of variance that no coefficient carries.
    """

    tip: Array
    error: Array
    rotation: Array
    columns: Array
    uncarried: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmWithTerms:
    """An arm, its terms, and the tool of the query: everything that postures share.

    Attributes:
        actual: The arm with its errors and that tool.
        nominal: The same without errors.
        compliance: (dof,) rad/(N m).
        terms: Beyond the error vector.
        values: (k,) their parameters, one term after the other; zeros if None.
        other_tool: Columns of another tool than was measured, whose errors are not known; None
            where it is the measured one.
    """

    actual: RobotModel
    nominal: RobotModel
    compliance: Array
    terms: Sequence[Term]
    values: Array | None
    other_tool: slice | None

    def linearise(self, joints: Array, load: Load, approach: Array | None = None) -> LinearArm:
        """Returns the error of the arm, linearised; arguments as :meth:`postures`."""
        return self.linearise_at(self.postures(joints, load, approach))

    def postures(
        self,
        joints: Array,
        load: Load,
        approach: Array | None = None,
        conditions: ArmConditions | None = None,
    ) -> ArmPostures:
        """Returns postures with the torques on the drives.

        Args:
            joints: (n, dof) rad.
            load: One row or n.
            approach: (n, dof) sign of the last motion; unknown if not given.
            conditions: One row or n; unknown if not given.
        """
        torque, weight = stated_torque(self.nominal, joints, load)
        return ArmPostures(
            joints=joints,
            torque=torque,
            weight=weight,
            approach=np.empty(0) if approach is None else approach,
            conditions=(conditions or no_conditions()).spread(len(joints)),
        )

    def linearise_at(self, at: ArmPostures) -> LinearArm:
        """Returns the error of the arm at some of its :meth:`postures`, linearised."""
        drive_shifts: list[Array] = []
        lift, uncarried = np.zeros((len(at.joints), 3)), np.zeros(len(at.joints))
        errors: list[Array] = []
        for term, part in parts_of(self.terms, self.values):
            effect = term.effect(self.actual, at, part)
            if effect.drive_shift is not None:
                drive_shifts.append(effect.drive_shift)
            if effect.tip_shift is not None:
                lift = lift + effect.tip_shift
            if effect.error_shift is not None:
                errors.append(effect.error_shift)
            if effect.uncarried is not None:
                uncarried = uncarried + effect.uncarried
            if self.other_tool is not None:
                uncarried = uncarried + effect.other_tool
        torque = at.torque_on(self.actual)
        shift = sum(drive_shifts, start=torque * self.compliance)
        commanded = forward(self.nominal, at.joints)
        state = walk(self.actual, at.joints, shift)
        twists = parameter_jacobian(self.actual, state, at.joints, torque, at.weight)
        rotation = state.rotation
        if errors:
            twist = (twists @ np.sum(errors, axis=0)[:, :, None])[:, :, 0]
            lift = lift + twist[:, :3]
            rotation = matrix_from_rotation_vector(twist[:, 3:]) @ rotation
        jacobian = twists[:, :3]
        by = sensitivity_of(self.actual, jacobian)
        learned = [
            term.columns(self.actual, at, by, part)
            for term, part in parts_of(self.terms, self.values)
        ]
        columns = np.concatenate([jacobian, *learned], axis=2)
        if self.other_tool is not None:
            columns[:, :, self.other_tool] = 0.0
        tip = state.position + lift
        return LinearArm(
            tip=tip,
            error=tip - commanded[:, :3, 3],
            rotation=rotation @ np.swapaxes(commanded[:, :3, :3], 1, 2),
            columns=columns,
            uncarried=uncarried,
        )


def prepare_arm(
    actual: RobotModel,
    T_flange_tool: Array | None = None,
    *,
    terms: Sequence[Term] = (),
    values: Array | None = None,
) -> ArmWithTerms:
    """Returns an arm ready to be linearised.

    Args:
        actual: The arm with its errors, and the tool that was measured.
        T_flange_tool: Another tool; its columns of tool errors are zero.
        terms: Beyond the error vector.
        values: (k,) their parameters, one term after the other.
    """
    if T_flange_tool is not None:
        actual = actual.with_tool(T_flange_tool)
    return ArmWithTerms(
        actual=actual,
        nominal=actual.nominal(),
        compliance=actual.error("compliance"),
        terms=terms,
        values=values,
        other_tool=None if T_flange_tool is None else parameter_slice(actual.dof, "tool"),
    )


def term_columns(
    robot: RobotModel, at: ArmPostures, jacobian: Array, terms: Sequence[Term], values: Array | None
) -> tuple[list[Array], Array]:
    """Returns the columns of the terms for observed rows, and what their linear part leaves (n, m).

    Residuals taken without the terms are columns @ (all coefficients) + what is left: zero where
    all terms are linear.

    Args:
        robot: The arm with the errors it is linearised at.
        at: n postures.
        jacobian: (n, m, 9 dof + 12 or more) d(observed)/d(error vector, nuisances).
        terms: Beyond the error vector.
        values: (k,) their parameters where they are linearised; zeros if None.
    """
    by = sensitivity_of(robot, jacobian)
    columns: list[Array] = []
    left = np.zeros(jacobian.shape[:2])
    for term, part in parts_of(terms, values):
        columns.append(term.columns(robot, at, by, part))
        if term.linear:
            continue
        effect = term.effect(robot, at, part)
        left -= columns[-1] @ part
        if effect.drive_shift is not None:
            left += np.einsum("nmd,nd->nm", by.drive, effect.drive_shift)
        if effect.tip_shift is not None:
            left += np.einsum("nmx,nx->nm", by.shift, effect.tip_shift)
        if effect.error_shift is not None:
            left += np.einsum("nmp,np->nm", by.errors, effect.error_shift)
    return columns, left


def parts_of(terms: Sequence[Term], values: Array | None) -> Iterator[tuple[Term, Array]]:
    """Yields each term with its parameters (k,); zeros without values."""
    start = 0
    for term in terms:
        stop = start + term.size
        yield term, np.zeros(term.size) if values is None else values[start:stop]
        start = stop
