"""Faults of touches before a frame is fitted: units, names, mirrors, patterns.

Every check names the touches at fault. A frame from touches that are wrong in one of these ways may
leave small residuals, so each raises; warnings are returned as sentences.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from robotrue.cell.registration.ambiguity import check_names
from robotrue.cell.registration.fit import check_pattern
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.robust import GAUSS_POINT, agreeing
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, RobotrueError
from robotrue.measurement.probing_set import ProbingSet

SCALE: Final = 0.03
"""Share by which distances between feature points may be off before a unit is to blame."""
ROUGH: Final = 0.5
"""The same where touches lie anywhere near their nominal point on a surface."""
UNITS: Final = {
    1000.0: "the nominal points are in metres",
    0.001: "the touched points are in metres",
    25.4: "the nominal points are in inches",
    1.0 / 25.4: "the touched points are in inches",
}
"""Touched over nominal distance as read in mm, and its meaning."""
MOST_NAMES: Final = 40
"""Points up to which every other order of the names is tried."""
SWAPPED: Final = 8
"""Largest number of rejected touches among which exchanged names are searched."""


def list_names(names: Sequence[str], most: int = 8) -> str:
    """Returns names for a message, the first few of many."""
    return ", ".join(names[:most]) + (f", ... ({len(names)} in all)" if len(names) > most else "")


@contextmanager
def naming(touches: ProbingSet, part: str = "") -> Iterator[None]:
    """Lets every error inside carry the file, the part where there are several, and the touches."""
    try:
        yield
    except RobotrueError as error:
        message = error.message
        words = set(re.findall(r"[^\s,;:()]+", message))
        if not words & {word for label in touches.labels for word in label.split()}:
            message += f" Touches: {list_names(touches.labels)}."
        if part:
            message = f"part {part!r}: {message}"
        raise type(error)(
            message,
            source=error.source or file_of(touches),
            line=error.line,
            hint=error.hint,
        ) from error


def check_units(
    touches: ProbingSet, in_base: Array, tips: Callable[[Array], Array] | None = None
) -> None:
    """Passes if touched and nominal points are of one size.

    Args:
        touches: Of one part.
        in_base: (n, 3) m, positions of the tip.
        tips: Joints (n, dof) rad to tips (n, 3) m, to separate radians from degrees.

    Raises:
        ImplausibleDataError: Radians for degrees, metres or inches for millimetres.
        ObservabilityError: All touches at one place.
    """
    ratio = _ratio(touches, in_base)
    allowed = SCALE if touches.full.all() else ROUGH
    if abs(ratio - 1.0) <= allowed:
        return
    who = list_names(touches.labels)
    if tips is not None and touches.has_joints:
        largest = float(np.abs(touches.joints).max()) / DEG
        turned = _ratio(touches, tips(touches.joints / DEG))
        if largest < 2.0 * np.pi and abs(np.log(turned)) < 0.5 * abs(np.log(max(ratio, 1e-12))):
            raise ImplausibleDataError(
                f"joints of {who} reach {largest:.4f} deg and the touches span {ratio:.3g} times "
                f"what the part does; read as radians {turned:.3g} times.",
                source=file_of(touches),
                line=int(touches.lines[0]),
                hint="the joint columns are in radians: multiply them by 57.29578.",
            )
    near = min(UNITS, key=lambda unit: abs(np.log(max(ratio, 1e-12) / unit)))
    known = abs(ratio / near - 1.0) <= max(allowed, 0.1)
    guess = UNITS[near] if known else "another part, another scale, or names of other points"
    raise ImplausibleDataError(
        f"distances between the touched points {who} are {ratio:.4g} times those of the nominal "
        f"points, allowed {1 - allowed:g} to {1 + allowed:g}: {guess}.",
        source=file_of(touches),
        line=int(touches.lines[0]),
        hint="px_mm, py_mm, pz_mm and x_mm, y_mm, z_mm are millimetres.",
    )


def _ratio(touches: ProbingSet, in_base: Array) -> float:
    """Median ratio of touched to nominal distances over pairs that are far apart in the part.

    Raises:
        ObservabilityError: The nominal points coincide.
    """
    n = len(touches)
    i, j = np.triu_indices(n, 1)
    nominal = np.linalg.norm(touches.point[i] - touches.point[j], axis=1)
    far = nominal > 0.3 * nominal.max() if len(nominal) else np.zeros(0, dtype=bool)
    if not far.any() or nominal.max() <= 0.0:
        check_pattern(touches.point, touches.labels)
        return 1.0
    touched = np.linalg.norm(in_base[i] - in_base[j], axis=1)
    return float(np.median(touched[far] / nominal[far]))


def check_pattern_of(touches: ProbingSet) -> None:
    """Passes if feature points alone, where there are no others, fix all six directions.

    Raises:
        ObservabilityError: Too few, coincident or collinear points; names them.
    """
    if touches.full.all():
        check_pattern(touches.point, touches.labels)
        return
    numbers = 3 * int(touches.full.sum()) + int((~touches.full).sum())
    if numbers < 6:
        raise ObservabilityError(
            f"touches {list_names(touches.labels)} give {numbers} numbers, a frame needs 6: a "
            "feature point gives 3, a touch with a normal 1.",
            source=file_of(touches),
            hint="touch more points; 3 on the largest face, 2 on the next, 1 on the third.",
        )


def check_order(touches: ProbingSet, in_base: Array, *, tolerance: float) -> tuple[str, ...]:
    """Returns warnings about a pattern that fits more than one way; exchanged names raise.

    Args:
        touches: Of one part; only feature points are looked at.
        in_base: (n, 3) m.
        tolerance: m, largest error of a good touch.

    Raises:
        ImplausibleDataError: The touches fit under other names and not under these.
    """
    full = touches.full
    if not 3 <= int(full.sum()) <= MOST_NAMES:
        return ()
    names = tuple(n for n, mine in zip(touches.labels, full, strict=True) if mine)
    point, base = touches.point[full], in_base[full]
    try:
        check_pattern(point, names)
    except ObservabilityError:
        return ()
    # Touches of one feature again and again can always be exchanged: one of each is enough.
    first = sorted({tuple(p): i for i, p in reversed(list(enumerate(point.tolist())))}.values())
    if len(first) < 3:
        return ()
    return check_names(
        point[first], base[first], tolerance=tolerance, names=tuple(names[i] for i in first)
    )


def check_mirror(touches: ProbingSet, in_base: Array, *, sigma: float) -> tuple[str, ...]:
    """Returns a warning about flat patterns; points that fit only as their mirror image raise.

    Args:
        touches: Of one part.
        in_base: (n, 3) m.
        sigma: m per axis of a good touch.

    Raises:
        ImplausibleDataError: Mirrored; wrong touches do not hide it.
    """
    full = touches.full
    point, base = touches.point[full], in_base[full]
    if not full.all() or len(point) < 3:
        return ()
    bound = GAUSS_POINT * sigma
    depth = np.linalg.svd(point - point.mean(axis=0), compute_uv=False)[2]
    if depth < bound:
        return (
            f"The points {list_names(touches.labels)} lie in one plane: a mirrored part, or one "
            "upside down, fits equally well. Probe a point off that plane.",
        )
    here = _agree(point, base, bound)
    there = _agree(point * np.array([1.0, 1.0, -1.0]), base, bound)
    if here <= 0.5 * len(point) and there > max(here, 0.7 * len(point)):
        raise ImplausibleDataError(
            f"the touched points {list_names(touches.labels)} are the mirror image of the part: "
            f"{there} of {len(point)} fit with one axis of the part reversed, {here} as they are.",
            source=file_of(touches),
            line=int(touches.lines[0]),
            hint="check the sign of one coordinate, left against right hand parts, or the order "
            "of the names.",
        )
    return ()


def _agree(point: Array, base: Array, bound: float) -> int:
    def length(weights: Array) -> Array:
        gap = base - apply(fit_rigid(point, base, weights), point)
        return np.asarray(np.linalg.norm(gap, axis=1))

    return int(agreeing(length, len(point), bound).sum())


def check_exchanged(
    touches: ProbingSet, in_base: Array, T_base_part: Array, wrong: BoolArray, *, tolerance: float
) -> None:
    """Passes unless touches rejected by the fit match each other's place.

    Args:
        touches: Of one part.
        in_base: (n, 3) m.
        T_base_part: (4, 4), from the accepted touches.
        wrong: (n,) True where the fit rejected a touch.
        tolerance: m.

    Raises:
        ImplausibleDataError: Exchanged names; states them.
    """
    rows = np.flatnonzero(wrong & touches.full)
    if not 2 <= len(rows) <= SWAPPED:
        return
    place = apply(T_base_part, touches.point[rows])
    apart = np.linalg.norm(in_base[rows][:, None] - place[None, :], axis=2)
    touch, target = linear_sum_assignment(np.minimum(apart, 10.0 * tolerance))
    moved = [
        (touches.labels[rows[i]], touches.labels[rows[j]])
        for i, j in zip(touch, target, strict=True)
        if i != j and apart[i, j] <= tolerance
    ]
    if len(moved) > 1:
        listed = ", ".join(f"{a} was touched at {b}" for a, b in moved)
        raise ImplausibleDataError(
            f"names are exchanged: {listed}, each within {tolerance / MM:.2f} mm.",
            source=file_of(touches),
            line=int(touches.lines[rows[0]]),
            hint="correct the names of these touches.",
        )


def check_on_mesh(touches: ProbingSet, mesh: TriangleMesh, *, tolerance: float) -> tuple[str, ...]:
    """Returns warnings about feature points off the part; surface touches off it raise.

    Args:
        touches: Of one part.
        mesh: The part.
        tolerance: m, largest distance of a nominal point from the surface it names.

    Raises:
        ImplausibleDataError: Nominal points of surface touches off the part, or normals that do
            not look out of it.
    """
    distance, outward = mesh.nearest(touches.point)
    off = np.abs(distance) > tolerance
    wrong = np.flatnonzero(off & ~touches.full)
    if len(wrong):
        raise ImplausibleDataError(
            f"nominal points off the part by more than {tolerance / MM:.2f} mm: "
            + list_names([f"{touches.labels[i]} ({distance[i] / MM:+.2f} mm)" for i in wrong])
            + ".",
            source=file_of(touches),
            line=int(touches.lines[wrong[0]]),
            hint="check px_mm, py_mm, pz_mm, the unit of the mesh (--mesh-unit) and its origin.",
        )
    with_normal = ~np.isnan(touches.normal[:, 0])
    along = np.einsum("ij,ij->i", np.nan_to_num(touches.normal), outward)
    inward = np.flatnonzero(with_normal & (along < np.cos(30.0 * DEG)))
    if len(inward):
        raise ImplausibleDataError(
            "normals that are not those of the part: "
            + list_names(
                [
                    f"{touches.labels[i]} (off by {np.arccos(np.clip(along[i], -1, 1)) / DEG:.0f}"
                    " deg)"
                    for i in inward
                ]
            )
            + ".",
            source=file_of(touches),
            line=int(touches.lines[inward[0]]),
            hint="nx, ny, nz point out of the material.",
        )
    far = np.flatnonzero(off & touches.full)
    if not len(far):
        return ()
    return (
        "Feature points off the mesh (right for a ball or the middle of a hole): "
        + list_names([f"{touches.labels[i]} ({distance[i] / MM:+.2f} mm)" for i in far])
        + ".",
    )


def file_of(touches: ProbingSet) -> str | None:
    """Returns the file the touches are from; None without one."""
    return touches.source.split(" sha256:")[0] or None
