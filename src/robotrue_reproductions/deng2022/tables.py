"""Tables 4 to 9 and 11 of Deng et al. 2022 beside the same figures of simulated arms.

Everything here is SIMULATED: the arms are those of
:mod:`robotrue_reproductions.deng2022.scenarios`, drawn so that only the error *before* calibration
resembles the paper's. Figures that a table prints but a simulation cannot meet are listed in
:data:`UNMET` with the reason.
"""

from __future__ import annotations

from typing import Final

from robotrue.errors import ConfigurationError
from robotrue_reproductions.reproduction import Progress, Reproduction

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


SOURCE: Final = "Deng, Gao, Ma, Lu 2022, Journal of Mechanical Engineering 58(14), 170-178"


def reproduce_deng2022(
    scenario: str = "S2A",
    robots: int = 20,
    *,
    quick: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Returns the paper's tables beside those of simulated arms with seeds 1, 2, ...

    Args:
        scenario: Of :data:`robotrue_reproductions.deng2022.scenarios.SCENARIOS`.
        robots: How many arms.
        quick: Fewer layouts for Table 4, no switches, a shallower hole.
        progress: Told before each step.

    Raises:
        ConfigurationError: No such scenario, or no arms.
    """
    from robotrue_reproductions.deng2022.accuracy_tables import accuracy_figures
    from robotrue_reproductions.deng2022.arm_experiment import arm_results
    from robotrue_reproductions.deng2022.scenarios import SCENARIOS
    from robotrue_reproductions.deng2022.similarity_table import similarity_figures

    if scenario not in SCENARIOS:
        raise ConfigurationError(f"no scenario {scenario!r}; scenarios are {list(SCENARIOS)}.")
    if robots < 1:
        raise ConfigurationError(f"{robots} robots, expected 1 or more; 20 for a spread.")
    tell = progress or (lambda what, done, of: None)
    tell("regions and their similarity", 0, robots + 1)
    figures = list(similarity_figures(12 if quick else 60))
    arms = []
    for k in range(robots):
        tell(f"arm {k + 1} of {robots}", k + 1, robots + 1)
        arms.append(arm_results(scenario, k + 1, quick=quick))
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
