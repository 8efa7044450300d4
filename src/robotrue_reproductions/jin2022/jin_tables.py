"""The numbers of Jin, Sun, Tang, Li 2022 next to those of the virtual milling experiment.

What the paper tabulates is arithmetic and repeated as such. What it measured is SIMULATED here:
:mod:`robotrue_reproductions.jin2022.milling_experiment`. It prints neither frequency response nor
force records, nor predicted errors, so nothing else can be repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM, UM
from robotrue.dynamics.deviation import fit_deviation
from robotrue.dynamics.deviation_physics import CompliantArm, StaticCompliance, static_compliance
from robotrue.dynamics.deviation_validation import METHODS, scores
from robotrue.dynamics.paper_learners import count_components
from robotrue.dynamics.paper_regression import fit_paper
from robotrue.dynamics.window_folds import folds
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.simulation.milling_arm import MillingArm, milling_robot
from robotrue_reproductions.jin2022.milling_experiment import (
    MillingExperiment,
    milling_experiment,
    with_noise,
)
from robotrue_reproductions.jin2022.milling_pass import SHIFTS
from robotrue_reproductions.reproduction import (
    Figure,
    Paper,
    Progress,
    Reproduction,
    ReproductionRequest,
    TableLayout,
    figure,
)

SOURCE: Final = "Jin, Sun, Tang, Li 2022, Aerospace Shanghai (Chinese and English)"
FLOOR: Final = 2.5 * UM
"""White noise of a window that the printed figures need."""
ROWS_DEG: Final = np.array(
    [
        [-26.174, -12.054, 52.467, -32.046, -56.636, 18.890],
        [-25.999, -11.490, 52.572, -31.812, -56.668, 18.716],
        [-25.850, -11.006, 52.660, -31.613, -56.695, 18.569],
        [-25.739, -10.647, 52.722, -31.466, -56.712, 18.462],
        [-25.618, -10.250, 52.788, -31.305, -56.730, 18.346],
        [-25.479, -9.799, 52.861, -31.124, -56.748, 18.216],
        [-25.364, -9.422, 52.919, -30.974, -56.762, 18.110],
        [-25.249, -9.043, 52.975, -30.824, -56.774, 18.004],
        [-25.133, -8.660, 53.030, -30.674, -56.785, 17.900],
        [-25.014, -8.265, 53.084, -30.521, -56.795, 17.794],
    ]
)
"""Table 1, joints."""
EIGENVALUES: Final = np.array([5.45, 1.20, 0.95, 0.40, 1.78e-4, 5.01e-7, 1.50e-8, 9.06e-10])
"""Table 2."""
TRAIN_RMSE: Final = 2.53
TEST_RMSE: Final = 3.75
"""um; the unit is not printed."""
LARGEST: Final = 7.0
"""um, after correction, training and test together."""
SPLITS: Final = {"blocks": "contiguous blocks", "passes": "unseen pass", "unseen": "unseen poses"}
WAYS: Final = {
    "prediction": "e_w only",
    "paper": "components and support vectors",
    "deviation": "ours",
}
UNMET: Final[tuple[tuple[str, str], ...]] = (
    (
        "test RMSE of 3.75",
        "Of 20 simulated arms none has it: 1.50 to 3.34, median 2.84, where training (2.53), mean "
        "(2) and largest (7) lie in the middle of ours. If both parts carry noise of one size, "
        "3.75 on 23 windows is 3.3 standard deviations above 2.53.",
    ),
    (
        "the sample of 93 windows",
        "Ten rows are printed; without the others, and without frequency response and force, no "
        "regression on the paper's own data can be repeated.",
    ),
)


def run(request: ReproductionRequest, progress: Progress) -> Reproduction:
    """Returns the paper's numbers next to those of simulated arms.

    Args:
        request: Quick: only the printed pass, so no unseen poses.
        progress: Called before each step.
    """
    figures = printed_figures()
    floor, held = [], []
    for k, seed in enumerate(request.seeds):
        progress(f"arm {seed} of {request.robots}", k, request.robots)
        experiment = milling_experiment(seed, [0] if request.quick else range(len(SHIFTS)))
        floor.append(as_printed(experiment))
        held.append(score_held_out(experiment))
    figures += [
        _simulated_figure("random", *key, paper, [row[key] for row in floor])
        for key, paper in _FLOOR_PRINTED.items()
    ]
    figures += [
        _simulated_figure("held out", *key, None, [row[key] for row in held]) for key in held[0]
    ]
    return Reproduction(
        scenario="IRB 6660-205/1.9 that mills",
        robots=request.robots,
        figures=tuple(figures),
        unmet=UNMET,
        source=SOURCE,
        remarks=(
            "SIMULATED arms; the paper milled one pass with one robot. Median and quartiles.",
            "The printed tables are arithmetic on printed numbers.",
            "Random 70 / 23 windows of one pass, 2.5 um of noise on each: as the paper. Held out: "
            "low noise, root mean square in um.",
        ),
    )


def printed_figures() -> list[Figure]:
    """Returns what can be checked in the paper's own tables."""
    points = forward(preset("ABB IRB 6660-205/1.9"), ROWS_DEG * DEG)[:, :3, 3]
    pooled = float(np.sqrt((70 * TRAIN_RMSE**2 + 23 * TEST_RMSE**2) / 93))
    rows = [
        ("sum of eigenvalues", "1", 8.0, float(EIGENVALUES.sum())),
        ("components that carry 95 %", "1", 4.0, float(count_components(EIGENVALUES))),
        ("first contribution, of its eigenvalue", "%", 68.10, 100.0 * EIGENVALUES[0] / 8.0),
        ("printed poses off a straight line", "mm", None, _off_line(points) / MM),
        ("way of the ten rows", "mm", None, float(np.linalg.norm(points[-1] - points[0])) / MM),
        ("pooled RMSE of both parts", "um", None, pooled),
    ]
    return [figure("printed", name, "", unit, paper, value) for name, unit, paper, value in rows]


_FLOOR_PRINTED: Final[dict[tuple[str, str], float | None]] = {
    ("before: e_w only", "mean"): 4.0,
    ("before: e_w only", "largest"): 11.0,
    ("components and support vectors", "RMSE, training"): TRAIN_RMSE,
    ("components and support vectors", "RMSE, test"): TEST_RMSE,
    ("components and support vectors", "mean, all windows"): 2.0,
    ("components and support vectors", "largest, all windows"): LARGEST,
    ("ours", "RMSE, training"): None,
    ("ours", "RMSE, test"): None,
    ("ours", "largest, all windows"): None,
}


def as_printed(experiment: MillingExperiment) -> dict[tuple[str, str], float]:
    """Returns the paper's figures in um on the printed pass, noise and split as in the paper."""
    arm, seed = arm_of(experiment.arm), experiment.seed
    clean = experiment.windows.take(experiment.windows.pass_index == 0)
    windows = with_noise(clean, FLOOR, seed)
    train, test = folds(windows, "random", seed=seed)[0]
    known = windows.take(train)
    out = {
        ("before: e_w only", "mean"): float(np.abs(windows.deviation).mean()),
        ("before: e_w only", "largest"): float(np.abs(windows.deviation).max()),
    }
    estimates = {
        "components and support vectors": fit_paper(known, arm).predict(windows).error,
        "ours": fit_deviation(known, arm, row=row_of_hammer(experiment)).predict(windows).error,
    }
    for name, estimate in estimates.items():
        miss = estimate - windows.measured
        out[name, "RMSE, training"] = _rms(miss[train])
        out[name, "RMSE, test"] = _rms(miss[test])
        out[name, "mean, all windows"] = float(np.abs(miss).mean())
        out[name, "largest, all windows"] = float(np.abs(miss).max())
    return {key: value / UM for key, value in out.items()}


def score_held_out(experiment: MillingExperiment) -> dict[tuple[str, str], float]:
    """Returns RMSE in um of windows held out, low noise, and coverage of our 95 % band in %."""
    windows, arm = experiment.windows, arm_of(experiment.arm)
    one = windows.take(windows.pass_index == 0)
    out: dict[tuple[str, str], float] = {}
    for kind, word in SPLITS.items():
        if kind != "blocks" and len(windows.pass_names) == 1:
            continue
        data = one if kind == "blocks" else windows
        for score in scores(data, arm, kinds=[kind], row=row_of_hammer(experiment)):
            out[word, WAYS[score.method]] = score.rmse / UM
            if score.coverage is not None and score.method == METHODS[-1]:
                out[word, "ours, in 95 % band"] = 100.0 * score.coverage
    return out


def arm_of(arm: MillingArm) -> CompliantArm:
    """Returns what the user of a virtual arm states: kinematics, stiffnesses up to 30 % off."""
    return CompliantArm(
        robot=milling_robot(),
        stiffness=arm.stiffness_belief,
        direction=np.array([0.0, -1.0, 0.0]),
    )


def row_of_hammer(experiment: MillingExperiment) -> StaticCompliance:
    """Returns the static row the predictions contain: the lowest line, constant below."""
    return static_compliance(-experiment.hammer[0].real)


def _simulated_figure(
    table: str, name: str, quantity: str, paper: float | None, values: Sequence[float]
) -> Figure:
    unit = "%" if "%" in quantity else "um"
    return figure(table, name, quantity, unit, paper, values)


def _off_line(points: Array) -> float:
    chord = points[-1] - points[0]
    chord = chord / np.linalg.norm(chord)
    offset = points - points[0]
    return float(np.linalg.norm(offset - (offset @ chord)[:, None] * chord, axis=1).max())


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


JIN2022: Final = Paper(
    authors="Jin, Sun, Tang, Li 2022",
    arms="arms,",
    tables={
        "printed": TableLayout(title="Printed tables, checked"),
        "random": TableLayout(
            title="Random 70 / 23 windows of one pass, 2.5 um of noise (simulated), um"
        ),
        "held out": TableLayout(
            title="Windows held out, low noise (simulated), RMSE in um and coverage in %"
        ),
    },
    run=run,
)
