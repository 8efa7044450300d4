"""What an estimate from touches is told, and what it returns: arm and frames, known together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from robotrue.calibration.belief import Belief
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.parameters import Layout
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.touches import frame_displacement
from robotrue.core.arrays import Array, BoolArray, frozen
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.statics import NO_LOAD, Load


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingSettings:
    """What the estimate is told besides the arm and the touches.

    Attributes:
        touch_sigma: m per axis of one touch: probe, surface, hand; without the arm.
        tool_sigma: m per axis, how far the tool point may be from where the model has it. 0: the
            tool that was measured is still in its holder; for a nominal arm that of ``priors``.
        T_flange_tool: (4, 4) nominal tool of the touches, if another than the model's; what the
            model knew of its own tool then does not apply, and ``tool_sigma`` must say how well
            this one is known.
        robust: Name and leave out touches that disagree.
        learn: Let the touches scale the priors of a nominal arm, and noise beyond ``touch_sigma``.
        payload: On the flange while touching.
        priors: Of a nominal arm: scales, stiffness, repeatability.
        start: ``T_base_part`` of parts whose touches do not say roughly where they stand.
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
        """Refuses values that cannot be.

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
        outliers: Labels of the touches that were not believed.
        sigma: m per axis, noise of one touch: stated, repeatability and learned white noise.
        misfit: Residuals over ``sigma``, about 1 where it explains them: root mean square over the
            degrees of freedom that the estimate leaves.
        parents: The model it began with; none for a nominal arm.
        summary: JSON values for the refined model.
    """

    belief: Belief
    T_base_part: Mapping[int, Array]
    layout: Layout
    touches: ProbingSet
    residuals: Array
    outliers: tuple[str, ...]
    sigma: float
    misfit: float
    parents: tuple[ErrorModel, ...]
    summary: Mapping[str, Any]

    @property
    def distances(self) -> Array:
        """Length of each residual, (n,) m."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    @property
    def believed(self) -> BoolArray:
        """(n,) True where the touch was believed."""
        return np.array([label not in self.outliers for label in self.touches.labels])

    @property
    def rms(self) -> float:
        """Root mean square length of the believed residuals, m."""
        return float(np.sqrt(np.mean(self.distances[self.believed] ** 2)))

    def columns(self, part: int) -> slice:
        """Returns where the frame of a part stands in the belief.

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
    end = estimate.belief.end
    arm = replace(
        estimate.belief,
        mean=estimate.belief.mean[:end],
        root=estimate.belief.root[:, :end],
        nuisances=0,
    )
    return model_of(arm, estimate.summary)
