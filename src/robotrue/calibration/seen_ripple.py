"""A model as a few postures see it: the ripple of many cycles by the shifts it makes there.

At n postures the ripple of a joint is n shifts of its drive, whatever number of cycles it has. With
b the sines and cosines of a joint at the postures and v the prior variance of their amplitudes w,

    b diag(v)^(1/2) = L Q'  (thin),      u = Q' diag(v)^(-1/2) w,      b w = L u

u has unit prior variance, as the drift between campaigns needs it, and no more coefficients than
there are postures. Fits of rows at these postures, and predictions at them, are the same with u as
with w: a contest that holds out ten parts of 30 poses costs nothing like ten fits of 3,000 columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag, svd

from robotrue.calibration.belief import Belief
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.term import ArmPostures, Effect
from robotrue.core.arrays import Array
from robotrue.robot.forward import Sensitivity
from robotrue.robot.model import RobotModel

__all__ = ["SeenRipple", "see_at_postures"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenRipple(Ripple):
    """Ripple by coefficients u of unit prior variance; amplitudes are blocks times u.

    Attributes:
        blocks: Of every joint, (2 h, k) rad, diag(v)^(1/2) Q.
    """

    blocks: tuple[Array, ...]

    @property
    def size(self) -> int:
        """Number of coefficients u."""
        return sum(block.shape[1] for block in self.blocks)

    @property
    def whole(self) -> Ripple:
        """The ripple by its amplitudes."""
        return Ripple(dof=self.dof, cycles=self.cycles)

    def amplitudes_of(self, values: Array) -> Array:
        """Returns the amplitudes (2 dof h,) rad that coefficients (k,) make."""
        ends = np.cumsum([block.shape[1] for block in self.blocks])
        parts = zip(self.blocks, np.split(values, ends[:-1]), strict=True)
        return np.concatenate([block @ part for block, part in parts])

    def columns(self, robot: RobotModel, at: ArmPostures, by: Sensitivity, values: Array) -> Array:
        """Returns d(observed)/d(u), shape (n, m, k)."""
        parts = []
        for joint, block in enumerate(self.blocks):
            shifts = _waves(at.joints[:, joint], self.cycles) @ block
            parts.append(by.drive[:, :, joint, None] * shifts[:, None, :])
        return np.concatenate(parts, axis=2)

    def effect(self, robot: RobotModel, at: ArmPostures, values: Array) -> Effect:
        """Returns the shift of the drives."""
        return self.whole.effect(robot, at, self.amplitudes_of(values))

    def prior_variance(self, values: Array, variance: Array) -> Array:
        """Returns one for every coefficient."""
        return np.ones(self.size)

    def arrays(self, values: Array) -> dict[str, Array]:
        """Returns cycles and the amplitudes that the coefficients make."""
        return dict(self.whole.arrays(self.amplitudes_of(values)))


def see_at_postures(model: CalibratedModel, joints: Array) -> CalibratedModel:
    """Returns the model with its ripple by what it does at postures (n, dof) rad, and nowhere else.

    A model with fewer amplitudes than that comes back as it is.
    """
    belief = model.belief()
    ripple = belief.ripple
    if ripple.size <= 2 * joints.size:
        return model
    place = belief.place(ripple.name)
    values, variance = belief.mean[place], belief.variance[place]
    sd = np.sqrt(ripple.prior_variance(values, variance))
    taken, blocks = [], []
    for angle, own in zip(joints.T, np.split(sd, ripple.dof), strict=True):
        turned = svd(_waves(angle, ripple.cycles) * own, full_matrices=False)[2]
        taken.append(turned / own)
        blocks.append(turned.T * own[:, None])
    seen = SeenRipple(dof=ripple.dof, cycles=ripple.cycles, blocks=tuple(blocks))
    return model_of(_replace_ripple(belief, place, seen, block_diag(*taken)), model.summary)


def _waves(angle: Array, cycles: Array) -> Array:
    """Sine and cosine (n, 2 h) of every cycle at angles (n,)."""
    phase = np.outer(angle, cycles)
    return np.stack([np.sin(phase), np.cos(phase)], axis=-1).reshape(len(angle), -1)


def _replace_ripple(belief: Belief, place: slice, seen: SeenRipple, taken: Array) -> Belief:
    """The belief with amplitudes at a place taken to the coefficients of another term."""

    def take(columns: Array) -> Array:
        before, own, behind = np.split(columns, [place.start, place.stop], axis=-1)
        return np.concatenate([before, own @ taken.T, behind], axis=-1)

    terms = tuple(seen if isinstance(term, Ripple) else term for term in belief.terms)
    return replace(belief, terms=terms, mean=take(belief.mean), root=take(belief.root))
