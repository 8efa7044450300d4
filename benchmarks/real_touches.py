"""Calibration from touches alone, on measured arms: a ball in sockets, no tracker, no reader.

    python benchmarks/real_touches.py [--quick] [--arms NAME ...] [--how-many]

A ball on the flange sits in two sockets 50 mm apart on a printed fixture that stood at several
places; only joint angles were recorded. Whole places are held out: a model is fitted to the touches
of all others, and the error is the distance of every tip it predicts from the mean of its own
socket. "One place" holds out the last by name, as the reference did; "every place" each in turn.
Beside them stand random fifths of the touches with all places seen: what noise and hands leave.

"DH, loose" is the reference's fit made again (theta, d, a, alpha at 0.02 rad and 2 mm). "Ours" is
the method that holds the ball best in places held out *among the training places*; nothing looks at
the place that is tested. "Joint estimate" is ``estimate_probing`` with the sockets' distance.
``--how-many`` prints instead what fewer places and touches would have given. Data: the folder
ROBOTRUE_DATA (default ../shared/data).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import ProbingSettings, estimate_probing, model_of_estimate
from robotrue.calibration.settings import FitSettings, SolverSettings
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.cell.registration.tool import fit_tool_point
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.measurement.formats.sockets import SocketTouches, read_sockets
from robotrue.measurement.measurement_set import touched_rows
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.presets import preset
from robotrue.validation.socket_places import (
    FitTouches,
    SocketSpread,
    choose_by_places,
    hold_out_places,
    hold_out_touches,
    socket_spread,
)

ROOT = Path(os.environ.get("ROBOTRUE_DATA", Path(__file__).parents[2] / "shared" / "data"))
SPACING = 50.0 * MM
HAND = 0.05 * MM
"""Of one touch by hand, stated; every fit learns what the touches need beyond it."""
LOOSE = FitSettings(
    scales=PriorScales(theta=0.02, d=2e-3, a=2e-3, alpha=0.02, beta=1e-9, gear=1e-9),
    solver=SolverSettings(learn_scales=False),
)
CHOICE = ("geometric", "elastic", "ripple")
FOLDS, SEED, DRAWS = 5, 0, 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """A measured arm.

    Attributes:
        title: Of its rows.
        folder: Of its data.
        preset: Its nominal geometry.
        one_place: Reference, mean mm at the last place.
        every_place: Reference, mean mm over all places, where there is one.
    """

    title: str
    folder: str
    preset: str
    one_place: float
    every_place: float | None = None


ARMS = (
    Arm(title="Panda 1", folder="panda_1", preset="Franka Panda", one_place=0.72),
    Arm(title="Panda 3", folder="panda_3", preset="Franka Panda", one_place=0.22, every_place=0.20),
    Arm(title="iiwa 14", folder="kuka_14", preset="KUKA LBR iiwa 14 R820", one_place=0.40),
)


def with_ball(robot: RobotModel, touches: ProbingSet) -> RobotModel:
    """The arm with the ball as its tool, roughly: what the nominal arm makes of one socket."""
    first = touches.part == touches.parts[0]
    found = fit_tool_point(forward(robot, touches.joints[first]))
    return robot.with_tool(pose(np.eye(3), found.p_flange_tool))


def by_method(
    robot: RobotModel, method: str, touches: ProbingSet, *, settings: FitSettings | None = None
) -> ErrorModel:
    """One of the methods of a tracker calibration, every socket a set-up that only shifts."""
    rows = touched_rows(touches, sigma=HAND)
    return fit(with_ball(robot, touches), rows, method=method, settings=settings)


def by_estimate(robot: RobotModel, touches: ProbingSet) -> ErrorModel:
    """The joint estimate of arm, ball and sockets, with the known distance of the sockets."""
    settings = ProbingSettings(touch_sigma=HAND, robust=False)
    return model_of_estimate(
        estimate_probing(NominalModel(robot=with_ball(robot, touches)), touches, settings)
    )


def by_places(
    robot: RobotModel, places: Mapping[str, Sequence[int]], touches: ProbingSet
) -> ErrorModel:
    """Ours: the method that wins at places held out among those of these touches."""
    there = {k: v for k, v in places.items() if set(v) <= set(touches.parts)}
    candidates = {m: partial(by_method, robot, m) for m in CHOICE}
    winner, _ = choose_by_places(candidates, touches, there)
    return candidates[winner](touches)


def line(name: str, held: Mapping[str, SocketSpread]) -> str:
    """Mean and worst of all touches, coverage, and both at each place."""
    distance = np.concatenate([s.distance for s in held.values()]) / MM
    inside = np.concatenate([s.inside for s in held.values()])
    each = "  ".join(
        f"{k} {s.mean / MM:.3f} ({100 * s.inside.mean():.0f} %)" for k, s in held.items()
    )
    gaps = np.concatenate([s.length_error for s in held.values()]) / MM
    return (
        f"  {name:15s} mean {distance.mean():.3f}  max {distance.max():.2f}  "
        f"cover {100 * inside.mean():5.1f} %  |spacing off| {np.abs(gaps).mean():.2f}  |  {each}"
    )


def mean_mm(held: Mapping[str, SocketSpread]) -> float:
    """Mean over all touches of all places, mm."""
    return float(np.concatenate([s.distance for s in held.values()]).mean() / MM)


def result(case: str, reference: str, bound: float, measured: float, beside: str) -> None:
    """Prints one row of the summary."""
    verdict = "reached" if measured < bound else "missed"
    print(f"RESULT | {case} | {reference} | < {bound:.3f} | {measured:.3f}; {beside} | {verdict}")


def read(arm: Arm) -> SocketTouches:
    """The touches of one arm, with the sockets' distance."""
    folder = ROOT / "sockets-mukca" / arm.folder
    return read_sockets(folder, spacing=SPACING, spacing_sigma=0.2 * MM)


def how_many(arm: Arm) -> None:
    """Prints what elastic reaches at all other places after some touches at some places."""
    data, robot = read(arm), preset(arm.preset)
    touches = data.touches
    rng = np.random.default_rng(SEED)
    print(f"{arm.title}, elastic: places, touches in each socket, mean mm at all other places")
    for count in range(1, len(data.places)):
        chosen = list(combinations(data.places, count))
        if len(chosen) > DRAWS:
            chosen = [chosen[i] for i in rng.choice(len(chosen), DRAWS, replace=False)]
        for most in (8, 15, None):
            means = []
            for names in chosen:
                rows = np.flatnonzero(data.rows_at(names))
                of = touches.part[rows]
                kept = [rng.permutation(rows[of == k])[:most] for k in np.unique(of)]
                model = by_method(robot, "elastic", touches.subset(np.sort(np.concatenate(kept))))
                others = touches.subset(~data.rows_at(names))
                means.append(socket_spread(model, others).mean / MM)
            print(
                f"  {count}  {most or 'all':>3}  median {np.median(means):.3f}  worst of "
                f"{len(means)} {max(means):.3f}",
                flush=True,
            )


def run(arm: Arm, quick: bool) -> None:
    """Prints the table and the rows of one arm."""
    begin = time.perf_counter()
    data = read(arm)
    robot, touches = preset(arm.preset), data.touches
    places = {
        name: tuple(np.flatnonzero(data.place == i).tolist()) for i, name in enumerate(data.places)
    }
    fits: dict[str, FitTouches] = {
        "nominal": partial(by_method, robot, "nominal"),
        "DH, loose": partial(by_method, robot, "geometric", settings=LOOSE),
        "elastic": partial(by_method, robot, "elastic"),
        "joint estimate": partial(by_estimate, robot),
        "ours": partial(by_places, robot, places),
    }
    print(f"{arm.title}: {len(touches)} touches, {len(places)} places, {touches.source}")
    last = data.places[-1]
    held: dict[str, dict[str, SocketSpread]] = {}
    for name, fitted in fits.items():
        if quick:
            mine = data.rows_at([last])
            spread = socket_spread(
                fitted(touches.subset(~mine)), touches.subset(mine), touch_sigma=HAND
            )
            held[name] = {last: spread}
        else:
            held[name] = hold_out_places(fitted, touches, places, touch_sigma=HAND)
        print(line(name, held[name]), flush=True)
    beside = "plain elastic {:.3f}, nominal {:.2f}, DH again {:.3f}, joint estimate {:.3f}"
    order = ("elastic", "nominal", "DH, loose", "joint estimate")
    one = {k: v[last].mean / MM for k, v in held.items()}
    result(
        f"{arm.title}, place never touched ({last}), mean mm",
        f"{arm.one_place:.2f}",
        arm.one_place,
        one["ours"],
        beside.format(*(one[k] for k in order)),
    )
    if not quick:
        every = {k: mean_mm(v) for k, v in held.items()}
        bound = arm.every_place or every["DH, loose"]
        result(
            f"{arm.title}, every place held out in turn, mean mm",
            f"{bound:.2f}" if arm.every_place else f"DH again {bound:.3f}",
            bound,
            every["ours"],
            beside.format(*(every[k] for k in order)),
        )
        inside = hold_out_touches(fits["elastic"], touches, folds=FOLDS, seed=SEED)
        print(
            f"  random fifths of the touches, every place seen (seed {SEED}), elastic: mean "
            f"{inside.mean / MM:.3f} mm"
        )
    print(f"  ({time.perf_counter() - begin:.0f} s)", flush=True)


def main(arguments: list[str]) -> int:
    """Runs the arms asked for."""
    names = [arm.folder for arm in ARMS]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="the reference's place alone")
    parser.add_argument("--arms", nargs="+", choices=names, default=names)
    parser.add_argument("--how-many", action="store_true", help="fewer places and touches")
    chosen = parser.parse_args(arguments)
    if not ROOT.is_dir():
        print(f"measured data not found at {ROOT}; set ROBOTRUE_DATA")
        return 1
    for arm in ARMS:
        if arm.folder in chosen.arms and chosen.how_many:
            how_many(arm)
        elif arm.folder in chosen.arms:
            run(arm, chosen.quick)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
