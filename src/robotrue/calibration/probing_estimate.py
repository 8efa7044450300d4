"""Input and result of an estimate from touches, and the report of the refined model.

Arm and frames are known together; so are their uncertainties.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.calibration.belief import Belief, drop_nuisances
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.identifiability import visibility
from robotrue.calibration.model import ErrorModel, history, merged_document, record_step
from robotrue.calibration.parameters import ParameterLayout
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.touches import frame_displacement
from robotrue.calibration.training_summary import describe_parameters
from robotrue.calibration.update import renew_summary
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.files import sha256
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.model import parameter_names
from robotrue.robot.statics import NO_LOAD, Load


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingSettings:
    """Settings of the estimate besides the arm and the touches.

    Attributes:
        touch_sigma: m per axis of one touch: probe, surface, hand; without the arm.
        tool_sigma: m per axis, deviation of the tool point from that of the model. 0: the measured
            tool is still in its holder; for a nominal arm that of ``priors``.
        T_flange_tool: (4, 4) nominal tool of the touches, if another than the model's; the model's
            tool error then does not apply, and ``tool_sigma`` must state the uncertainty of this
            one.
        robust: Name and leave out touches that disagree.
        learn: Let the touches scale the priors of a nominal arm, and noise beyond ``touch_sigma``.
        payload: On the flange while touching.
        priors: Of a nominal arm: scales, stiffness, repeatability.
        start: ``T_base_part`` of parts whose touches do not determine a rough position.
    """

    touch_sigma: float = 5e-5
    tool_sigma: float = 0.0
    T_flange_tool: Array | None = None
    robust: bool = True
    learn: bool = True
    payload: Load = NO_LOAD
    priors: FitSettings = field(default_factory=FitSettings)
    start: Mapping[int, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuses invalid values.

        Raises:
            ConfigurationError: They are.
        """
        if not 0.0 < self.touch_sigma < 0.1:
            raise ConfigurationError(
                f"touch_sigma {self.touch_sigma / MM:g} mm, allowed above 0, below 100 mm.",
                hint="0.1 mm is written touch_sigma=1e-4.",
            )
        if not 0.0 <= self.tool_sigma < 0.1:
            raise ConfigurationError(
                f"tool_sigma {self.tool_sigma / MM:g} mm, allowed 0 to 100 mm.",
                hint="1 mm is written tool_sigma=1e-3.",
            )
        if self.T_flange_tool is not None:
            tool = frozen(self.T_flange_tool, (4, 4), "T_flange_tool")
            object.__setattr__(self, "T_flange_tool", tool)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingEstimate:
    """Arm and frames, known together.

    Attributes:
        belief: Joint posterior; its last columns are the frames, part by part in rising order: a
            shift and a left rotation vector of ``T_part_base`` each (a socket: the shift alone).
        T_base_part: (4, 4) of every part; a socket's axes are the base's.
        layout: Of robot errors and frames, as :class:`robotrue.calibration.new_rows.NewRows`.
        touches: As given.
        residuals: (n, 3) m in base, touched minus where the estimate has it; along the normal
            alone where a touch fixes only that.
        outliers: Labels of the rejected touches.
        sigma: m per axis, noise of one touch: stated, repeatability and learned white noise.
        misfit: Residuals over ``sigma``, about 1 where it explains them: root mean square over the
            degrees of freedom that the estimate leaves.
        parents: The model it began with; none for a nominal arm.
        summary: JSON values for the refined model.
    """

    belief: Belief
    T_base_part: Mapping[int, Array]
    layout: ParameterLayout
    touches: ProbingSet
    residuals: Array
    outliers: tuple[str, ...]
    sigma: float
    misfit: float
    parents: tuple[ErrorModel, ...]
    summary: Mapping[str, object]

    @property
    def distances(self) -> Array:
        """Length of each residual, (n,) m."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    @property
    def believed(self) -> BoolArray:
        """(n,) True where the touch was accepted."""
        return np.array([label not in self.outliers for label in self.touches.labels])

    @property
    def rms(self) -> float:
        """Root mean square length of the accepted residuals, m."""
        return float(np.sqrt(np.mean(self.distances[self.believed] ** 2)))

    def columns(self, part: int) -> slice:
        """Returns the columns of a part's frame in the belief.

        Raises:
            ModelMismatchError: No such part.
        """
        if part not in self.T_base_part:
            raise ModelMismatchError(
                f"part {part} was not touched; the estimate has {sorted(self.T_base_part)}."
            )
        place = self.layout.blocks[f"station/{part}"]
        shift = self.belief.end - self.layout.robot_size
        return slice(place.start + shift, place.stop + shift)

    def covariance(self, part: int = 0) -> Array:
        """Returns the covariance (6, 6) of a frame; (3, 3) of a socket.

        Displacement of the part's origin (m), then left rotation vector (rad), both in base axes.

        Raises:
            ModelMismatchError: No such part.
        """
        place = self.columns(part)
        turn = frame_displacement(self.T_base_part[part], place.stop - place.start)
        half = self.belief.root[:, place] @ turn.T
        out: Array = self.belief.inflation * half.T @ half
        return out

    def joint_covariance(self) -> Array:
        """Returns the covariance (p, p) of all columns of the belief, SI; inflation included."""
        out: Array = self.belief.inflation * self.belief.root.T @ self.belief.root
        return out


def model_of_estimate(estimate: ProbingEstimate) -> CalibratedModel:
    """Returns the arm as the estimate knows it, the frames left out, with its lineage."""
    return model_of(drop_nuisances(estimate.belief), estimate.summary)


NOISY: Final = 1.5
"""Ratio of the noise of the touches to the stated noise, from which it is reported."""


def touches_hash(touches: ProbingSet) -> str:
    """Returns the SHA-256 of joints, nominal points and parts."""
    return sha256(touches.joints.tobytes() + touches.point.tobytes() + touches.part.tobytes())


def probing_summary(
    before: Belief,
    after: Belief,
    touches: ProbingSet,
    outliers: Sequence[str],
    parents: Sequence[ErrorModel],
    settings: Mapping[str, object],
    rms: float,
    scatter: float,
) -> dict[str, object]:
    """Returns the summary of the refined model, JSON values.

    Args:
        before: Prior of the arm.
        after: Posterior.
        touches: All of them.
        outliers: Labels of the rejected ones.
        parents: The model it began with; none for a nominal arm.
        settings: What decided the result besides the data.
        rms: m, of the accepted residuals.
        scatter: Noise of the touches as learned, over that stated.
    """
    step = _probing_step(touches, outliers, parents, settings)
    doubts = [
        f"touches scatter {scatter:.1f} times the stated noise: touch_sigma is too small, the part "
        "is not as drawn, or the tool is not the one stated."
    ] * (scatter > NOISY)
    if parents:
        past = [old for parent in parents for old in history(parent)]
        origin = merged_document(parents, touches.provenance)
        summary = {**parents[0].training_summary(), "provenance": origin}
        summary["doubts"] = [*parents[0].training_summary().warnings, *doubts]
        return renew_summary(summary, [*past, step], after)
    return {
        "method": "probing",
        "rows": len(touches),
        "numbers": 3 * int(touches.full.sum()) + int((~touches.full).sum()),
        "screened_rows": step["screened_rows"],
        "data_sha256": step["data_sha256"],
        "sources": step["sources"],
        "provenance": touches.provenance.to_document(),
        "joint_range_rad": [
            touches.joints.min(axis=0).tolist(),
            touches.joints.max(axis=0).tolist(),
        ],
        "verdict": "conditional",
        "doubts": [
            "calibrated by touches only: arm, tool and part are determined together, at the "
            "touched postures; elsewhere use the stated uncertainty.",
            *doubts,
        ],
        "unseen": [],
        "parameters": _parameters(before, after),
        "white_sd_m": after.white,
        "rms_m": rms,
        "lineage": [step],
    }


def _probing_step(
    touches: ProbingSet,
    outliers: Sequence[str],
    parents: Sequence[ErrorModel],
    settings: Mapping[str, object],
) -> dict[str, object]:
    return {
        **record_step("probing", parents, None, settings, ()),
        "rows": len(touches),
        "data_sha256": touches_hash(touches),
        "sources": [touches.source] if touches.source else [],
        "screened_rows": [i for i, label in enumerate(touches.labels) if label in outliers],
        "outliers": list(outliers),
    }


def _parameters(before: Belief, after: Belief) -> dict[str, dict[str, object]]:
    size = len(after.errors)
    sd = np.sqrt(after.inflation * after.variance[:size])
    known = np.sqrt(before.inflation * before.variance[:size])
    kinds = [
        visibility(float(now / prior)) if prior > 0.0 else "fixed"
        for now, prior in zip(sd, known, strict=True)
    ]
    names = parameter_names(after.robot.dof)
    return describe_parameters(names, after.errors, sd, kinds)
