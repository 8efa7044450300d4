"""The paper's regression: support vectors on principal components of joints and force.

Source: Jin, Sun, Tang, Li 2022, section 2; components by eq. 3-6: divisor N - 1, eigenvalues from
large to small, as many components as carry 95 % of the variance. Eight columns of one pass are two
numbers for the place on its line, peak and mean force: four components carry all of it. Over
several passes the rule drops directions of the pose. Kernel, C, gamma and epsilon are not printed:
a radial kernel with the three chosen by cross-validation inside the training windows.
Kept as the baseline; :mod:`robotrue.dynamics.deviation` is what robotrue uses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.core.archive import Archive, archive_reader
from robotrue.core.archive_tables import pack_table, unpack_table
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.columns import Columns
from robotrue.core.document_decoder import decode
from robotrue.dynamics.deviation_physics import CompliantArm, physics_terms
from robotrue.dynamics.learned_deviation import (
    DeviationPrediction,
    SampleTerms,
    WindowTrust,
    archive_learned,
    arm_from,
    windows_from,
)
from robotrue.dynamics.paper_learners import (
    Components,
    SupportVectors,
    components_of,
    fit_vectors,
    squared_distance,
)
from robotrue.dynamics.window_folds import folds
from robotrue.dynamics.windows import WindowSet, check_for_fit
from robotrue.errors import ShapeError

KIND: Final = "jin2022-deviation"
SCHEMA: Final = 1
_COMPONENTS: Final = ("mean", "deviation", "eigenvalues", "loadings")
LIKE_KNOWN: Final = 0.5
"""Kernel with the nearest window learned from, below which a window is unlike all of them."""


def paper_columns(windows: WindowSet) -> Array:
    """Returns the paper's columns (n, dof + 2): joints in rad, peak and mean force in N.

    Standardisation takes the units out: degrees or radians make no difference.
    """
    return np.column_stack([windows.joints, windows.force_peak, windows.force_mean])


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperModel(Columns):
    """Deviation by support vectors on components; a :class:`LearnedDeviation`.

    Attributes:
        arm: As stated: its limits and the direction of the error; no stiffness is used.
        windows: Learned from.
        components: Of their columns.
        machine: The fitted regression.
        held_out: m, root mean square of blocks of the windows held out, C, gamma and epsilon kept.
    """

    arm: CompliantArm
    windows: WindowSet
    components: Components
    machine: SupportVectors
    held_out: float

    def _check_rules(self) -> None:
        """Checks that the parts belong together.

        Raises:
            ShapeError: They do not.
        """
        columns, kept = self.windows.joints.shape[1] + 2, self.components.count
        if len(self.components.mean) != columns or self.machine.vectors.shape[1] != kept:
            raise ShapeError(
                f"{len(self.components.mean)} columns and vectors of "
                f"{self.machine.vectors.shape[1]} components, expected {columns} and {kept}."
            )
        if not (1 <= kept <= columns and (self.components.deviation > 0.0).all()):
            raise ShapeError(f"{kept} components of columns with a negative deviation.")
        if not (self.held_out >= 0.0 and self.machine.gamma > 0.0):
            raise ShapeError(f"held-out error {self.held_out} m, gamma {self.machine.gamma}.")

    @property
    def by_sample(self) -> SampleTerms:
        """Nothing: the paper's deviation is one number a window."""
        zero = np.zeros(self.arm.robot.dof)
        return SampleTerms(compliance=zero, tool=np.zeros(3), offset=0.0, gain=0.0, gain_at=0.0)

    def predict(self, windows: WindowSet) -> DeviationPrediction:
        """Returns the error of windows: predicted plus learned deviation (eq. 2).

        The paper states no band. Given are the error of held-out blocks where a window is like
        those learned from, and the scatter of all deviations besides where it is not: there the
        regression falls back to one constant.

        Raises:
            ModelMismatchError: Windows of another arm.
        """
        outside = physics_terms(self.arm, windows).outside
        windows = self._as_learned(windows)
        columns = paper_columns(windows)
        deviation = _deviation_of(self.components, self.machine, self.windows, windows)
        far = ~self._is_like_known(columns)
        sd = np.where(far, np.hypot(self.held_out, _scale(self.windows)), self.held_out)
        deviation[outside] = sd[outside] = np.nan
        standing = np.where(far, WindowTrust.EXTRAPOLATED, WindowTrust.INSIDE)
        return DeviationPrediction(
            error=windows.predicted + deviation,
            deviation=deviation,
            sd=sd,
            physics=np.where(outside, np.nan, 0.0),
            standing=np.where(outside, WindowTrust.INVALID, standing).astype(np.int64),
        )

    def _as_learned(self, windows: WindowSet) -> WindowSet:
        """Windows whose mean force counts the way it did in training.

        The paper prints it negative where the error is positive, others along the error.
        """
        own, asked = (
            float(((each.force @ self.arm.direction) * each.force_mean).sum())
            for each in (self.windows, windows)
        )
        return replace(windows, force_mean=-windows.force_mean) if own * asked < 0.0 else windows

    def _is_like_known(self, columns: Array) -> BoolArray:
        """Returns (n,), true where a window is near a training window in all columns."""
        known = self.components.standardise(paper_columns(self.windows))
        distance = squared_distance(self.components.standardise(columns), known).min(axis=1)
        return np.asarray(np.exp(-self.machine.gamma * distance) >= LIKE_KNOWN)

    def to_archive(self) -> Archive:
        """Returns the model as document and arrays (SI)."""
        machine, vectors = pack_table(self.machine)
        document = {
            "components": self.components.count,
            **machine,
            "held_out_m": self.held_out,
        }
        arrays = {name: getattr(self.components, name) for name in _COMPONENTS}
        return archive_learned(KIND, SCHEMA, self, document, {**arrays, **vectors})


def fit_paper(windows: WindowSet, arm: CompliantArm) -> PaperModel:
    """Returns the paper's regression of the deviation on joints, peak and mean force.

    Args:
        windows: Measured.
        arm: Limits of its joints and direction of the error.

    Raises:
        ObservabilityError: Too few windows, or one without a measurement.
        ImplausibleDataError: A column that does not vary, or of another unit.
        ModelMismatchError: Windows of another arm, or outside its limits.

    Fails when: it predicts at poses without training windows; it then returns its mean without a
    warning.
    """
    check_for_fit(windows, physics_terms(arm, windows).outside)
    components, machine = _fit_machine(windows)
    trial = (machine.penalty, machine.gamma, machine.tube)
    residual = []
    for train, test in folds(windows, "blocks"):
        known, held = windows.take(train), windows.take(test)
        parts = _fit_machine(known, trial)
        residual.append(_deviation_of(*parts, known, held) - held.deviation)
    return PaperModel(
        arm=arm,
        windows=windows,
        components=components,
        machine=machine,
        held_out=float(np.sqrt((np.concatenate(residual) ** 2).mean())),
    )


@archive_reader
def paper_from_archive(archive: Archive) -> PaperModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: Another kind, damaged, or written by a newer robotrue.
    """
    archive.expect(KIND, SCHEMA, hint="it is what `robotrue dynamics fit --method jin2022` writes.")
    document = dict(archive.document)
    count = decode(int, document["components"], key="components")
    return PaperModel(
        arm=arm_from(archive),
        windows=windows_from(archive),
        components=Components(
            count=count,
            **{name: archive.array(name) for name in _COMPONENTS},
        ),
        machine=unpack_table(SupportVectors, archive, document),
        held_out=decode(float, document["held_out_m"], key="held_out_m"),
    )


def _fit_machine(
    windows: WindowSet, trial: tuple[float, float, float] | None = None
) -> tuple[Components, SupportVectors]:
    """Components and regression of windows; C, gamma, epsilon are searched for without a trial."""
    columns = paper_columns(windows)
    components = components_of(columns)
    values = (windows.deviation - windows.deviation.mean()) / _scale(windows)
    return components, fit_vectors(components.scores(columns), values, trial)


def _deviation_of(
    components: Components, machine: SupportVectors, known: WindowSet, asked: WindowSet
) -> Array:
    """The deviation (n,) m of windows by what was learned from known ones."""
    values = machine.values(components.scores(paper_columns(asked)))
    return np.asarray(known.deviation.mean() + _scale(known) * values)


def _scale(windows: WindowSet) -> float:
    return float(windows.deviation.std()) or 1.0
