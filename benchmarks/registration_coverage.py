"""Do the stated 95 % regions of machined points hold the truth, probed side and unprobed side?

    python benchmarks/registration_coverage.py [--cells N] [--quick]

Simulated cells of robotrue_reproductions.feng2018.machining_cell. The block is touched from the
front alone, at 4, 12 or 30 random points; then 20 points of the front and 20 of the back are
machined, each visited once. Seven statements of the uncertainty are held against the truth:

naive        nominal arm, least-squares frame; touch and repeatability, independent
residuals    the same, sigma taken from the residuals of the fit
frame + arm  the same frame; the arm's errors common to touching and machining (M S M'), with the
             spread the cells are drawn with as what is believed of the arm
stated       arm, tip and frame in one estimate from the touches; run compensated by it. Scales of
             the arm's errors stated: those the cells are drawn with
nominal      the same with robotrue's own scales, which the touches may move
calibrated   the same after a tracker calibration of 60 poses (method "ripple")
cal. frame   calibrated arm left as it is, least-squares frame, M S M' with the model's posterior

Coverage is the share of points, and in brackets that of 95 % two-sided intervals over cells (points
of one cell are not independent). u: stated 3-D standard uncertainty, rms; e: rms of the true error.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from dataclasses import replace

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.machined import (
    machined_covariance,
    unchanged_covariance,
)
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, Query, require_belief
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import (
    ProbingEstimate,
    ProbingSettings,
    estimate_probing,
    model_of_estimate,
)
from robotrue.calibration.settings import RP_PER_SIGMA, FitSettings, prior_belief
from robotrue.calibration.terms.error_vector import PriorScales
from robotrue.cell.registration.fit import fit_points, frame_gain, point_covariance
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.robust import LEVEL, chi_point
from robotrue.core.units import DEG, MM
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue_reproductions.feng2018.machining_cell import (
    WRIST_MASS,
    FengCell,
    attitude,
    compensated_joints,
    feng_cell,
    machine,
    touch,
    touch_points,
    tracker_poses,
)
from robotrue_reproductions.feng2018.registration_ways import (
    TIP,
    Touches,
    estimate_cell,
    probing_set,
    tips,
)

COUNTS = (4, 12, 30)
SIDES = {"probed": "R", "unprobed": "L"}
POINTS = 20
WAYS = ("naive", "residuals", "frame + arm", "stated", "nominal", "calibrated", "cal. frame")
HONEST = ("frame + arm", "stated", "nominal", "calibrated", "cal. frame")
REACH = (93.0, 99.0)
REFERENCE = {
    "naive": {4: "46 % / -", 12: "33 % / 0.3 %", 30: "25 % / 0.1 %"},
    "residuals": {4: "98.6 % / -", 12: "98.5 % / 1.9 %", 30: "98.7 % / 2.2 %"},
    "frame + arm": {4: "99.0 % / -", 12: "99.0 % / 96.7 %", 30: "99.1 % / 96.3 %"},
    "stated": {4: "99.6 % / -", 12: "99.8 % / 96.0 %", 30: "99.7 % / 94.3 %"},
}
"""Shares of an earlier prototype with a simpler arm; probed / unprobed side."""


ANGLE = 0.02 * DEG


def drawn_scales(cell: FengCell) -> FitSettings:
    """Scales of the errors of the arms that the cells are drawn with."""
    return FitSettings(
        repeatability=cell.sizes.repeatability * RP_PER_SIGMA,
        scales=PriorScales(
            theta=ANGLE, d=0.3 * MM, a=0.3 * MM, alpha=ANGLE, beta=ANGLE, gear=1e-12, tool=TIP
        ),
    )


def drawn_spread(cell: FengCell) -> Belief:
    """What is believed of an arm by someone who knows from what distribution it was drawn."""
    settings = drawn_scales(cell)
    # A harmonic of one of the orders 2 to 8, amplitude |N(0, .008 deg)|, has this sd in each.
    ripple = np.append(1e-12, np.full(7, 0.008 * DEG / np.sqrt(2.0 * 7.0)))
    belief = prior_belief(cell.nominal, settings, ripple=ripple)
    sd = np.sqrt(belief.variance)
    beta, compliance = (parameter_slice(6, group).start for group in ("beta", "compliance"))
    sd[beta : beta + 6] = 0.0
    sd[beta + 1] = ANGLE
    sd[compliance : compliance + 6] = 0.0
    moment = WRIST_MASS * float(np.linalg.norm(cell.nominal.gravity))
    sd[compliance + 1 : compliance + 3] = ANGLE / moment
    return replace(belief, root=np.diag(sd)[sd > 0.0])


class Tally:
    """Shares, errors and stated uncertainties by way, touches and side."""

    def __init__(self) -> None:
        self.rows: dict[tuple[str, int, str], list[tuple[float, float, float]]] = defaultdict(list)

    def add(self, way: str, count: int, side: str, error: Array, covariance: Array) -> None:
        """Adds the points of one cell, errors (n, 3) and what is stated of them (n, 3, 3)."""
        solved = np.linalg.solve(covariance, error[:, :, None])[:, :, 0]
        inside = (error * solved).sum(axis=1) <= chi_point(LEVEL, 3) ** 2
        square = (error**2).sum(axis=1).mean()
        stated = np.trace(covariance, axis1=1, axis2=2).mean()
        self.rows[way, count, side].append((float(inside.mean()), float(square), float(stated)))

    def line(self, way: str, count: int, side: str) -> tuple[float, float, str]:
        """Coverage in %, half its interval, and everything as text."""
        table = np.array(self.rows[way, count, side])
        share = 100.0 * table[:, 0].mean()
        half = 196.0 * table[:, 0].std(ddof=1) / np.sqrt(len(table)) if len(table) > 1 else np.nan
        error, stated = np.sqrt(table[:, 1:].mean(axis=0)) / MM
        return share, half, f"{share:5.1f} % (+-{half:3.1f})  u {stated:.3f}  e {error:.3f}"


def run_cell(seed: int, tally: Tally) -> None:
    """Adds one cell to the tally."""
    cell = feng_cell(seed)
    rng = np.random.default_rng([seed, 47])
    points = touch_points("R", max(COUNTS), rng)
    front = Touches(points=points, joints=touch(cell, points, "R", rng))
    work = {side: touch_points(posture, POINTS, rng) for side, posture in SIDES.items()}
    settings = FitSettings(repeatability=cell.sizes.repeatability * RP_PER_SIGMA)
    calibrated = fit(cell.nominal, tracker_poses(cell, rng), method="ripple", settings=settings)
    for count in COUNTS:
        touches = front.first(count)
        plain_frames(cell, touches, work, rng, tally)
        told = ProbingSettings(touch_sigma=cell.sizes.touch, learn=False, priors=drawn_scales(cell))
        found = estimate_probing(NominalModel(robot=cell.nominal), probing_set(touches), told)
        through(cell, "stated", found, work, rng, tally)
        for way, model in (("nominal", cell.nominal), ("calibrated", calibrated)):
            tool = TIP if isinstance(model, RobotModel) else 0.0
            found = estimate_cell(cell, model, touches, tool_sigma=tool)
            through(cell, way, found, work, rng, tally)
        shared(
            cell, "cal. frame", calibrated, require_belief(calibrated), touches, work, rng, tally
        )


def through(
    cell: FengCell,
    way: str,
    estimate: ProbingEstimate,
    work: dict[str, Array],
    rng: np.random.Generator,
    tally: Tally,
) -> None:
    """Machines through one estimate of arm, tip and frame."""
    refined = model_of_estimate(estimate)
    for side, points in work.items():
        joints, error = cut(cell, refined, estimate.T_base_part[0], points, side, rng)
        covariance = machined_covariance(estimate, Query(joints=joints))
        tally.add(way, len(estimate.touches), side, error, covariance)


def plain_frames(
    cell: FengCell,
    touches: Touches,
    work: dict[str, Array],
    rng: np.random.Generator,
    tally: Tally,
) -> None:
    """Nominal arm and a least-squares frame, with three statements of its uncertainty."""
    count = len(touches.points)
    read = tips(cell.nominal, touches.joints)
    sigma = float(np.hypot(cell.sizes.touch, cell.sizes.repeatability))
    naive = fit_points(touches.points, read, sigma=sigma)
    scaled = fit_points(touches.points, read)
    for side, points in work.items():
        _, error = cut(cell, cell.nominal, naive.T_base_part, points, side, rng)
        turn = naive.T_base_part[:3, :3]
        for way, found, visit in (
            ("naive", naive, cell.sizes.repeatability),
            ("residuals", scaled, scaled.sigma),
        ):
            covariance = point_covariance(found, points) + visit**2 * np.eye(3)
            tally.add(way, count, side, error, turn.T @ covariance @ turn)
    shared(cell, "frame + arm", cell.nominal, drawn_spread(cell), touches, work, rng, tally)


def shared(
    cell: FengCell,
    way: str,
    model: ErrorModel | RobotModel,
    belief: Belief,
    touches: Touches,
    work: dict[str, Array],
    rng: np.random.Generator,
    tally: Tally,
) -> None:
    """A model left as it is, a least-squares frame, the arm's errors in both."""
    place = fit_points(touches.points, tips(model, touches.joints)).T_base_part
    for side, points in work.items():
        joints, error = cut(cell, model, place, points, side, rng)
        covariance = unchanged_covariance(
            belief,
            Query(joints=touches.joints),
            Query(joints=joints),
            points=points,
            T_base_part=place,
            gain=frame_gain(place, touches.points),
            touch_sigma=cell.sizes.touch,
        )
        tally.add(way, len(touches.points), side, error, covariance)


def cut(
    cell: FengCell,
    model: ErrorModel | RobotModel,
    T_base_part: Array,
    points: Array,
    side: str,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Joints of the run, and where the tip truly was less where it should be, in the part."""
    posture = SIDES[side]
    turn = np.broadcast_to(attitude(posture), (len(points), 3, 3))
    joints = compensated_joints(model, pose(turn, apply(T_base_part, points)), posture)
    return joints, apply(inverse(cell.T_base_part), machine(cell, joints, rng)) - points


def report(tally: Tally) -> None:
    """Prints the table and the rows for the summary."""
    print(f"{'':12s} touches   {'probed side':42s} unprobed side")
    for way in WAYS:
        for count in COUNTS:
            lines = [tally.line(way, count, side)[2] for side in SIDES]
            print(f"{way:12s} {count:5d}     {lines[0]:42s} {lines[1]}")
    low, high = REACH
    for way in WAYS:
        for count in COUNTS:
            both = [tally.line(way, count, side)[0] for side in SIDES]
            text = " / ".join(f"{share:.1f} %" for share in both)
            verdict = "for comparison"
            if way in HONEST:
                verdict = "missed: too wide" if max(both) > high else "reached"
                verdict = "missed" if min(both) < low else verdict
            reach = f"{low:g} to {high:g} % both" if way in HONEST else "-"
            reference = REFERENCE.get(way, {}).get(count, "-")
            print(
                f"RESULT | 95 % regions hold (simulated), {way}, {count} touches, probed / "
                f"unprobed side | {reference} | {reach} | {text} | {verdict}"
            )


def main(arguments: list[str]) -> None:
    """Runs all cells."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=200)
    parser.add_argument("--quick", action="store_true", help="8 cells")
    chosen = parser.parse_args(arguments)
    cells = 8 if chosen.quick else chosen.cells
    begin, tally = time.process_time(), Tally()
    print(f"{cells} simulated cells, seeds 0 to {cells - 1}; touch .1 mm, repeatability .03 mm")
    for seed in range(cells):
        run_cell(seed, tally)
    report(tally)
    print(f"({(time.process_time() - begin) / cells:.2f} CPU-s per cell)")


if __name__ == "__main__":
    main(sys.argv[1:])
