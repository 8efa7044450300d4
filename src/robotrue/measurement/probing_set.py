"""Touches of parts by the robot, or by another probe: the noun of registration."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, count_rows
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.surfaces import Surface
from robotrue.errors import ShapeError

NO_SURFACE = -1
"""Surface number of a touch that names none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownDistance:
    """A length between the origins of two parts, from a gauge bar, a drawing or a tracker.

    Attributes:
        first: Number of one part.
        second: Number of the other.
        length: m.
        sigma: m, standard deviation of ``length``.
    """

    first: int
    second: int
    length: float
    sigma: float

    def __post_init__(self) -> None:
        """Refuses lengths that carry no direction and invalid uncertainties.

        Raises:
            ShapeError: One part twice, a length below 1 mm, or a sigma that is not positive.
        """
        if self.first == self.second:
            raise ShapeError(f"a distance of part {self.first} from itself.")
        if not 1e-3 <= self.length < np.inf or not 0.0 < self.sigma < np.inf:
            raise ShapeError(
                f"distance {self.length * 1e3:g} mm with sigma {self.sigma * 1e3:g} mm between "
                f"parts {self.first} and {self.second}: 1 mm or more and a positive sigma expected."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingSet(Columns):
    """n touches. SI; rows of all arrays belong together.

    A touch fixes three directions (a feature point), or one: where ``normal`` is given, that of the
    nominal surface there; where ``touched`` names one of ``surfaces``, the normal of that surface
    at the touch. A part whose number is in ``sockets`` has no axes: it is a place, touched from
    several attitudes, and ``point`` is zero there.

    Attributes:
        names: (n) of the features; repeated touches have the same name.
        point: (n, 3) m, nominal point in part; for a surface roughly where it was touched.
        joints: (n, dof) rad at the touch, in the robot model's sense; (0, 0) where the probe was
            not the robot.
        position: (n, 3) m in base as another instrument or the controller gave it; NaN where the
            joints are used.
        normal: (n, 3) outward in part, normalised; NaN at a full point.
        part: (n,) number of the part, or of its side or clamping, each with its own frame.
        surfaces: Of the parts; each in the frame of the part whose touches name it.
        touched: (n,) index of the touched surface, or ``NO_SURFACE``.
        radius: m, of the probe's ball; the tool point is its centre. Surfaces and normals only.
        sockets: Numbers of parts that are places only.
        distances: Known between the origins of parts.
        source: File and SHA-256 the touches came from.
        lines: (n,) one-based line in it.
        provenance: Simulated or measured, instrument and file.
    """

    names: Annotated[tuple[str, ...], Column("n")]
    point: Annotated[Array, Column("n 3", unit="m")]
    joints: Annotated[Array, Column("touched_by_arm dof", unit="rad")] = EMPTY
    position: Annotated[Array, Column("n 3", unit="m", nan=True, fill=np.nan)] = EMPTY
    normal: Annotated[Array, Column("n 3", nan=True, fill=np.nan)] = EMPTY
    part: Annotated[IntArray, Column("n", fill=0)] = EMPTY
    surfaces: tuple[Surface, ...] = ()
    touched: Annotated[IntArray, Column("n", fill=NO_SURFACE)] = EMPTY
    radius: float = 0.0
    sockets: tuple[int, ...] = ()
    distances: tuple[KnownDistance, ...] = ()
    source: str = ""
    lines: Annotated[IntArray, Column("n", fill=count_rows)] = EMPTY
    provenance: Provenance = MEASURED

    def __post_init__(self) -> None:
        """Normalises directions; checks indices and the data of each touch.

        Raises:
            ShapeError: Wrong indices, a normal of length zero, a row with neither joints nor
                position, a socket that is not in the set or has points other than zero.
        """
        self._check_columns(touched_by_arm=len(self.names) if np.size(self.joints) else 0)
        self._set_column("normal", self._unit_normals())
        self._check_rows()
        self._check_parts()

    def __len__(self) -> int:
        return len(self.names)

    @property
    def has_joints(self) -> bool:
        """True if the robot was the probe and its joints are known."""
        return len(self.joints) > 0

    @property
    def full(self) -> BoolArray:
        """(n,) True where a touch fixes all three directions."""
        return np.asarray(np.isnan(self.normal[:, 0]) & (self.touched == NO_SURFACE))

    @property
    def parts(self) -> tuple[int, ...]:
        """Numbers of the parts, rising."""
        return tuple(np.unique(self.part).tolist())

    @property
    def labels(self) -> tuple[str, ...]:
        """(n) names that are different: repeated ones carry their count, ``K``, ``K (2)``."""
        seen: dict[str, int] = {}
        out = []
        for name in self.names:
            seen[name] = seen.get(name, 0) + 1
            out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
        return tuple(out)

    def subset(self, rows: npt.ArrayLike) -> ProbingSet:
        """Returns the chosen touches (indices or a mask), in that order.

        Sockets and distances of parts that are left without a touch go with them.
        """
        index = np.arange(len(self))[np.asarray(rows) if np.size(rows) else []]
        columns = {
            f.name: getattr(self, f.name)[index]
            for f in fields(self)
            if f.name in ("point", "position", "normal", "part", "touched", "lines")
        }
        kept = set(columns["part"].tolist())
        return replace(
            self,
            names=tuple(self.names[i] for i in index),
            joints=self.joints[index] if self.has_joints else self.joints,
            sockets=tuple(k for k in self.sockets if k in kept),
            distances=tuple(d for d in self.distances if {d.first, d.second} <= kept),
            **columns,
        )

    def _unit_normals(self) -> Array:
        length = np.linalg.norm(self.normal, axis=1)
        for row in np.flatnonzero(length < 1e-9).tolist():
            raise ShapeError(
                f"normal of touch {self.names[row]!r} has length {length[row]:g}, expected a "
                "direction, or NaN for a full point."
            )
        half = np.isnan(self.normal).any(axis=1) & ~np.isnan(self.normal).all(axis=1)
        for row in np.flatnonzero(half).tolist():
            raise ShapeError(f"normal of touch {self.names[row]!r} is {self.normal[row]}.")
        return np.asarray(self.normal / length[:, None])

    def _check_rows(self) -> None:
        if not self.has_joints:
            for row in np.flatnonzero(~np.isfinite(self.position).all(axis=1)).tolist():
                raise ShapeError(
                    f"touch {self.names[row]!r} has neither joints nor a position in base."
                )
        if len(self) and not NO_SURFACE <= self.touched.min() <= self.touched.max() < len(
            self.surfaces
        ):
            raise ShapeError(
                f"touched names surfaces {self.touched.min()} to {self.touched.max()}, there are "
                f"{len(self.surfaces)}, counted from 0; {NO_SURFACE} is none."
            )
        for row in np.flatnonzero(~np.isnan(self.normal[:, 0]) & (self.touched >= 0)).tolist():
            raise ShapeError(
                f"touch {self.names[row]!r} names a surface and a normal; one of them is enough."
            )
        if not 0.0 <= self.radius < np.inf:
            raise ShapeError(f"probe radius is {self.radius:g} m, expected 0 or more.")

    def _check_parts(self) -> None:
        there = set(self.part.tolist())
        asked = {*self.sockets, *(k for d in self.distances for k in (d.first, d.second))}
        if not asked <= there:
            raise ShapeError(
                f"no touch of part {sorted(asked - there)[0]}; parts: {sorted(there)}."
            )
        for row in np.flatnonzero(np.isin(self.part, self.sockets)).tolist():
            if np.any(self.point[row] != 0.0) or not self.full[row]:
                raise ShapeError(
                    f"touch {self.names[row]!r} of socket {self.part[row]} has a point or a "
                    "normal; a socket is a place: its point is 0, 0, 0."
                )
