"""Cutting coefficients from slots: mean force against feed per tooth, with their deviations.

The mean force is linear in the six coefficients, whatever the tool; in a slot of a flat end mill::

    F_feed = -N a / 4 K_r c - N a / pi K_re
    F_left = +N a / 4 K_t c + N a / pi K_te
    F_up   = +N a / pi K_a c + N a / 2 K_ae

Source: Altintas 2012, Manufacturing Automation, eq. 2.22-2.24 (forces on the tool).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
from robotrue.dynamics.milling_force import mean_force
from robotrue.errors import ImplausibleDataError, ObservabilityError

NAMES: Final = (
    "tangential", "radial", "axial", "tangential_edge", "radial_edge", "axial_edge",
)  # fmt: skip
_SIZE: Final = np.array([1e9, 1e9, 1e9, 1e4, 1e4, 1e4])
"""Pa and N/m of an ordinary material; scales the unknowns, weighs nothing."""
_SPREAD: Final = 1.5
"""Least ratio of largest to smallest feed per tooth that separates shear from edge coefficients."""
_CLEAR: Final = 3.0
"""Deviations by which a slope must differ from nothing to have a sign."""
_HOPELESS: Final = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingTest(Columns):
    """One steady cut and its mean force.

    Attributes:
        cut: As it was set.
        force: (3,) N mean force on the tool: along the feed, to its left, along the tool up.
    """

    cut: CutterEngagement
    force: Annotated[Array, Column("3", unit="N")]


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedCoefficients:
    """Coefficients with what is known of their errors.

    Attributes:
        coefficients: Of the material with this cutter.
        covariance: (6, 6) Pa and N/m, in the order of ``NAMES``.
        residual: (n, 3) N, measured minus modelled mean force.
        noise: N, standard deviation of a mean force, from the residual.
    """

    coefficients: CuttingCoefficients
    covariance: Array
    residual: Array
    noise: float

    @property
    def deviation(self) -> Array:
        """(6,) standard deviations, Pa and N/m."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def identify_coefficients(cutter: EndMill, tests: Sequence[CuttingTest]) -> IdentifiedCoefficients:
    """Returns the coefficients that least squares finds in cutting tests.

    Args:
        cutter: The tool; its runout should be small against the feeds, or measured.
        tests: Three or more, at different feeds per tooth, best full slots.

    Raises:
        ObservabilityError: Too few tests or feeds too much alike.
        ImplausibleDataError: Axes swapped or flipped, or a force on the workpiece instead of the
            tool; the message names which.

    Fails when: the tool is dull or rings: the mean then holds more than cutting.
    """
    _check_feeds(tests)
    if cutter.kind == "flat":
        _check_axes(tests)
    design = np.concatenate([_design(cutter, test.cut) for test in tests])
    measured = np.concatenate([test.force for test in tests])
    scaled = design * _SIZE
    if np.linalg.cond(scaled / np.linalg.norm(scaled, axis=0)) > _HOPELESS:
        raise ObservabilityError(
            "the tests do not separate the six coefficients.",
            hint="add slots at other feeds per tooth.",
        )
    found = np.linalg.lstsq(scaled, measured, rcond=None)[0] * _SIZE
    residual = measured - design @ found
    freedom = len(measured) - len(found)
    noise = float(np.sqrt(residual @ residual / freedom))
    if not found[0] > 0.0:
        raise ImplausibleDataError(
            f"the tangential coefficient would be {found[0] * 1e-6:.4g} N/mm2: the axes or the "
            "sign of the force are not those of the tool.",
            hint="x along the feed, y to its left, z along the tool up, force on the tool.",
        )
    return IdentifiedCoefficients(
        coefficients=CuttingCoefficients(**dict(zip(NAMES, found.tolist(), strict=True))),
        covariance=noise**2 * np.linalg.inv(scaled.T @ scaled) * np.outer(_SIZE, _SIZE),
        residual=residual.reshape(-1, 3),
        noise=noise,
    )


def check_axes_agree(measured: Array, expected: Array, source: str) -> None:
    """Returns nothing; raises where a mean force fits the model only with other axes.

    For a recorded cut: the best of the eight ways to swap and flip x and y must be the unchanged
    one, unless none is clearly better.

    Args:
        measured: (3,) N mean force in the axes of the feed.
        expected: (3,) N of the model.
        source: File, for the message.

    Raises:
        ImplausibleDataError: Another way fits three times better.
    """
    ways = {
        _name_way(way): float(np.linalg.norm(_rotate_force(measured, way) - expected))
        for way in _WAYS
    }
    as_is = ways.pop(_name_way(_WAYS[0]))
    best = min(ways, key=lambda name: ways[name])
    if 3.0 * ways[best] < as_is and as_is > 0.5 * float(np.linalg.norm(expected)):
        raise ImplausibleDataError(
            f"mean force {np.round(measured, 1).tolist()} N, expected about "
            f"{np.round(expected, 1).tolist()} N: it fits with {best}.",
            source=source,
            hint="check the directions of the dynamometer, and whether it shows the force on the "
            "workpiece (the negative of that on the tool).",
        )


def _design(cutter: EndMill, cut: CutterEngagement) -> Array:
    """(3, 6) N per Pa and N/m: the mean force is linear in the coefficients."""
    base = CuttingCoefficients(tangential=_SIZE[0], radial=0.0, axial=0.0)
    first = mean_force(cutter, cut, base)
    columns = [first / _SIZE[0]]
    for name, size in zip(NAMES[1:], _SIZE[1:].tolist(), strict=True):
        values = {"tangential": float(_SIZE[0]), "radial": 0.0, "axial": 0.0} | {name: size}
        columns.append((mean_force(cutter, cut, CuttingCoefficients(**values)) - first) / size)
    return np.column_stack(columns)


def _check_feeds(tests: Sequence[CuttingTest]) -> None:
    feeds = [test.cut.feed_per_tooth for test in tests]
    if len(tests) < 3:
        raise ObservabilityError(
            f"{len(tests)} cutting tests, expected three or more.",
            hint="slots at four or five feeds per tooth.",
        )
    if max(feeds) < _SPREAD * min(feeds):
        raise ObservabilityError(
            f"feeds per tooth from {min(feeds) * 1e3:g} to {max(feeds) * 1e3:g} mm: too similar "
            "to separate shear from edge.",
            hint="spread them by a factor of two or more.",
        )


def _check_axes(tests: Sequence[CuttingTest]) -> None:
    """Slopes of the mean force of slots: along the feed down, to its left up, and steeper.

    A flat end mill's only: on a ball the axial force has a part along the feed, of either sign.
    """
    slots = [test for test in tests if test.cut.mode == "slot"]
    groups = {test.cut.depth for test in slots}
    if len(slots) < 3 or len(groups) != 1:
        return
    feed = np.array([test.cut.feed_per_tooth for test in slots])
    force = np.array([test.force for test in slots])
    line = np.column_stack([feed, np.ones_like(feed)])
    fitted = np.linalg.lstsq(line, force, rcond=None)[0]
    slope, residual = fitted[0], force - line @ fitted
    noise = np.sqrt((residual**2).sum(axis=0) / max(1, len(feed) - 2))
    doubt = noise * np.sqrt(np.linalg.inv(line.T @ line)[0, 0])
    clear = np.abs(slope[:2]) > _CLEAR * doubt[:2] + 1e-9 * np.abs(slope[:2]).max()
    if not clear.all():
        raise ObservabilityError(
            "the mean force does not change clearly with the feed: "
            f"{slope[0] * 1e-3:.4g} +- {doubt[0] * 1e-3:.2g} and {slope[1] * 1e-3:.4g} +- "
            f"{doubt[1] * 1e-3:.2g} N/mm along and across it.",
            hint="deeper slots, more feeds, longer records.",
        )
    if _plausible(slope):
        return
    fitting = [_name_way(way) for way in _WAYS[1:] if _plausible(_rotate_force(slope, way))]
    raise ImplausibleDataError(
        f"slopes of the mean force of slots are {slope[0] * 1e-3:.4g} N/mm along the feed and "
        f"{slope[1] * 1e-3:.4g} to its left; on the tool they are below and above zero, the "
        f"latter larger. It fits with {fitting[0] if fitting else 'no turn of the axes'}.",
        hint="check the directions of the dynamometer; the force on the workpiece is the negative "
        "of that on the tool.",
    )


_WAYS: Final = tuple(itertools.product((False, True), (1.0, -1.0), (1.0, -1.0)))
"""Swapped, sign of x, sign of y; the first leaves all as it is."""


def _rotate_force(force: Array, way: tuple[bool, float, float]) -> Array:
    swapped, x, y = way
    first, second = (force[1], force[0]) if swapped else (force[0], force[1])
    return np.array([x * first, y * second, force[2]])


def _name_way(way: tuple[bool, float, float]) -> str:
    swapped, x, y = way
    flips = [axis for axis, sign in (("x", x), ("y", y)) if sign < 0.0]
    parts = (["x and y swapped"] if swapped else []) + (
        [f"{' and '.join(flips)} flipped" + (" afterwards" if swapped else "")] if flips else []
    )
    return " and ".join(parts) or "the axes unchanged"


def _plausible(slope: Array) -> bool:
    return bool(slope[0] < 0.0 < slope[1] and abs(slope[0]) < abs(slope[1]))
