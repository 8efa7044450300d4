"""The one immutable noun for measured poses, whatever instrument they came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, frozen
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.errors import ShapeError

MeasurementFrame: TypeAlias = Literal["base", "tracker"]
"""``base``: positions are in the robot base. ``tracker``: in an instrument frame not yet known."""
_OF_THE_SET: Final = ("frame", "group_names", "sources", "provenance")
"""Fields that have no row for each pose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementSet:
    """n measured poses. SI; rows of all arrays belong together.

    Attributes:
        joints: (n, dof) rad, commanded, in the robot model's sense.
        position: (n, 3) m, measured point (reflector) in ``frame``.
        covariance: (n, 3, 3) m^2 of ``position``: the instrument alone, in ``frame``. The robot's
            repeatability belongs to the model.
        frame: Frame of ``position`` and ``rotation``.
        rotation: (n, 3, 3) measured orientation of the target in ``frame``; NaN where position
            only.
        rotation_covariance: (n, 3, 3) rad^2 of the left rotation vector; NaN where unknown.
        wrench: (n, 6) N, N m, external, at the tool point, base axes.
        payload_mass: (n,) kg at the flange; NaN means "the cell's payload".
        payload_com: (n, 3) m in the flange frame.
        approach: (n, dof) -1, 0 or +1: sign of the last motion of each joint, 0 = unknown.
        temperature: (n,) K, NaN = unknown.
        target: (n,) index of the reflector.
        station: (n,) index of the instrument set-up.
        group: (n,) index of the set (file, campaign, block) the row belongs to.
        group_names: Name of each group.
        source_row: (n,) one-based line in the source file.
        sources: Per group: file name and SHA-256, ``"grid.csv sha256:ab12..."``.
        provenance: Simulated or measured, instrument and files of all rows.
    """

    joints: Array
    position: Array
    covariance: Array
    frame: MeasurementFrame = "base"
    rotation: Array = field(default_factory=lambda: np.empty(0))
    rotation_covariance: Array = field(default_factory=lambda: np.empty(0))
    wrench: Array = field(default_factory=lambda: np.empty(0))
    payload_mass: Array = field(default_factory=lambda: np.empty(0))
    payload_com: Array = field(default_factory=lambda: np.empty(0))
    approach: Array = field(default_factory=lambda: np.empty(0))
    temperature: Array = field(default_factory=lambda: np.empty(0))
    target: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    station: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    group: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    group_names: tuple[str, ...] = ("set 1",)
    source_row: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    sources: tuple[str, ...] = ()
    provenance: Provenance = MEASURED

    def __post_init__(self) -> None:
        """Checks every shape once; empty columns take their neutral value."""
        n = len(self.joints)
        dof = int(np.shape(self.joints)[1]) if np.ndim(self.joints) == 2 else 0
        nan = np.nan
        neutral: dict[str, Array] = {
            "rotation": np.full((n, 3, 3), nan),
            "rotation_covariance": np.full((n, 3, 3), nan),
            "wrench": np.zeros((n, 6)),
            "payload_mass": np.full(n, nan),
            "payload_com": np.full((n, 3), nan),
            "approach": np.zeros((n, dof)),
            "temperature": np.full(n, nan),
        }
        for name, shape in (
            ("joints", (n, None)),
            ("position", (n, 3)),
            ("covariance", (n, 3, 3)),
            ("rotation", (n, 3, 3)),
            ("rotation_covariance", (n, 3, 3)),
            ("wrench", (n, 6)),
            ("payload_mass", (n,)),
            ("payload_com", (n, 3)),
            ("approach", (n, dof)),
            ("temperature", (n,)),
        ):
            value = getattr(self, name)
            if n and np.size(value) == 0 and name in neutral:
                value = neutral[name]
            value = np.reshape(value, (0, *[s or 0 for s in shape[1:]])) if not n else value
            may_miss = name in neutral and name not in ("wrench", "approach")
            object.__setattr__(self, name, frozen(value, shape, name, allow_nan=may_miss))
        for name in ("target", "station", "group", "source_row"):
            value = getattr(self, name)
            if n and np.size(value) == 0:
                value = np.arange(1, n + 1) if name == "source_row" else np.zeros(n, np.int64)
            object.__setattr__(self, name, frozen(value, (n,), name, dtype=np.int64))
        if n and int(self.group.max()) >= len(self.group_names):
            raise ShapeError(
                f"group {int(self.group.max())} has no name: {len(self.group_names)} names given."
            )

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.joints.shape[1])

    @property
    def has_rotation(self) -> npt.NDArray[np.bool_]:
        """(n,) True where the full pose was measured."""
        return np.asarray(np.isfinite(self.rotation).all(axis=(1, 2)))

    def subset(self, rows: npt.ArrayLike) -> MeasurementSet:
        """Returns the chosen rows (indices or a mask), in that order."""
        index = np.asarray(rows)
        columns = {
            f.name: getattr(self, f.name)[index] for f in fields(self) if f.name not in _OF_THE_SET
        }
        return replace(self, **columns)


def concatenate(sets: Sequence[MeasurementSet]) -> MeasurementSet:
    """Returns all rows of several sets; groups stay apart, station and target numbers are kept.

    Raises:
        ShapeError: No sets, another number of joints, or frames that differ.
    """
    if not sets:
        raise ShapeError("no measurement sets to join.")
    first = sets[0]
    if any(s.dof != first.dof or s.frame != first.frame for s in sets):
        raise ShapeError("sets differ in number of joints or in frame; they cannot be joined.")
    names: list[str] = []
    groups = []
    for s in sets:
        groups.append(s.group + len(names))
        names.extend(s.group_names)
    columns = {
        f.name: np.concatenate([getattr(s, f.name) for s in sets])
        for f in fields(first)
        if f.name not in (*_OF_THE_SET, "group")
    }
    return MeasurementSet(
        frame=first.frame,
        group=np.concatenate(groups),
        group_names=tuple(names),
        sources=tuple(source for s in sets for source in s.sources),
        provenance=merge(s.provenance for s in sets),
        **columns,
    )
