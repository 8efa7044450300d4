"""Limits and times of the estimator, each with its reason."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from robotrue.dynamics.force import MOST
from robotrue.errors import ConfigurationError

_MAY_BE_ZERO: Final = ("bridged", "force_noise", "force_zero", "acceleration_samples")


@dataclass(frozen=True, slots=True, kw_only=True)
class SensingSettings:
    """How an estimate is made of samples.

    Attributes:
        joints_age: s; joints older than this say nothing about where the arm is.
        static_band: Hz; a change of the arm's compliance acts below it. Below the arm's first
            mode, above the changes of the cut.
        bridged: Missing or invalid force samples in a row that a straight line crosses; after
            more the filters start anew.
        force_noise: N, standard deviation of a force sample; that of the held tool where known.
        force_zero: N, standard deviation of the sensor's zero, each axis; of the held tool's
            offset and weight where that is known.
        force_most: N; the sensor's range. A force at or beyond it is saturated or not in N.
        lever: m; the cut's moment about the tool point over its force. Beyond it the axes of the
            sensor are not what they are said to be, or the tool point is not.
        acceleration_samples: Joint samples in the parabola that gives the acceleration of the
            held mass; 0: none is taken off.
    """

    joints_age: float = 0.1
    static_band: float = 2.0
    bridged: int = 2
    force_noise: float = 0.5
    force_zero: float = 0.4
    force_most: float = MOST
    lever: float = 0.05
    acceleration_samples: int = 25

    def __post_init__(self) -> None:
        """Checks.

        Raises:
            ConfigurationError: A value below zero, or zero where that has no sense.
        """
        for name, value in asdict(self).items():
            least = name in _MAY_BE_ZERO
            if not (np.isfinite(value) and (value >= 0.0 if least else value > 0.0)):
                raise ConfigurationError(
                    f"{name} is {value}, expected {'zero or more' if least else 'above zero'}."
                )
        if 0 < self.acceleration_samples < 5:
            raise ConfigurationError(
                f"acceleration_samples is {self.acceleration_samples}, expected 5 or more, or 0."
            )
