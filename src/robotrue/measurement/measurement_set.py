"""The one immutable noun for measured poses, whatever instrument they came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import EMPTY, Column, Columns, concat, count_rows
from robotrue.core.conditions import ArmConditions, Rail, join_conditions
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.errors import ShapeError
from robotrue.measurement.probing_set import ProbingSet

MeasurementFrame: TypeAlias = Literal["base", "tracker"]
"""``base``: positions are in the robot base. ``tracker``: in an instrument frame not yet known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementSet(Columns):
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
        temperature: (n,) K of the arm as a whole, NaN = unknown.
        joint_temperature: (n, dof) K of each joint, NaN = unknown.
        time: (n,) s on one clock, NaN = unknown.
        external: (n, 6) external axes E1 to E6, m or rad, NaN = unknown.
        rail: The external axis that carried the arm, if any. Positions in base are in the base
            that it carries; those in a tracker frame are as the tracker saw them.
        target: (n,) index of the reflector.
        station: (n,) index of the instrument set-up.
        group: (n,) index of the set (file, campaign, block) the row belongs to.
        group_names: Name of each group.
        source_row: (n,) one-based line in the source file.
        sources: Per group: file name and SHA-256, ``"grid.csv sha256:ab12..."``.
        provenance: Simulated or measured, instrument and files of all rows.
        dof: Number of joints.
        has_rotation: (n,) True where the full pose was measured.
    """

    joints: Annotated[Array, Column("n dof", unit="rad")]
    position: Annotated[Array, Column("n 3", unit="m")]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2")]
    frame: MeasurementFrame = "base"
    rotation: Annotated[Array, Column("n 3 3", nan=True, fill=np.nan)] = EMPTY
    rotation_covariance: Annotated[Array, Column("n 3 3", unit="rad^2", nan=True, fill=np.nan)] = (
        EMPTY
    )
    wrench: Annotated[Array, Column("n 6", fill=0.0)] = EMPTY
    payload_mass: Annotated[Array, Column("n", unit="kg", nan=True, fill=np.nan)] = EMPTY
    payload_com: Annotated[Array, Column("n 3", unit="m", nan=True, fill=np.nan)] = EMPTY
    approach: Annotated[Array, Column("n dof", fill=0.0)] = EMPTY
    temperature: Annotated[Array, Column("n", unit="K", nan=True, fill=np.nan)] = EMPTY
    joint_temperature: Annotated[Array, Column("n dof", unit="K", nan=True, fill=np.nan)] = EMPTY
    time: Annotated[Array, Column("n", unit="s", nan=True, fill=np.nan)] = EMPTY
    external: Annotated[Array, Column("n 6", unit="m, rad", nan=True, fill=np.nan)] = EMPTY
    rail: Rail | None = None
    target: Annotated[npt.NDArray[np.int64], Column("n", fill=0)] = EMPTY
    station: Annotated[npt.NDArray[np.int64], Column("n", fill=0)] = EMPTY
    group: Annotated[npt.NDArray[np.int64], Column("n", fill=0)] = EMPTY
    group_names: tuple[str, ...] = ("set 1",)
    source_row: Annotated[npt.NDArray[np.int64], Column("n", fill=count_rows)] = EMPTY
    sources: tuple[str, ...] = ()
    provenance: Provenance = MEASURED
    dof: int = field(init=False, repr=False)
    has_rotation: BoolArray = field(init=False, repr=False)

    def _check_rules(self) -> None:
        """Every group needs a name."""
        object.__setattr__(self, "dof", self.joints.shape[1])
        posed = np.isfinite(self.rotation).all(axis=(1, 2))
        object.__setattr__(self, "has_rotation", posed)
        if len(self) and int(self.group.max()) >= len(self.group_names):
            raise ShapeError(
                f"group {int(self.group.max())} has no name: {len(self.group_names)} names given."
            )

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def conditions(self) -> ArmConditions:
        """Temperature, time and place on the rail; of a joint without one, that of the arm.

        Other external axes carry parts and do not move a point that is measured on the arm.
        """
        external = np.full_like(self.external, np.nan)
        if self.rail is not None:
            rail = self.rail.number - 1
            external[:, rail] = self.external[:, rail]
        return join_conditions(
            temperature=self.temperature,
            joint_temperature=self.joint_temperature,
            time=self.time,
            external=external,
        )

    @property
    def carried(self) -> Array:
        """Offset (n, 3) m of the arm's base from the stated one, in base axes.

        Zero for positions in base, which do not contain it.
        """
        if self.rail is None or self.frame == "base":
            return np.zeros((len(self), 3))
        return self.rail.carry(self.external)

    @property
    def floor_position(self) -> Array:
        """Positions (n, 3) m as in a file, in the base where the rail is ``at``."""
        if self.rail is None or self.frame != "base":
            return self.position
        return np.asarray(self.position + self.rail.carry(self.external))

    def file_of(self, row: int) -> str:
        """Returns the name of the file a row was read from; empty if it was made in code."""
        group = int(self.group[row])
        return self.sources[group].split(" sha256:")[0] if group < len(self.sources) else ""

    def subset(self, rows: npt.ArrayLike) -> MeasurementSet:
        """Returns the chosen rows (indices or a mask), in that order."""
        return self.take(np.asarray(rows))


def concatenate(sets: Sequence[MeasurementSet]) -> MeasurementSet:
    """Returns all rows of several sets; groups stay separate, station and target numbers remain.

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
    return concat(
        sets,
        group=np.concatenate(groups),
        group_names=tuple(names),
        sources=tuple(source for s in sets for source in s.sources),
        provenance=merge(s.provenance for s in sets),
    )


def touched_rows(touches: ProbingSet, *, sigma: float) -> MeasurementSet:
    """Returns full points touched by the robot as measurements, so that every method fits them.

    A part is a tracker frame that is not known yet, its nominal points are what that tracker saw; a
    socket is a place that only shifts. Known distances have no row and do not come along.

    Args:
        touches: With joints.
        sigma: m per axis of one touch, without the robot.

    Raises:
        ShapeError: Touches without joints, or on surfaces: those fix one direction each.
    """
    if not touches.has_joints or not touches.full.all():
        raise ShapeError(
            f"{int((~touches.full).sum())} of {len(touches)} touches fix one direction only, "
            f"{touches.joints.shape[1]} joints; rows of a measurement set need joints and full "
            "points."
        )
    n = len(touches)
    parts = touches.parts
    return MeasurementSet(
        joints=touches.joints,
        position=touches.point,
        covariance=np.tile(sigma**2 * np.eye(3), (n, 1, 1)),
        frame="tracker",
        station=touches.part,
        group=np.searchsorted(parts, touches.part),
        group_names=tuple(f"part {k}" for k in parts),
        source_row=touches.lines,
        sources=(touches.source,) if touches.source else (),
        provenance=touches.provenance,
    )
