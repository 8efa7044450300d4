"""The learned deviation of the dynamic error: compliant joints and a residual process.

    e - e_w = sum_i alpha_i x_i - g . F + b + c (e_w - mean e_w) + rest

x_i is the bending of joint i under the mean force, with the stiffness the data sheet states;
alpha_i is near one. g takes back the static part that e_w has from a single pose: it is the static
row of the frequency response, where that is given, see :class:`StaticCompliance`. b and c are
offset and gain of e_w. The factors have Gaussian priors and are solved in closed form, ``(X^T C^-1
X + S^-1)^-1 (X^T C^-1 y + S^-1 m)``, with the covariance C of
:mod:`robotrue.dynamics.deviation_kernel`, whose sizes are learned by evidence. Where a pose or
force is unlike all training windows, the residual process is left out and only the physical model
is used.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.learners.posterior import Solved
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.document_decoder import decode
from robotrue.core.units import UM
from robotrue.dynamics.deviation_kernel import (
    DRIFT,
    NAMES,
    WindowRows,
    covariance,
    learn_sizes,
    part_of_pass,
    pose_covariance,
    solve_windows,
    variance,
    with_drift,
)
from robotrue.dynamics.deviation_physics import (
    CompliantArm,
    PhysicsTerms,
    StaticCompliance,
    physics_terms,
)
from robotrue.dynamics.learned_deviation import (
    DeviationPrediction,
    SampleTerms,
    WindowTrust,
    archive_learned,
    arm_from,
    windows_from,
)
from robotrue.dynamics.windows import WindowSet, check_for_fit, force_range
from robotrue.errors import ConfigurationError

KIND: Final = "dynamic-deviation"
SCHEMA: Final = 4
NEAR: Final = 0.5
"""Correlation with the nearest training window, below which a pose counts as unmeasured."""
WIDER: Final = 5.0
"""A static row that the windows contradict is taken for so much less well known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviationSettings:
    """Prior standard deviations.

    Attributes:
        compliance: Of the factor on each joint's stated compliance, about one.
        force: m/N, of g where no static row is given.
        offset: m, of b.
        gain: Of c.
        force_zero: N, of the dynamometer's zero where a pass begins, each axis.
        force_drift: N, of the drift of the zero over a pass, in proportion to the path, each axis:
            the prior before the passes are used, to a factor of 1.6.
        zero_left: N, of both where the zero was read before and after the cut and subtracted.
    """

    compliance: float = 0.20
    force: float = 1.0 * UM
    offset: float = 3.0 * UM
    gain: float = 0.2
    force_zero: float = 0.05
    force_drift: float = DRIFT
    zero_left: float = 0.05

    def __post_init__(self) -> None:
        """Checks signs."""
        for name, value in asdict(self).items():
            if not (np.isfinite(value) and value >= 0.0):
                raise ConfigurationError(f"prior {name} is {value}, expected zero or more.")


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviationModel(Columns):
    """A fitted deviation: windows learned from, and the sizes of what they share.

    Attributes:
        arm: The compliant arm as stated.
        settings: Priors.
        windows: Learned from.
        theta: (6,) logarithms, see ``deviation_kernel.NAMES``.
        row: Static row of the response of e_w, as far as the windows support it; or None.
        factors: (q,) posterior mean, computed: alpha per joint, g, b, c.
        factors_sd: (q,) their posterior standard deviations.
    """

    arm: CompliantArm
    settings: DeviationSettings
    windows: WindowSet
    theta: Annotated[Array, Column(f"{len(NAMES)}")]
    row: StaticCompliance | None = None
    factors: Array = field(init=False, repr=False, compare=False)
    factors_sd: Array = field(init=False, repr=False, compare=False)
    _old: WindowRows = field(init=False, repr=False, compare=False)
    _known: Solved = field(init=False, repr=False, compare=False)

    def _check_rules(self) -> None:
        """Solves once the system that every prediction needs."""
        old = _own_rows(self.settings, self.windows, physics_terms(self.arm, self.windows))
        mean, spread = _priors(self.arm, self.settings, self.row)
        known = solve_windows(old, self.windows.deviation - old.basis @ mean, self.theta, spread**2)
        half = known.whiten_rows(old.basis * spread**2)
        left = np.maximum(spread**2 - np.einsum("ij,ij->j", half, half), 0.0)
        object.__setattr__(self, "factors", mean + spread**2 * (old.basis.T @ known.alpha[:, 0]))
        object.__setattr__(self, "factors_sd", np.sqrt(left))
        object.__setattr__(self, "_old", old)
        object.__setattr__(self, "_known", known)

    @property
    def log_evidence(self) -> float:
        """Log evidence of the windows under the priors and sizes."""
        return self._known.log_evidence

    @property
    def sizes(self) -> dict[str, float]:
        """Sizes learned by evidence, SI."""
        return dict(zip(NAMES, np.exp(self.theta).tolist(), strict=True))

    @property
    def by_sample(self) -> SampleTerms:
        """Terms that follow the slow force sample by sample: all but the residual process."""
        dof = self.arm.robot.dof
        return SampleTerms(
            compliance=self.factors[:dof] / self.arm.stiffness,
            tool=self.factors[dof : dof + 3],
            offset=float(self.factors[dof + 3]),
            gain=float(self.factors[dof + 4]),
            gain_at=float(self.windows.predicted.mean()),
        )

    def predict(self, windows: WindowSet) -> DeviationPrediction:
        """Returns error, deviation and standard deviation of windows.

        Windows of a pass that was learned from (same name) share what changes along it.

        Raises:
            ModelMismatchError: Windows of another arm.
        """
        new, cross, standing = self._relate(windows)
        mean, spread = _priors(self.arm, self.settings, self.row)
        deviation = new.basis @ mean + cross @ self._known.alpha[:, 0]
        half = self._known.whiten_rows(cross.T)
        left = variance(new, self.theta, spread**2) - np.einsum("ij,ij->j", half, half)
        sd = np.sqrt(np.maximum(left, 0.0) + np.exp(2.0 * self.theta[4]))
        invalid = standing == WindowTrust.INVALID
        deviation[invalid] = sd[invalid] = np.nan
        return DeviationPrediction(
            error=windows.predicted + deviation,
            deviation=deviation,
            sd=sd,
            physics=np.where(invalid, np.nan, new.basis @ self.factors),
            standing=standing,
        )

    def predict_covariance(self, windows: WindowSet) -> Array:
        """Returns the covariance (n, n) m^2 of the measurements of windows about the prediction.

        Raises:
            ModelMismatchError: Windows of another arm.
        """
        new, cross, _ = self._relate(windows)
        prior = _priors(self.arm, self.settings, self.row)[1] ** 2
        half = self._known.whiten_rows(cross.T)
        out = covariance(new, new, self.theta, prior) - half.T @ half
        out.flat[:: len(out) + 1] += np.exp(2.0 * self.theta[4])
        return out

    def _relate(self, windows: WindowSet) -> tuple[WindowRows, Array, IntArray]:
        """Rows of windows, their covariance with the training windows, and the variance of each."""
        terms = physics_terms(self.arm, windows)
        names = {name: k for k, name in enumerate(self.windows.pass_names)}
        for name in windows.pass_names:
            names.setdefault(name, len(names))
        spread = _priors(self.arm, self.settings, self.row)[1]
        gain_at = float(self.windows.predicted.mean())
        new = _rows(self.settings, windows, terms, names, gain_at, self._old)
        cross = covariance(new, self._old, self.theta, spread**2)
        standing = self._standing(windows, terms, new, self._old)
        far = standing != WindowTrust.INSIDE
        cross[far] -= pose_covariance(new, self._old, self.theta)[far]
        return new, cross, standing

    def _standing(
        self, windows: WindowSet, terms: PhysicsTerms, new: WindowRows, old: WindowRows
    ) -> IntArray:
        nearest = pose_covariance(new, old, self.theta).max(axis=1) / np.exp(2.0 * self.theta[0])
        low, high = force_range(self.windows)
        strange = ((windows.force < low) | (windows.force > high)).any(axis=1)
        out = np.where((nearest < NEAR) | strange, WindowTrust.EXTRAPOLATED, WindowTrust.INSIDE)
        return np.asarray(np.where(terms.outside, WindowTrust.INVALID, out), dtype=np.int64)

    def to_archive(self) -> Archive:
        """Returns the model as document and arrays (SI)."""
        arrays = {"theta": self.theta, "factors": self.factors, "factors_sd": self.factors_sd}
        if self.row is not None:
            arrays |= {"row": self.row.value, "row_sd": self.row.sd}
        return archive_learned(KIND, SCHEMA, self, {"settings": asdict(self.settings)}, arrays)


def fit_deviation(
    windows: WindowSet, arm: CompliantArm, *, row: StaticCompliance | None = None
) -> DeviationModel:
    """Returns the deviation learned from measured windows.

    Args:
        windows: Measured; one pass is enough, several poses are better.
        arm: As stated by the data sheet.
        row: Static row of the response the windows were predicted with. Its deviation is chosen by
            evidence: as stated, or ``WIDER`` times as wide.

    Raises:
        ObservabilityError: Too few windows.
        ImplausibleDataError: Columns that do not vary, or are implausible for their name.
        ModelMismatchError: Windows of another arm, or outside its limits.

    Fails when: something other than the joints is compliant and depends on the pose: it is learned
    as residual near the windows, and unknown elsewhere.
    """
    settings = DeviationSettings()
    terms = physics_terms(arm, windows)
    check_for_fit(windows, terms.outside)
    rows = _own_rows(settings, windows, terms)
    trials = []
    for trusted in (None,) if row is None else (row, row.wider(WIDER)):
        mean, spread = _priors(arm, settings, trusted)
        values = windows.deviation - rows.basis @ mean
        theta = learn_sizes(rows, values, spread**2, settings.force_drift)
        trials.append(
            DeviationModel(arm=arm, settings=settings, windows=windows, theta=theta, row=trusted)
        )
    return max(trials, key=lambda trial: trial.log_evidence)


@archive_reader
def deviation_from_archive(archive: Archive) -> DeviationModel:
    """Returns the model of an archive.

    Raises:
        ArchiveError: Another kind, damaged, or written by a newer robotrue.
    """
    archive.expect(KIND, SCHEMA, hint="a deviation model is what `robotrue dynamics fit` writes.")
    # Until schema 2 the zero was taken to stay where it was, until 3 to drift as far as settings.
    stated = decode(dict[str, float], archive.document["settings"], key="settings")
    settings = DeviationSettings(**{"force_drift": 0.0} | stated)
    theta = archive.array("theta")
    return DeviationModel(
        arm=arm_from(archive),
        settings=settings,
        windows=windows_from(archive),
        theta=theta if archive.schema > 3 else with_drift(theta, settings.force_drift),
        row=StaticCompliance(value=archive.array("row"), sd=archive.array("row_sd"))
        if "row" in archive.arrays
        else None,
    )


def _priors(
    arm: CompliantArm, settings: DeviationSettings, row: StaticCompliance | None
) -> tuple[Array, Array]:
    """Mean and standard deviation (q,) of alpha, g, b, c."""
    n = arm.robot.dof
    mean = np.concatenate([np.ones(n), np.zeros(5)])
    spread = np.array(
        [settings.compliance] * n + [settings.force] * 3 + [settings.offset, settings.gain]
    )
    if row is not None:
        mean[n : n + 3], spread[n : n + 3] = row.value, row.sd
    return mean, spread


def _own_rows(settings: DeviationSettings, windows: WindowSet, terms: PhysicsTerms) -> WindowRows:
    """Rows of the windows learned from."""
    names = {name: k for k, name in enumerate(windows.pass_names)}
    return _rows(settings, windows, terms, names, float(windows.predicted.mean()))


def _rows(
    settings: DeviationSettings,
    windows: WindowSet,
    terms: PhysicsTerms,
    names: dict[str, int],
    gain_at: float,
    known: WindowRows | None = None,
) -> WindowRows:
    """Rows of windows; of a pass that is known, the way is counted as it was."""
    one = np.ones((len(windows), 1))
    centred = (windows.predicted - gain_at)[:, None]
    member = np.array([names[name] for name in windows.passes], dtype=np.int64)
    way = part_of_pass(terms.place, member, known)
    taken = windows.zero_taken[:, None]
    return WindowRows(
        basis=np.concatenate([terms.by_joint, -windows.force, one, centred], axis=1),
        joints=windows.joints,
        place=terms.place,
        member=member,
        way=way,
        zero=np.column_stack(
            [
                terms.compliance * np.where(taken, settings.zero_left, settings.force_zero),
                terms.compliance * np.where(taken, settings.zero_left, 0.0) * way[:, None],
            ]
        ),
        lever=np.where(taken, 0.0, terms.compliance * way[:, None]),
    )
