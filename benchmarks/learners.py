"""Learners against scikit-learn and against the floor of the arithmetic, one thread.

    python benchmarks/learners.py [--quick]

Fit: 206 rows, 6 inputs (joint angles), 3 outputs, errors of a simulated arm (arm seed 3, poses seed
5, noise seed 7), scikit-learn's Gaussian process with the same kernel, shared hyper-parameters and
the same start; processor time, medians of runs in turn. Held-out error on 200 further poses.
Prediction: 1e6 places with mean and standard deviation. The floor is what no implementation in
double precision with NumPy can leave out: the product of places and rows, one exponential and the
product with the inverse factor, in the block size that is fastest here.
Coverage: share of new measurements inside 95 % intervals, functions drawn from processes with
lengths of 1 to 10 standard deviations of the input, six inputs, three outputs.
Simulated throughout.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from threadpoolctl import threadpool_limits

from robotrue.calibration.learners import GaussianProcess, TrAdaBoostR2
from robotrue.robot.forward import forward
from robotrue.simulation.plans import random_joints
from robotrue.simulation.presets import T_FLANGE_TARGET, deng2022
from robotrue.simulation.virtual_tracker import measure

ROWS, HELD_OUT, RUNS = 206, 200, 9
PLACES, QUICK_PLACES = 1_000_000, 50_000
FASTER, FLOORS = 4.0, 1.5
COVER = (0.93, 0.97)


def data() -> tuple[np.ndarray, np.ndarray]:
    """Joints (n, 6) rad and errors (n, 3) mm of one simulated arm, in random order."""
    cell = deng2022(3)
    robot = cell.known.measured_robot
    joints = random_joints(robot, ROWS + HELD_OUT, seed=5)
    taken = measure(cell.robot, cell.tracker, joints, seed=7, T_flange_tool=T_FLANGE_TARGET)
    return joints, 1e3 * (taken.position - forward(robot, joints)[:, :3, 3])


def seconds(work: Callable[[], object]) -> float:
    """Processor seconds of one call."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def in_turn(works: list[Callable[[], object]], runs: int) -> list[float]:
    """Medians over runs in which each takes its turn."""
    took = [[seconds(work) for work in works] for _ in range(runs)]
    return [statistics.median(column) for column in zip(*took, strict=True)]


def peer(X: np.ndarray, y: np.ndarray) -> GaussianProcessRegressor:
    """scikit-learn on outputs less their mean, started where ours starts."""
    scale, spread = y.std(), np.sqrt(X.shape[1]) * X.std(axis=0)
    kernel = ConstantKernel(scale**2, (1e-4 * scale**2, 1e4 * scale**2))
    kernel = kernel * RBF(spread, (1e-3, 1e3))
    kernel = kernel + WhiteKernel(0.01 * scale**2, (1e-8 * scale**2, 1e2 * scale**2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel).fit(X, y - y.mean(axis=0))


def floor(places: int, block: int) -> float:
    """Processor seconds of the arithmetic that cannot be left out, blocks of rows."""
    random = np.random.default_rng(0)
    left, right = random.normal(size=(block, 6)), 0.1 * random.normal(size=(6, ROWS))
    factor = random.normal(size=(ROWS, ROWS))
    near, known = np.empty((block, ROWS)), np.empty((block, ROWS))

    def work() -> None:
        for _ in range(places // block):
            np.matmul(left, right, out=near)
            np.exp(near, out=near)
            np.matmul(near, factor, out=known)

    return seconds(work) * places / (places // block * block)


def coverage(n: int, draws: int) -> tuple[float, float, float]:
    """Share inside 95 % intervals: ours, ours without the factor, scikit-learn's."""
    shares = []
    for seed in range(draws):
        random = np.random.default_rng(seed)
        X = random.uniform(-1.0, 1.0, (n + 200, 6))
        length = np.exp(random.uniform(np.log(0.6), np.log(6.0), 6))
        gaps = ((X[:, None] - X[None]) / length) ** 2
        root = np.linalg.cholesky(np.exp(-0.5 * gaps.sum(axis=2)) + 1e-9 * np.eye(n + 200))
        y = root @ random.normal(size=(n + 200, 3)) + 0.05 * random.normal(size=(n + 200, 3))
        model = GaussianProcess().fit(X[:n], y[:n])
        mean, deviation = model.predict(X[n:], return_std=True)
        other = peer(X[:n], y[:n])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # negative variances set to zero
            there, spread = other.predict(X[n:], return_std=True)
        there += y[:n].mean(axis=0)
        plug_in = deviation / np.sqrt(model.inflation_)
        shares.append(
            [
                np.mean(np.abs(y[n:] - m) < 1.96 * s)
                for m, s in ((mean, deviation), (mean, plug_in), (there, spread))
            ]
        )
    ours, plain, others = np.mean(shares, axis=0).tolist()
    return ours, plain, others


def boosted(X: np.ndarray, y: np.ndarray, places: np.ndarray) -> tuple[float, float]:
    """Processor seconds of ten rounds on all rows, half of them source, and of 1e6 means."""
    half = len(X) // 2
    model = TrAdaBoostR2()
    fit = seconds(
        lambda: model.fit(X[half:], y[half:], X_source=X[:half], y_source=1.1 * y[:half] + 0.1)
    )
    return fit, seconds(lambda: model.predict(places)) * 1e6 / len(places)


def verdict(reached: bool) -> str:
    return "reached" if reached else "missed"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer runs, places and draws")
    quick = parser.parse_args(arguments).quick
    joints, errors = data()
    X, y = joints[:ROWS], errors[:ROWS]
    ours, others = in_turn(
        [lambda: GaussianProcess().fit(X, y), lambda: peer(X, y)], 3 if quick else RUNS
    )
    model, other = GaussianProcess().fit(X, y), peer(X, y)
    missed = [
        np.linalg.norm(p - errors[ROWS:], axis=1).mean()
        for p in (model.predict(joints[ROWS:]), other.predict(joints[ROWS:]) + y.mean(axis=0))
    ]
    print(f"fit of {ROWS} rows, 6 inputs, 3 outputs   CPU s   held-out mean, mm")
    print(f"{'robotrue':38s} {ours:7.4f}   {missed[0]:.4f}")
    print(f"{'scikit-learn':38s} {others:7.4f}   {missed[1]:.4f}")

    places = QUICK_PLACES if quick else PLACES
    random = np.random.default_rng(1)
    there = random.uniform(X.min(axis=0), X.max(axis=0), (places, 6))
    blocks = (128, 256, 512, 1024, 2048)
    least = min(statistics.median(floor(places // 5, b) for _ in range(3)) for b in blocks) * 5
    took = in_turn(
        [
            lambda: model.predict(there, return_std=True),
            lambda: model.predict(there),
            lambda: other.predict(there[: places // 10], return_std=True),
        ],
        1 if quick else 3,
    )
    print(f"prediction of {places} places             CPU s   floors")
    print(f"{'floor':38s} {least:7.3f}   1.00")
    rows = zip(("robotrue, mean and sd", "robotrue, mean"), took[:2], strict=True)
    for name, value in (*rows, ("scikit-learn, mean and sd (a tenth)", 10.0 * took[2])):
        print(f"{name:38s} {value:7.3f}   {value / least:.2f}")
    print(
        "TrAdaBoost.R2, 10 rounds, {} rows: fit {:.2f} CPU s, 1e6 means {:.1f} CPU s".format(
            len(joints), *boosted(joints, errors, there[: places // 10])
        )
    )

    print("coverage of 95 % intervals      robotrue  without its factor  scikit-learn")
    covered = {}
    for n, draws in ((10, 40), (20, 40), (50, 30), (206, 10)):
        covered[n], plain, others_cover = coverage(n, 3 if quick else draws)
        print(f"{n:4d} rows {covered[n]:31.3f} {plain:19.3f} {others_cover:13.3f}", flush=True)

    print(
        f"RESULT | learners: fit of {ROWS} rows, times faster than scikit-learn, simulated "
        f"| 1 | >= {FASTER:.0f} | {others / ours:.1f} ({ours:.3f} against {others:.3f} CPU s) "
        f"| {verdict(others >= FASTER * ours)}"
    )
    print(
        f"RESULT | learners: {places:.0e} places with mean and sd, times the floor "
        f"| scikit-learn {10.0 * took[2] / least:.1f} | <= {FLOORS} "
        f"| {took[0] / least:.2f} ({took[0]:.2f} against {least:.2f} CPU s) "
        f"| {verdict(took[0] <= FLOORS * least)}"
    )
    for n in (20, 50, 206):
        print(
            f"RESULT | learners: coverage of 95 % intervals, {n} rows, simulated | - "
            f"| {COVER[0]:.2f} to {COVER[1]:.2f} | {covered[n]:.3f} "
            f"| {verdict(COVER[0] <= covered[n] <= COVER[1])}"
        )
    return 0


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main(sys.argv[1:]))
