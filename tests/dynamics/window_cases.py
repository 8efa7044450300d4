"""Windows made from a compliant arm with planted factors: no milling, just the bending."""

import numpy as np

from robotrue.core.units import UM
from robotrue.dynamics.deviation_physics import CompliantArm, physics_terms
from robotrue.dynamics.windows import WindowSet
from robotrue.simulation.milling_arm import STIFFNESS, milling_robot, pass_joints
from robotrue_reproductions.jin2022.milling_pass import SHIFTS

FACTORS = np.array([1.2, 0.9, 1.1, 0.8, 1.25, 0.95])


def stated_arm():
    direction = np.array([0.0, -1.0, 0.0])
    return CompliantArm(robot=milling_robot(), stiffness=STIFFNESS, direction=direction)


def planted(passes=(0, 1, 2), each=40, noise=0.2 * UM, seed=1):
    """Measured error: planted bending, a sine of the place, noise. Predicted: one pose's."""
    rng, parts = np.random.default_rng(seed), []
    for k in passes:
        along = np.linspace(0.0, 0.49, each)
        force = np.array([-30.0, -4.0, 4.0]) * (1.0 + 0.04 * rng.standard_normal((each, 3)))
        windows = WindowSet(
            passes=(f"p{k}",) * each,
            joints=pass_joints(along, SHIFTS[k]),
            force=force,
            force_peak=np.abs(force[:, 1]) + 70.0 + rng.standard_normal(each),
            force_mean=force[:, 1],
            predicted=15 * UM - 2.0 * UM * force[:, 1] - 0.3 * UM * force[:, 0],
            measured=np.zeros(each),
        )
        bent = physics_terms(stated_arm(), windows).by_joint @ FACTORS
        slow = 0.5 * UM * np.sin(40.0 * along + k)
        measured = 15 * UM + bent + slow + noise * rng.standard_normal(each)
        parts.append((windows, measured))
    first = parts[0][0]
    join = {
        name: np.concatenate([getattr(w, name) for w, _ in parts])
        for name in ("joints", "force", "force_peak", "force_mean", "predicted")
    }
    return WindowSet(
        passes=sum((w.passes for w, _ in parts), ()),
        measured=np.concatenate([m for _, m in parts]),
        source=first.source,
        **join,
    )
