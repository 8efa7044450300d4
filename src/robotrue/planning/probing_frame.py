"""Touches for a run with the model as it is: the frame is all that the touches change.

The frame is the least-squares fit to the touches, ``step = N^-1 B`` with N = sum A' A over them,
A = [I, -lever x], and B = sum A' J of the arm's own errors, which touching and machining share. A
machined point keeps ``J_m - G N^-1 B`` of them (:mod:`robotrue.calibration.machined`), so a touch
can also make things worse: it draws the frame towards its own posture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Final

import numpy as np

from robotrue.calibration.machined import tip_columns, uncarried_variance
from robotrue.calibration.model import Query
from robotrue.calibration.update import carry_residual
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column
from robotrue.core.poses import displacement_columns
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.planning.criteria import BETTER
from robotrue.planning.plan_defaults import GOAL
from robotrue.planning.probing import ProbingTask
from robotrue.planning.probing_plan import (
    MORE_FEATURES,
    Goal,
    ProbePlan,
    TouchPosterior,
)

LEAST: Final = 3
"""Touches of points that a frame needs."""
SWEEPS: Final = 2
"""Passes of the exchange over a plan, at most."""
LINE: Final = 1e-2
"""m; touches nearer to one line than this, rms, fix no frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTask(TouchPosterior):
    """The task for least-squares frames. Base axes; k directions of the arm's belief, each of sd 1.

    Attributes:
        touch: (c, 3, 6) A: what a step of the frame (about the part's origin) does at a candidate.
        touch_error: (c, 3, k) m, the arm's own error there.
        noise: (c,) m^2 per axis of a touch.
        part: (c,) frame a candidate belongs to, counted from 0.
        work: (n, 3, 6) G, the same at the machined points.
        work_error: (n, 3, k) m.
        visit: (n,) m^2 per axis, what differs from visit to visit.
        work_part: (n,) frame of each machined point.
        turn: (n, 3, 3) R_base_part.
    """

    touch: Annotated[Array, Column("c 3 6")]
    touch_error: Annotated[Array, Column("c 3 k", unit="m")]
    noise: Annotated[Array, Column("c", unit="m^2")]
    part: Annotated[IntArray, Column("c")]
    work: Annotated[Array, Column("n 3 6")]
    work_error: Annotated[Array, Column("n 3 k", unit="m")]
    visit: Annotated[Array, Column("n", unit="m^2")]
    work_part: Annotated[IntArray, Column("n")]
    turn: Annotated[Array, Column("n 3 3")]
    rounds: ClassVar[int] = 3

    def part_sums(self, chosen: IntArray, part: int) -> tuple[Array, Array, Array]:
        """Returns N (6, 6), B (6, k) and sum A' A times the noise over the touches of a part."""
        mine = chosen[self.part[chosen] == part]
        lift = np.swapaxes(self.touch[mine], 1, 2)
        normal = lift @ self.touch[mine]
        noisy = (normal * self.noise[mine, None, None]).sum(axis=0)
        return normal.sum(axis=0), (lift @ self.touch_error[mine]).sum(axis=0), noisy

    def covariance(self, chosen: IntArray) -> Array:
        """Returns the covariance (m, 3, 3) m^2, in the part, of each machined point."""
        out = self.visit[:, None, None] * np.eye(3)
        for part in np.unique(self.work_part).tolist():
            mine = self.work_part == part
            normal, shared, noisy = self.part_sums(chosen, part)
            inverse = np.linalg.inv(normal)
            left = self.work_error[mine] - self.work[mine] @ (inverse @ shared)
            frame = inverse @ noisy @ inverse
            step = self.work[mine] @ frame @ np.swapaxes(self.work[mine], 1, 2)
            out[mine] += left @ np.swapaxes(left, 1, 2) + step
        return np.asarray(np.swapaxes(self.turn, 1, 2) @ out @ self.turn)

    def costs(self, chosen: IntArray, weight: Array) -> Array:
        """Returns the weighted sum of squares (c,) m^2 with each candidate added; inf: no frame."""
        out = np.zeros(len(self.part))
        for part in np.unique(self.work_part).tolist():
            mine = np.flatnonzero(self.work_part == part)
            here = np.flatnonzero(self.part == part)
            normal, shared, noisy = self.part_sums(chosen, part)
            w = weight[mine][:, None, None]
            lift = np.swapaxes(self.work[mine], 1, 2) * w
            both = (lift @ self.work[mine]).sum(axis=0)  # sum G' G
            cross = (lift @ self.work_error[mine]).sum(axis=0)  # sum G' E
            alone = float((w * self.work_error[mine] ** 2).sum())
            up = np.swapaxes(self.touch[here], 1, 2)
            added = up @ self.touch[here]
            inverse = np.linalg.inv(normal + added)
            step = inverse @ (shared + up @ self.touch_error[here])
            noise = inverse @ (noisy + added * self.noise[here, None, None]) @ inverse
            value = alone - 2.0 * np.einsum("nik,ik->n", step, cross)
            value += np.einsum("nik,ij,njk->n", step, both, step, optimize=True)
            value += np.einsum("nij,ji->n", noise, both)
            now = np.linalg.inv(normal)
            still = now @ shared
            kept = alone - 2.0 * float((still * cross).sum())
            kept += float((still * (both @ still)).sum())
            kept += float(np.trace(now @ noisy @ now @ both))
            out += kept
            out[here] += value - kept
        return out

    def _fixes_frames(self, chosen: IntArray) -> bool:
        for part in np.unique(self.work_part).tolist():
            mine = chosen[self.part[chosen] == part]
            if len(mine) < LEAST:
                return False
            point = self._centre_points(mine)
            if np.linalg.svd(point, compute_uv=False)[1] < LINE * np.sqrt(len(mine)):
                return False
        return True

    def _search(self, n: int, weight: Array) -> IntArray:
        """Three far apart for every frame, the best added, then exchanged."""
        chosen = self._seeds()
        while len(chosen) < n:
            costs = self.costs(chosen, weight)
            costs[chosen] = np.inf
            chosen = np.append(chosen, np.argmin(costs))
        return self._exchange(chosen[:n], weight)

    def _losses(self, chosen: IntArray, weight: Array) -> Array:
        out = np.full(len(chosen), np.inf)
        for place in range(len(chosen)):
            others = np.delete(chosen, place)
            if self._fixes_frames(others):
                out[place] = weight @ self.squares(others)
        return out

    def _uncertainty_at_touches(self, chosen: IntArray) -> float:
        own = replace(
            self,
            work=self.touch[chosen],
            work_error=self.touch_error[chosen],
            visit=np.full(len(chosen), float(np.median(self.visit))),
            work_part=self.part[chosen],
            turn=np.broadcast_to(np.eye(3), (len(chosen), 3, 3)),
        )
        return float(np.sqrt(np.median(own.squares(chosen))))

    def _best_for(self, machined: IntArray, n: int, goal: Goal) -> tuple[float, str, str]:
        """Returns the uncertainty after as many points if they serve these points alone."""
        alone = self.take(machined)
        count = max(n, LEAST * len(np.unique(alone.work_part)))
        square = alone.squares(alone.choose(count, len(machined), goal))
        least = float(np.sqrt(square.mean()))
        cure = f"its own frame, from {count} touches, would leave {least * 1e3:.2f} mm"
        return least, cure, f"{cure}: {MORE_FEATURES}"

    def _centre_points(self, rows: IntArray) -> Array:
        """Points (n, 3) m of candidates about their middle, base axes."""
        lever = self.touch[rows, :, 3:]
        point = np.stack([lever[:, 1, 2], lever[:, 2, 0], lever[:, 0, 1]], axis=1)
        return np.asarray(point - point.mean(axis=0))

    def _seeds(self) -> IntArray:
        """Three touches far apart for every frame that will be machined in."""
        seeds: list[int] = []
        for part in np.unique(self.work_part).tolist():
            mine = np.flatnonzero(self.part == part)
            if len(mine) < LEAST:
                name = f"part {np.unique(self.candidates.part)[part]}"
                raise ObservabilityError(f"{name} has {len(mine)} candidates, its frame needs 3.")
            point = self.candidates.point[mine]
            a = int(np.argmax(np.linalg.norm(point - point.mean(axis=0), axis=1)))
            b = int(np.argmax(np.linalg.norm(point - point[a], axis=1)))
            along = (point[b] - point[a]) / max(float(np.linalg.norm(point[b] - point[a])), LINE)
            off = np.linalg.norm(np.cross(point - point[a], along), axis=1)
            c = int(np.argmax(off))
            if off[c] < LINE:
                raise ObservabilityError(
                    f"the candidates of part {self.candidates.part[mine[0]]} lie on one line, "
                    f"{off[c] * 1e3:.1f} mm off it at most.",
                    hint="features to the side of that line.",
                )
            seeds += [mine[a], mine[b], mine[c]]
        return np.array(seeds, dtype=np.int64)

    def _exchange(self, chosen: IntArray, weight: Array) -> IntArray:
        """Exchanges single points while the sum of squares falls and every frame is determined."""
        now = chosen.copy()
        for _ in range(SWEEPS):
            moved = False
            for place in range(len(now)):
                others = np.delete(now, place)
                if not self._fixes_frames(others):
                    continue
                costs = self.costs(others, weight)
                old = costs[now[place]]
                costs[others] = np.inf
                best = int(np.argmin(costs))
                if costs[best] < old * (1.0 - BETTER):
                    now[place], moved = best, True
            if not moved:
                break
        return now


def frame_task(task: ProbingTask) -> FrameTask:
    """Returns the task for least-squares frames.

    Raises:
        ConfigurationError: Candidates that are not full points.
    """
    candidates, machining = task.candidates, task.machining
    if not candidates.full.all():
        raise ConfigurationError(
            "a least-squares frame is planned from feature points; some candidates are touches of "
            "surfaces.",
            hint="leave out the normals of full points, or plan for a compensated run.",
        )
    belief = carry_residual(task.belief, np.vstack([candidates.joints, machining.joints]))
    root = belief.root * np.sqrt(belief.inflation)
    touched = Query(joints=candidates.joints, load=task.touch_load)
    parts = np.array(sorted(task.T_base_part))
    scatter = belief.inflation * belief.white**2 + belief.repeatability**2
    own = belief.inflation * uncarried_variance(belief, touched)
    later = belief.inflation * uncarried_variance(belief, machining.query)
    turn = _turns(task, machining.part)
    return FrameTask(
        candidates=candidates,
        touch=_levers(_turns(task, candidates.part), candidates.point),
        touch_error=tip_columns(belief, touched) @ root.T,
        noise=scatter + task.touch_sigma**2 + own,
        part=np.searchsorted(parts, candidates.part),
        work=_levers(turn, machining.point),
        work_error=tip_columns(belief, machining.query) @ root.T,
        visit=scatter + later,
        work_part=np.searchsorted(parts, machining.part),
        turn=turn,
    )


def _turns(task: ProbingTask, part: IntArray) -> Array:
    return np.stack([task.T_base_part[int(k)][:3, :3] for k in part])


def _levers(turn: Array, point: Array) -> Array:
    lever = (turn @ point[:, :, None])[:, :, 0]
    return displacement_columns(lever)


def plan_frame_touches(
    task: ProbingTask, n: int, *, goal: Goal = GOAL, tolerance: float = 0.0
) -> ProbePlan:
    """Returns up to n touches for a run with the model as it is and least-squares frames.

    Arguments as :func:`robotrue.planning.probing.plan_touches`. The expected uncertainty is NaN
    where the touches do not yet fix the frames.

    Raises:
        ConfigurationError: Candidates that are not full points, or fewer than touches.
        ObservabilityError: Fewer than 3 touches for each part, or candidates all on one line.
    """
    frames = frame_task(task)
    candidates = len(task.candidates)
    parts = len(np.unique(frames.work_part))
    if not LEAST * parts <= n <= candidates:
        raise ObservabilityError(
            f"{n} touches are requested: {parts} frames need at least {LEAST * parts}, and there "
            f"are {candidates} candidates.",
            hint="more touches, or more features.",
        )
    return frames.plan(task.machining.groups, n, goal, tolerance)
