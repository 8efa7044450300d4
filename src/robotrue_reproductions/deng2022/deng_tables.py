"""Tables 4 to 9 and 11 of Deng et al. 2022 next to the same figures of simulated arms.

Everything here is SIMULATED: the arms are those of
:mod:`robotrue_reproductions.deng2022.scenarios`, drawn so that only the error *before* calibration
resembles the paper's. Figures that a table prints but a simulation cannot meet are listed in
:data:`UNMET` with the reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue_reproductions.deng2022.arm_experiment import TURNS, ArmResults, arm_results
from robotrue_reproductions.deng2022.scenarios import SCENARIOS
from robotrue_reproductions.deng2022.similarity_table import similarity_figures
from robotrue_reproductions.reproduction import (
    Figure,
    Paper,
    Progress,
    Reproduction,
    ReproductionRequest,
    TableLayout,
    figure,
)

SOURCE: Final = "Deng, Gao, Ma, Lu 2022, Journal of Mechanical Engineering 58(14), 170-178"
_THREE: Final = ("mean", "max", "std")
TABLE_5: Final[dict[str, tuple[float | None, ...]]] = {
    "rx": (0.027, 0.025, 0.036),
    "ry": (0.035, 0.045, None),
    "rz": (0.042, 0.062, None),
}
"""mm; turns of 5, 10, 15 deg."""
TABLE_7: Final = {"source": 126, "target": 80, "validation": 378, "complete": 756}
TABLE_8: Final = {
    "before": (1.499, 2.626, 0.542),
    "GPR-50": (0.658, 0.997, 0.149),
    "GPR-378": (0.151, 0.287, 0.070),
    "Tr-GPR": (0.182, 0.454, 0.086),
}
TABLE_9: Final = {"before": (1.459, 1.892, 0.277), "after": (0.205, 0.393, 0.106)}
TABLE_11: Final = {"after": (0.144, 0.298, 0.331, 0.269, 0.461, 0.071)}
_HOLE: Final = (
    "position x",
    "position y",
    "position",
    "contour mean",
    "contour max",
    "contour std",
)
UNMET: Final[tuple[tuple[str, str], ...]] = (
    (
        "Table 4, exact digits",
        "The paper prints neither the regions nor the points in them. Shown: layouts found by a "
        "search, and how often the cylinder beats the cube among random ones.",
    ),
    (
        "Table 5",
        "One position of one arm, differences within its repeatability (0.06 mm). Only the size "
        "can be compared, and it depends on the assumed un-modelled effects.",
    ),
    (
        "Table 8, GPR-50 = 0.658 mm",
        "No Gaussian process with learned hyper-parameters is that bad with 50 poses; subtracting "
        "the mean error alone is better. A zero mean with a fixed length of 60 to 100 mm comes "
        "near the mean, but then with several times the printed spread.",
    ),
    (
        "Table 11, contour mean = 0.269 mm",
        "Nearly four times its standard deviation: the hole is wider or narrower all round. Tool "
        "diameter, tool deflection and the spindle can do that, and are not simulated.",
    ),
    (
        "eq. 25 as printed",
        "Its scale is wrong: a sum of logarithms times a median of beta G, larger or smaller with "
        "every round. What is left is of the size of the error before; see the readings.",
    ),
    (
        "eq. 12 as printed",
        "Multiplies matrices of 126 and 16 rows; it cannot be computed at all.",
    ),
)
"""What cannot be met, and why."""


def run(request: ReproductionRequest, progress: Progress) -> Reproduction:
    """Returns the paper's tables next to those of simulated arms.

    Args:
        request: Quick: fewer layouts for Table 4, no switches, a shallower hole.
        progress: Called before each step.

    Raises:
        ConfigurationError: No such scenario.
    """
    scenario, robots = request.scenario, request.robots
    if scenario not in SCENARIOS:
        raise ConfigurationError(f"no scenario {scenario!r}; scenarios are {list(SCENARIOS)}.")
    progress("regions and their similarity", 0, robots + 1)
    figures = list(similarity_figures(12 if request.quick else 60))
    arms = []
    for seed in request.seeds:
        progress(f"arm {seed} of {robots}", seed, robots + 1)
        arms.append(arm_results(scenario, seed, quick=request.quick))
    figures.extend(accuracy_figures(arms))
    return Reproduction(
        scenario=scenario,
        robots=robots,
        figures=tuple(figures),
        unmet=UNMET,
        source=SOURCE,
        remarks=(
            "SIMULATED arms; the paper measured one real arm. Median and quartiles over arms.",
            "Tables 6 and 7 are counts of the plan and have no spread.",
            "GPR pooled is a plain process on the same 206 poses, a comparison the paper omits.",
            "Tables 9 and 11: the end mill's tip is where the reflector was measured; forces and "
            "the place of the plate are assumed.",
        ),
    )


def accuracy_figures(arms: Sequence[ArmResults]) -> Iterator[Figure]:
    """Yields Tables 5 to 9, 11 and the switches, in mm where the paper prints mm."""
    for axis, (name, printed) in enumerate(TABLE_5.items()):
        for k, turn in enumerate(TURNS):
            values = np.array([arm.attitude[axis, k] for arm in arms])
            values = values[np.isfinite(values)]
            if len(values):
                yield _in_mm("5", name, f"{turn:.0f} deg", printed[k], values)
    for name, count in TABLE_7.items():
        yield figure("6, 7", name, "poses", "", float(count), arms[0].counts[name])
    for name in arms[0].accuracy:
        numbers: tuple[float | None, ...] = TABLE_8.get(name, (None, None, None))
        for k, quantity in enumerate(_THREE):
            values = np.array([arm.accuracy[name][k] for arm in arms])
            if np.isfinite(values).all():
                yield _in_mm("8", name, quantity, numbers[k], values)
    for label, three in TABLE_9.items():
        for k, quantity in enumerate(_THREE):
            yield _in_mm("9", label, quantity, three[k], [arm.dry[label][k] for arm in arms])
    for label in arms[0].hole:
        six: tuple[float | None, ...] = TABLE_11.get(label, (None,) * 6)
        for k, quantity in enumerate(_HOLE):
            yield _in_mm("11", label, quantity, six[k], [arm.hole[label][k] for arm in arms])
    for label in arms[0].switches:
        yield _in_mm("switches", label, "mean", None, [arm.switches[label] for arm in arms])


def _in_mm(table: str, name: str, quantity: str, paper: float | None, values: ArrayLike) -> Figure:
    """A figure in mm from lengths in m."""
    return figure(table, name, quantity, "mm", paper, np.asarray(values) / MM)


DENG2022: Final = Paper(
    authors="Deng et al. 2022",
    arms="arms of scenario",
    tables={
        "4": TableLayout(
            title="Table 4: similarity to the reference region (simulated)", decimals=4
        ),
        "4 readings": TableLayout(
            title="Table 4: readings of eq. 9-10 over random layouts (simulated)",
            decimals=4,
            compares=False,
        ),
        "5": TableLayout(
            title="Table 5: change of the error when the attitude turns, mm (simulated)"
        ),
        "6, 7": TableLayout(title="Tables 6 and 7: poses of the plan (simulated)", decimals=0),
        "8": TableLayout(title="Table 8: error of 50 check poses, mm (simulated)"),
        "9": TableLayout(title="Table 9: 39 poses of the slot, dry run, mm (simulated)"),
        "11": TableLayout(title="Table 11: milled hole, mm (simulated)"),
        "switches": TableLayout(
            title="Tr-GPR under other readings, mean error of 50 check poses, mm (simulated)"
        ),
    },
    run=run,
)
