"""Accuracy of a model at sockets it never saw, without any instrument.

The ball does not move while the arm takes attitude after attitude; where a model predicts that it
does, the model is wrong. The place of the socket is not known, so the tips are compared with their
own mean, and an error that all attitudes of one socket share does not show. The distance of two
sockets of one fixture shows a part of that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np

from robotrue.calibration.machined import tip_columns, uncarried_variance
from robotrue.calibration.model import ErrorModel, Query, require_belief
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import EMPTY, Column, Columns
from robotrue.core.robust import LEVEL, chi_point
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.statics import NO_LOAD, Load

FitTouches: TypeAlias = Callable[[ProbingSet], ErrorModel]


@dataclass(frozen=True, slots=True, kw_only=True)
class SocketSpread(Columns):
    """Predicted places of the ball, touch by touch.

    Attributes:
        distance: (n,) m from the mean of the touch's own socket.
        names: (n) of the sockets.
        length_error: (k,) m, predicted minus known distance of two sockets.
        inside: (n,) whether the touch lies in its 95 % region; empty where none was requested.
    """

    distance: Annotated[Array, Column("_", unit="m")]
    names: tuple[str, ...]
    length_error: Annotated[Array, Column("_", unit="m")]
    inside: Annotated[BoolArray, Column("_")] = EMPTY

    @property
    def mean(self) -> float:
        """Mean distance, m."""
        return float(self.distance.mean())

    @property
    def coverage(self) -> float:
        """Share of touches inside their 95 % regions; NaN if none was requested."""
        return float(self.inside.mean()) if len(self.inside) else float("nan")

    @property
    def rms(self) -> float:
        """Root mean square distance, m."""
        return float(np.sqrt((self.distance**2).mean()))

    @property
    def largest(self) -> float:
        """Largest distance, m."""
        return float(self.distance.max())


def tip_positions(model: ErrorModel, touches: ProbingSet, *, payload: Load = NO_LOAD) -> Array:
    """Returns where the model predicts the tip at every touch, (n, 3) m in base.

    Raises:
        ModelMismatchError: Joints of another arm, or none.
    """
    robot = model.robot.nominal()
    if not touches.has_joints or touches.joints.shape[1] != robot.dof:
        raise ModelMismatchError(
            f"touches with {touches.joints.shape[1]} joints, {robot.name} has {robot.dof}."
        )
    error = model.predict(Query(joints=touches.joints, load=payload)).error
    return np.asarray(forward(robot, touches.joints)[:, :3, 3] + error)


def socket_spread(
    model: ErrorModel,
    touches: ProbingSet,
    *,
    payload: Load = NO_LOAD,
    touch_sigma: float | None = None,
) -> SocketSpread:
    """Returns the spread of the predicted ball positions in each socket.

    Args:
        model: Fitted without these touches.
        touches: Of sockets.
        payload: On the flange while touching.
        touch_sigma: m per axis of one touch, without the arm, as stated for the fit; where given,
            every touch is compared with its 95 % region about the mean of its socket.

    Raises:
        ObservabilityError: Touches that are in no socket, or a socket touched once.
        ModelMismatchError: Joints of another arm.
    """
    tips = tip_positions(model, touches, payload=payload)
    centre = {}
    distance = np.empty(len(touches))
    for k in touches.parts:
        mine = touches.part == k
        if k not in touches.sockets or mine.sum() < 2:
            raise ObservabilityError(
                f"part {k} is no socket, or touched {int(mine.sum())} times; a spread needs a "
                "socket touched from two attitudes or more."
            )
        centre[k] = tips[mine].mean(axis=0)
        distance[mine] = np.linalg.norm(tips[mine] - centre[k], axis=1)
    lengths = [
        np.linalg.norm(centre[d.second] - centre[d.first]) - d.length for d in touches.distances
    ]
    inside = np.empty(0, dtype=np.bool_)
    if touch_sigma is not None:
        away = tips - np.stack([centre[int(k)] for k in touches.part])
        covariance = _about_mean(model, touches, payload, touch_sigma)
        square = np.einsum("ni,nij,nj->n", away, np.linalg.inv(covariance), away)
        inside = np.asarray(square <= chi_point(LEVEL, 3) ** 2)
    return SocketSpread(
        distance=distance,
        names=touches.names,
        length_error=np.array(lengths, dtype=np.float64),
        inside=inside,
    )


def _about_mean(model: ErrorModel, touches: ProbingSet, payload: Load, touch_sigma: float) -> Array:
    """Covariance (n, 3, 3) m^2 of each tip less the mean of its socket: shared errors cancel."""
    belief = require_belief(model)
    query = Query(joints=touches.joints, load=payload)
    columns = tip_columns(belief, query)
    visit = belief.white**2 + belief.repeatability**2 + uncarried_variance(belief, query)
    own = touch_sigma**2 + belief.inflation * np.broadcast_to(visit, len(touches))
    out = np.empty((len(touches), 3, 3))
    for k in touches.parts:
        mine = touches.part == k
        half = (columns[mine] - columns[mine].mean(axis=0)) @ belief.root.T
        # The mean takes its share of every touch's own noise with it.
        left = own[mine] * (1.0 - 1.0 / int(mine.sum()))
        shared = belief.inflation * half @ np.swapaxes(half, 1, 2)
        out[mine] = shared + left[:, None, None] * np.eye(3)
    return out


def hold_out_places(
    fit: FitTouches,
    touches: ProbingSet,
    places: Mapping[str, Sequence[int]],
    *,
    payload: Load = NO_LOAD,
    touch_sigma: float | None = None,
) -> dict[str, SocketSpread]:
    """Returns, by place, the spread in sockets of that place after fitting on all other places.

    Whatever the fit chooses it must choose inside: it is handed the other places alone.

    Args:
        fit: From touches to a model.
        touches: Of all places.
        places: Part numbers of the sockets at each place.
        payload: On the flange while touching.
        touch_sigma: As for :func:`socket_spread`.

    Raises:
        ConfigurationError: Fewer than two places, or a socket at two or none of them.
    """
    listed = sorted(k for sockets in places.values() for k in sockets)
    if len(places) < 2 or listed != sorted(touches.parts):
        raise ConfigurationError(
            f"{len(places)} places with sockets {listed}; expected two or more, and each of "
            f"{sorted(touches.parts)} at one of them."
        )
    out = {}
    for name, sockets in places.items():
        held = np.isin(touches.part, list(sockets))
        model = fit(touches.subset(~held))
        out[name] = socket_spread(
            model, touches.subset(held), payload=payload, touch_sigma=touch_sigma
        )
    return out


def choose_by_places(
    candidates: Mapping[str, FitTouches],
    touches: ProbingSet,
    places: Mapping[str, Sequence[int]],
    *,
    payload: Load = NO_LOAD,
) -> tuple[str, dict[str, float]]:
    """Returns the candidate that holds the ball best in held-out places, and the mean of each, m.

    Args:
        candidates: Fits by name, the simplest first: it wins a tie.
        touches: Of the places there are to learn from, and of no other.
        places: Part numbers of the sockets at each.
        payload: On the flange while touching.

    Raises:
        ConfigurationError: Fewer than two places, or no candidate.
    """
    if not candidates:
        raise ConfigurationError("no fit to choose from.")
    means = {}
    for name, fit in candidates.items():
        held = hold_out_places(fit, touches, places, payload=payload)
        means[name] = float(np.concatenate([s.distance for s in held.values()]).mean())
    return min(means, key=lambda name: means[name]), means


def hold_out_touches(
    fit: FitTouches, touches: ProbingSet, *, folds: int, seed: int, payload: Load = NO_LOAD
) -> SocketSpread:
    """Returns distances of single touches, held out at random, from the others of their socket.

    Measures the model's interpolation with all places in the training data: the residual of noise
    and handling. Held-out places in contrast show the loss elsewhere in the workspace.

    Args:
        fit: From touches to a model.
        touches: Of all places.
        folds: Parts of equal size, each held out once.
        seed: Of the shuffle.
        payload: On the flange while touching.

    Raises:
        ConfigurationError: Fewer than two folds.
        ObservabilityError: A socket left without touches by a fold.
    """
    if folds < 2:
        raise ConfigurationError(f"{folds} folds, expected 2 or more.")
    fold = np.random.default_rng(seed).permutation(len(touches)) % folds
    distance = np.empty(len(touches))
    for k in range(folds):
        held = fold == k
        tips = tip_positions(fit(touches.subset(~held)), touches, payload=payload)
        for part in touches.parts:
            mine = touches.part == part
            if not (mine & ~held).any():
                raise ObservabilityError(f"fold {k + 1} holds out every touch of socket {part}.")
            centre = tips[mine & ~held].mean(axis=0)
            out = mine & held
            distance[out] = np.linalg.norm(tips[out] - centre, axis=1)
    return SocketSpread(distance=distance, names=touches.names, length_error=np.empty(0))
