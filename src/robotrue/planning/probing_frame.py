"""Touches for a run with the model as it is: the frame is all that the touches change.

The frame is the least-squares fit to the touches, ``step = N^-1 B`` with N = sum A' A over them,
A = [I, -lever x], and B = sum A' J of the arm's own errors, which touching and machining share. A
machined point keeps ``J_m - G N^-1 B`` of them (:mod:`robotrue.calibration.machined`), so a touch
can also make things worse: it draws the frame towards its own posture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.machined import tip_columns, uncarried
from robotrue.calibration.model import Query
from robotrue.calibration.update import carry_residual
from robotrue.core.arrays import Array, IntArray
from robotrue.core.rotations import skew
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.planning.probing import (
    FACTOR,
    POWER,
    Goal,
    GroupCover,
    ProbePlan,
    ProbingTask,
    spread_touches,
)

LEAST: Final = 3
"""Touches of points that a frame needs."""
SWEEPS: Final = 2
"""Passes of the exchange over a plan, at most."""
REWEIGHTED: Final = 3
"""Plans made for the worst point, with weights that grow where the last one left most."""
BETTER: Final = 1e-6
"""Relative gain below which an exchange is none."""
LINE: Final = 1e-2
"""m; touches nearer to one line than this, rms, fix no frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameTask:
    """The task for least-squares frames. Base axes; k directions of the arm's belief, each of sd 1.

    Attributes:
        touch: (c, 3, 6) A: what a step of the frame (about the part's origin) does at a candidate.
        touch_error: (c, 3, k) m, the arm's own error there.
        noise: (c,) m^2 per axis of a touch.
        part: (c,) frame a candidate belongs to, counted from 0.
        work: (m, 3, 6) G, the same at the machined points.
        work_error: (m, 3, k) m.
        visit: (m,) m^2 per axis, what differs from visit to visit.
        work_part: (m,) frame of each machined point.
        turn: (m, 3, 3) R_base_part.
    """

    touch: Array
    touch_error: Array
    noise: Array
    part: IntArray
    work: Array
    work_error: Array
    visit: Array
    work_part: IntArray
    turn: Array

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
    own = belief.inflation * uncarried(belief, touched)
    later = belief.inflation * uncarried(belief, machining.query)
    turn = _turns(task, machining.part)
    return FrameTask(
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
    axes = np.broadcast_to(np.eye(3), (len(point), 3, 3))
    return np.concatenate([axes, -skew(lever)], axis=2)


def plan_frame_touches(
    task: ProbingTask, n: int, *, goal: Goal = "mean", tolerance: float = 0.0
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
            f"{n} touches are asked for: {parts} frames need at least {LEAST * parts}, and there "
            f"are {candidates} candidates.",
            hint="more touches, or more features.",
        )
    chosen = _choose_touches(frames, task, n, goal)
    mean, worst = _trace_order(frames, chosen)
    kept = _enough(mean if goal == "mean" else worst, tolerance)
    chosen, mean, worst = chosen[:kept], mean[: kept + 1], worst[: kept + 1]
    return ProbePlan(
        touches=task.candidates.subset(chosen),
        row=chosen,
        goal=goal,
        mean=mean,
        worst=worst,
        spread_mean=_trace_order(frames, spread_touches(task.candidates, kept))[0],
        covariance=frames.covariance(chosen),
        groups=_cover(frames, task, chosen, goal),
        stopped=kept < n,
    )


def _choose_touches(frames: FrameTask, task: ProbingTask, n: int, goal: Goal) -> IntArray:
    weight = np.ones(len(frames.visit))
    found, left = np.empty(0, dtype=np.int64), np.inf
    start = _seeds(frames, task)
    for _ in range(1 if goal == "mean" else REWEIGHTED):
        chosen = _exchange_touches(frames, _grow_plan(frames, start, n, weight), weight)
        square = np.trace(frames.covariance(chosen), axis1=1, axis2=2)
        if goal == "mean" or square.max() < left:
            found, left = _sort_by_benefit(frames, chosen, weight), float(square.max())
        weight = weight * (square / square.mean()) ** POWER
    return found


def _seeds(frames: FrameTask, task: ProbingTask) -> IntArray:
    """Three touches far apart for every frame that will be machined in."""
    out = []
    for part in np.unique(frames.work_part).tolist():
        mine = np.flatnonzero(frames.part == part)
        named = f"part {sorted(task.T_base_part)[part]}"
        if len(mine) < LEAST:
            raise ObservabilityError(f"{named} has {len(mine)} candidates, its frame needs 3.")
        point = task.candidates.point[mine]
        a = int(np.argmax(np.linalg.norm(point - point.mean(axis=0), axis=1)))
        b = int(np.argmax(np.linalg.norm(point - point[a], axis=1)))
        along = (point[b] - point[a]) / max(float(np.linalg.norm(point[b] - point[a])), LINE)
        off = np.linalg.norm(np.cross(point - point[a], along), axis=1)
        c = int(np.argmax(off))
        if off[c] < LINE:
            raise ObservabilityError(
                f"the candidates of {named} lie on one line, {off[c] * 1e3:.1f} mm off it at most.",
                hint="features to the side of that line.",
            )
        out += [mine[a], mine[b], mine[c]]
    return np.array(out, dtype=np.int64)


def _grow_plan(frames: FrameTask, start: IntArray, n: int, weight: Array) -> IntArray:
    chosen = list(start)
    while len(chosen) < n:
        costs = frames.costs(np.array(chosen), weight)
        costs[chosen] = np.inf
        chosen.append(int(np.argmin(costs)))
    return np.array(chosen[:n], dtype=np.int64)


def _exchange_touches(frames: FrameTask, chosen: IntArray, weight: Array) -> IntArray:
    """Single touches exchanged as long as the sum of squares falls and every frame stands."""
    now = chosen.copy()
    for _ in range(SWEEPS):
        moved = False
        for place in range(len(now)):
            rest = np.delete(now, place)
            if not _stands(frames, rest):
                continue
            costs = frames.costs(rest, weight)
            old = costs[now[place]]
            costs[rest] = np.inf
            best = int(np.argmin(costs))
            if costs[best] < old * (1.0 - BETTER):
                now[place], moved = best, True
        if not moved:
            break
    return now


def _sort_by_benefit(frames: FrameTask, chosen: IntArray, weight: Array) -> IntArray:
    """The same touches by worth: what is missed least goes to the end."""
    kept, last = chosen.copy(), []
    while len(kept) > LEAST:
        left = []
        for place in range(len(kept)):
            rest = np.delete(kept, place)
            if _stands(frames, rest):
                square = np.trace(frames.covariance(rest), axis1=1, axis2=2)
                left.append(float(weight @ square))
            else:
                left.append(np.inf)
        place = int(np.argmin(left))
        if not np.isfinite(left[place]):
            break
        last.append(kept[place])
        kept = np.delete(kept, place)
    return np.append(kept, np.array(last[::-1], dtype=np.int64))


def _stands(frames: FrameTask, chosen: IntArray) -> bool:
    """Whether the touches fix every frame that is machined in."""
    for part in np.unique(frames.work_part).tolist():
        mine = chosen[frames.part[chosen] == part]
        if len(mine) < LEAST:
            return False
        lever = frames.touch[mine, :, 3:]
        point = np.stack([lever[:, 1, 2], lever[:, 2, 0], lever[:, 0, 1]], axis=1)
        size = np.linalg.svd(point - point.mean(axis=0), compute_uv=False)
        if size[1] < LINE * np.sqrt(len(mine)):
            return False
    return True


def _trace_order(frames: FrameTask, order: IntArray) -> tuple[Array, Array]:
    """Rms and worst standard uncertainty (n + 1,) m along an order; NaN without a frame."""
    mean, worst = [], []
    for k in range(len(order) + 1):
        if not _stands(frames, order[:k]):
            mean.append(np.nan)
            worst.append(np.nan)
            continue
        square = np.trace(frames.covariance(order[:k]), axis1=1, axis2=2)
        mean.append(float(np.sqrt(square.mean())))
        worst.append(float(np.sqrt(square.max())))
    return np.array(mean), np.array(worst)


def _enough(left: Array, tolerance: float) -> int:
    with np.errstate(invalid="ignore"):
        met = np.flatnonzero(left[1:] <= tolerance)
    return int(met[0]) + 1 if len(met) else len(left) - 1


def _cover(
    frames: FrameTask, task: ProbingTask, chosen: IntArray, goal: Goal
) -> tuple[GroupCover, ...]:
    """Cover of each group; its best is what as many touches leave if they serve it alone."""
    now = np.trace(frames.covariance(chosen), axis1=1, axis2=2)
    own = replace(
        frames,
        work=frames.touch[chosen],
        work_error=frames.touch_error[chosen],
        visit=np.full(len(chosen), float(np.median(frames.visit))),
        work_part=frames.part[chosen],
        turn=np.broadcast_to(np.eye(3), (len(chosen), 3, 3)),
    )
    at_touches = np.sqrt(np.median(np.trace(own.covariance(chosen), axis1=1, axis2=2)))
    out = []
    for name in task.machining.groups:
        mine = task.machining.members(name)
        alone = replace(
            frames,
            work=frames.work[mine],
            work_error=frames.work_error[mine],
            visit=frames.visit[mine],
            work_part=frames.work_part[mine],
            turn=frames.turn[mine],
        )
        count = max(len(chosen), LEAST * len(np.unique(alone.work_part)))
        best = alone.covariance(_choose_touches(alone, task, count, goal))
        least = float(np.sqrt(np.trace(best, axis1=1, axis2=2).mean()))
        cure = f"a frame of its own, from {count} touches, would leave {least * 1e3:.2f} mm"
        if least > FACTOR * at_touches:
            cure += ": add features that can be touched in its postures"
        out.append(
            GroupCover(
                name=name,
                postures=len(mine),
                uncertainty=float(np.sqrt(now[mine].mean())),
                worst=float(np.sqrt(now[mine].max())),
                best=least,
                at_touches=float(at_touches),
                cure=cure,
            )
        )
    return tuple(out)
