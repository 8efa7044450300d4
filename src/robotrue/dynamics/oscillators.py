"""Modes as the filters take them: one complex state each, what excites it and what it moves.

With poles p_k in the upper half plane, v_k what excites and u_k what responds, the receptance is::

    G(s) = sum_k [ u_k v_k^T / (s - p_k) + conj ] + residual
    z_k' = p_k z_k + v_k . f,    x = 2 Re sum_k u_k z_k + residual f

A mode whose residue has rank one (every mode of a structure) is one oscillator; a residue of a
noisy fit may have rank two or three and then is as many, with one pole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns, concat
from robotrue.dynamics.frf import AXES, ComplexArray
from robotrue.dynamics.modal import ModalModel
from robotrue.errors import ConfigurationError, ShapeError

RANK: Final = 1e-9
"""Singular values below this part of a mode's largest are rounding and not a further oscillator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillators(Columns):
    """A receptance as single complex oscillators. SI, force and displacement along x, y, z.

    Attributes:
        poles: (n,) rad/s, real part below and imaginary part above zero.
        excite: (n, 3), force to state.
        respond: (n, 3), state to displacement; ``respond * excite`` is in m/(N s).
        residual: (3, 3) m/N, what follows the force at once.
    """

    poles: Annotated[ComplexArray, Column("n", unit="rad/s")]
    excite: Annotated[ComplexArray, Column("n 3")]
    respond: Annotated[ComplexArray, Column("n 3")]
    residual: Annotated[Array, Column("3 3", unit="m/N")]

    def _check_rules(self) -> None:
        """Checks stability."""
        if len(self.poles) and not (self.poles.real.max() < 0.0 < self.poles.imag.min()):
            raise ShapeError(
                "poles need a real part below and an imaginary part above zero: "
                "modes that decay and are damped less than critically."
            )

    def __len__(self) -> int:
        return len(self.poles)

    @property
    def static(self) -> Array:
        """(3, 3) m/N, displacement under a constant force."""
        each = self.respond[:, :, None] * self.excite[:, None, :] / self.poles[:, None, None]
        return np.asarray(self.residual - 2.0 * each.real.sum(axis=0))

    def response(self, frequency: Array) -> ComplexArray:
        """Returns the receptance (m, 3, 3) m/N at frequencies (m,) Hz."""
        s = 2j * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
        one = np.einsum("mk,ki,kj->mij", 1.0 / (s - self.poles), self.respond, self.excite)
        two = np.einsum(
            "mk,ki,kj->mij", 1.0 / (s - self.poles.conj()), self.respond.conj(), self.excite.conj()
        )
        return np.asarray(one + two + self.residual)


def join_oscillators(parts: list[Oscillators]) -> Oscillators:
    """Returns the receptances of several structures in series, added up: robot, spindle, tool."""
    return concat(parts, residual=np.add.reduce([p.residual for p in parts]))


def real_modes(frequency: Array, damping: Array, shape: Array) -> Oscillators:
    """Returns oscillators of modes with real shapes: normal coordinates, damping in proportion.

    State and normal coordinate eta belong together by eta = Im(z) / omega_d.

    Args:
        frequency: (k,) Hz, undamped.
        damping: (k,) part of critical.
        shape: (k, 3) kg^-1/2, displacement of the tool in mass-normalised modes: mode k adds
            ``shape shape^T / omega^2`` m/N to the static deflection.

    Raises:
        ShapeError: Damping at or above critical, or not above zero.
    """
    omega, zeta = 2.0 * np.pi * np.asarray(frequency), np.asarray(damping)
    if not ((zeta > 0.0) & (zeta < 1.0)).all():
        raise ShapeError(f"damping {zeta}, expected above 0 and below 1 of critical.")
    damped = omega * np.sqrt(1.0 - zeta**2)
    return Oscillators(
        poles=-zeta * omega + 1j * damped,
        excite=np.asarray(shape, dtype=np.complex128),
        respond=shape / (2j * damped[:, None]),
        residual=np.zeros((3, 3)),
    )


def oscillators_of(model: ModalModel) -> Oscillators:
    """Returns a modal model as oscillators; where it has a static deflection, with that.

    Axes the model does not have neither excite nor respond.

    Raises:
        ConfigurationError: The model has a lower residual: it has no static deflection to filter.
    """
    if model.lower.any():
        raise ConfigurationError(
            "a modal model with a lower residual cannot be filtered in time: it grows without "
            "limit towards 0 Hz.",
            source=model.source,
            hint="fit it with the static deflection of a load test and without lower residual.",
        )
    rows = [AXES.index(a) for a in model.response_axes]
    columns = [AXES.index(a) for a in model.excitation_axes]
    poles, excite, respond = [], [], []
    for pole, residue in zip(model.poles, model.residues, strict=True):
        full = np.zeros((3, 3), dtype=np.complex128)
        full[np.ix_(rows, columns)] = residue
        left, size, right = np.linalg.svd(full)
        for j in np.flatnonzero(size > RANK * max(size[0], np.finfo(float).tiny)):
            poles.append(pole)
            respond.append(left[:, j] * size[j])
            excite.append(right[j])
    residual = np.zeros((3, 3))
    residual[np.ix_(rows, columns)] = model.upper + model.at_rest - model.modal_static
    return Oscillators(
        poles=np.array(poles).reshape(-1),
        excite=np.array(excite).reshape(-1, 3),
        respond=np.array(respond).reshape(-1, 3),
        residual=residual,
    )
