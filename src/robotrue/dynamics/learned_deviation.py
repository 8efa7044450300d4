"""Contract of learned deviations of the dynamic error: estimates of windows, terms of samples.

Compliant joints with a residual process (:mod:`robotrue.dynamics.deviation`) and the paper's
components with support vectors (:mod:`robotrue.dynamics.paper_regression`) have one interface for
commands, the sensing service and pages; only their archives differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final, Protocol

import numpy as np

from robotrue.calibration.archive import robot_arrays, robot_document, robot_from
from robotrue.core.archive import Archive
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import provenance_from
from robotrue.dynamics.deviation_physics import CompliantArm
from robotrue.dynamics.windows import WindowSet

_ARRAYS: Final = ("joints", "force", "force_peak", "force_mean", "predicted")


class WindowTrust(IntEnum):
    """Trust in the estimate of a window."""

    INSIDE = 0
    EXTRAPOLATED = 1
    INVALID = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviationPrediction:
    """Error of each window, and its uncertainty.

    Attributes:
        error: (n,) m, e_w plus deviation; NaN where invalid.
        deviation: (n,) m.
        sd: (n,) m, of a measurement of that window.
        physics: (n,) m, the part of the deviation that compliant joints explain.
        standing: (n,) :class:`WindowTrust`.
    """

    error: Array
    deviation: Array
    sd: Array
    physics: Array
    standing: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleTerms(Columns):
    """The part of a deviation that follows the slow force sample by sample.

    Attributes:
        compliance: (dof,) rad/(N m), of the joints.
        tool: (3,) m/N along base x, y, z, subtracted.
        offset: m.
        gain: Of the predicted error beyond one.
        gain_at: m, predicted error that the gain counts from.
    """

    compliance: Annotated[Array, Column("dof", unit="rad/(N m)")]
    tool: Annotated[Array, Column("3", unit="m/N")]
    offset: float
    gain: float
    gain_at: float


class LearnedDeviation(Protocol):
    """A fitted deviation."""

    @property
    def arm(self) -> CompliantArm:
        """The arm as stated."""

    @property
    def windows(self) -> WindowSet:
        """Learned from."""

    @property
    def by_sample(self) -> SampleTerms:
        """Terms that follow the slow force sample by sample."""

    def predict(self, windows: WindowSet) -> DeviationPrediction:
        """Returns error, deviation and standard deviation of windows."""

    def to_archive(self) -> Archive:
        """Returns the model as document and arrays (SI)."""


def archive_learned(
    kind: str,
    schema: int,
    learned: LearnedDeviation,
    document: Mapping[str, object],
    arrays: Mapping[str, Array],
) -> Archive:
    """Returns the archive of a fitted deviation: its arm, its windows, and what is its own.

    Args:
        kind: Of the archive.
        schema: Version of the archive.
        learned: The deviation; :func:`arm_from` and :func:`windows_from` restore its parts.
        document: Its further JSON values.
        arrays: Its further arrays, SI.
    """
    arm, windows = learned.arm, learned.windows
    return Archive(
        kind=kind,
        schema=schema,
        document={
            "robot": robot_document(arm.robot),
            "passes": list(windows.passes),
            "zero_taken": windows.zero_taken.tolist(),
            "source": windows.source,
            "provenance": windows.provenance.to_document(),
            **document,
        },
        arrays={
            **robot_arrays(arm.robot),
            "stiffness": arm.stiffness,
            "direction": arm.direction,
            **{name: getattr(windows, name) for name in (*_ARRAYS, "measured")},
            **arrays,
        },
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _WindowsDocument:
    """Fields of a :class:`WindowSet` that are not numeric arrays."""

    passes: tuple[str, ...]
    source: str
    zero_taken: tuple[bool, ...] = ()
    provenance: object = None


def windows_from(archive: Archive) -> WindowSet:
    """Returns the windows that an archive keeps.

    Raises:
        ArchiveError: An array is missing, or holds what no quantity amounts to.
    """
    stated = decode(_WindowsDocument, dict(archive.document))
    return WindowSet(
        passes=stated.passes,
        zero_taken=np.array(stated.zero_taken, dtype=bool),
        source=stated.source,
        measured=archive.array("measured", finite=False),
        provenance=provenance_from(stated.provenance, before=[stated.source]),
        **{name: archive.array(name) for name in _ARRAYS},
    )


def arm_from(archive: Archive) -> CompliantArm:
    """Returns the arm that an archive keeps.

    Raises:
        ArchiveError: A part is missing, or cannot be.
    """
    return CompliantArm(
        robot=robot_from(archive),
        stiffness=archive.array("stiffness", finite=False),
        direction=archive.array("direction"),
    )
