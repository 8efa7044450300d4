"""Structures with known modes, and what would be measured of them."""

import numpy as np

from robotrue.dynamics.frf import FrequencyResponse
from robotrue.dynamics.modal import ModalModel

AXES = ("x", "y", "z")


def modal(frequency, damping, shapes, axes=AXES):
    """Modes (k,) with mass-normalised shapes (k, r)."""
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
    damping, shapes = np.asarray(damping, dtype=float), np.asarray(shapes, dtype=float)
    poles = -damping * omega + 1j * omega * np.sqrt(1.0 - damping**2)
    residues = np.einsum("ka,kb->kab", shapes, shapes) / (2j * poles.imag)[:, None, None]
    n = shapes.shape[1]
    return ModalModel(
        poles=poles,
        residues=residues,
        upper=np.zeros((n, n)),
        lower=np.zeros((n, n)),
        static=None,
        response_axes=axes,
        excitation_axes=axes,
        valid=(0.0, 3000.0),
        source="known",
    )


def single(frequency=30.0, damping=0.03, stiffness=2e6):
    """One mode along x."""
    shape = 2.0 * np.pi * frequency / np.sqrt(stiffness)
    return modal([frequency], [damping], [[shape]], axes=("x",))


def robot_with_tool(seed=0):
    """Thirteen modes: six of an arm, two of them 0.1 Hz apart, seven of tool and spindle."""
    rng = np.random.default_rng(seed)
    frequency = [8.7, 12.9, 13.0, 30.9, 39.8, 50.5]
    damping = [0.035, 0.03, 0.03, 0.03, 0.025, 0.025]
    shapes = [rng.normal(size=3) * s for s in (0.045, 0.05, 0.04, 0.03, 0.03, 0.03)]
    for axis, hz, part, stiffness in (
        (0, 520.0, 0.05, 1.1e7), (1, 560.0, 0.045, 1.0e7), (2, 900.0, 0.04, 6e7),
        (1, 1110.0, 0.035, 1.5e7), (0, 1180.0, 0.03, 1.6e7), (1, 2280.0, 0.025, 2.0e7),
        (0, 2350.0, 0.025, 2.2e7),
    ):  # fmt: skip
        frequency.append(hz)
        damping.append(part)
        shapes.append(np.eye(3)[axis] * 2.0 * np.pi * hz / np.sqrt(stiffness))
    return modal(frequency, damping, shapes)


def measured(
    truth, *, step=0.5, highest=3000.0, lowest=4.0, noise=0.0, static=False, seed=1, first=None
):
    """The receptance of a truth on an even grid, with relative noise."""
    first = (0.0 if static else step) if first is None else first
    frequency = np.arange(first, highest + step / 2.0, step)
    response = truth.response(frequency)
    rng = np.random.default_rng(seed)
    spread = rng.normal(size=response.shape) + 1j * rng.normal(size=response.shape)
    response = response * (1.0 + noise * spread / np.sqrt(2.0))
    shape = truth.upper.shape
    return FrequencyResponse(
        frequency=frequency,
        response=response,
        response_axes=truth.response_axes,
        excitation_axes=truth.excitation_axes,
        present=np.ones(shape, dtype=bool),
        coherence=None,
        valid=(0.0 if static else lowest, float(frequency[-1])),
        measured_as="receptance" if static else "accelerance",
        static=truth.modal_static if static else None,
        source="measured",
    )
