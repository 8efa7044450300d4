"""Tables 5 to 9 and 11 of Deng et al. 2022 from the results of single arms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from robotrue.core.units import MM
from robotrue_reproductions.deng2022.arm_experiment import TURNS, ArmResults
from robotrue_reproductions.reproduction import Figure

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


def accuracy_figures(arms: Sequence[ArmResults]) -> Iterator[Figure]:
    """Yields Tables 5 to 9, 11 and the switches, in mm where the paper prints mm."""
    for axis, (name, printed) in enumerate(TABLE_5.items()):
        for k, turn in enumerate(TURNS):
            values = np.array([arm.attitude[axis, k] for arm in arms])
            values = values[np.isfinite(values)]
            if len(values):
                yield _figure("5", name, f"{turn:.0f} deg", printed[k], values)
    for name, count in TABLE_7.items():
        yield Figure(
            table="6, 7",
            name=name,
            quantity="poses",
            unit="",
            paper=float(count),
            ours=np.array([float(arms[0].counts[name])]),
        )
    for name in arms[0].accuracy:
        numbers: tuple[float | None, ...] = TABLE_8.get(name, (None, None, None))
        for k, quantity in enumerate(_THREE):
            values = np.array([arm.accuracy[name][k] for arm in arms])
            if np.isfinite(values).all():
                yield _figure("8", name, quantity, numbers[k], values)
    for label, three in TABLE_9.items():
        for k, quantity in enumerate(_THREE):
            yield _figure("9", label, quantity, three[k], [arm.dry[label][k] for arm in arms])
    for label in arms[0].hole:
        six: tuple[float | None, ...] = TABLE_11.get(label, (None,) * 6)
        for k, quantity in enumerate(_HOLE):
            yield _figure("11", label, quantity, six[k], [arm.hole[label][k] for arm in arms])
    for label in arms[0].switches:
        yield _figure("switches", label, "mean", None, [arm.switches[label] for arm in arms])


def _figure(
    table: str,
    name: str,
    quantity: str,
    paper: float | None,
    values: Sequence[float] | np.ndarray[tuple[int], np.dtype[np.float64]],
) -> Figure:
    """A figure in mm from lengths in m."""
    return Figure(
        table=table,
        name=name,
        quantity=quantity,
        unit="mm",
        paper=paper,
        ours=np.asarray(values, dtype=np.float64) / MM,
    )
