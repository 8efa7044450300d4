"""Whether a program with steps in its path may be written, and what is said of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from robotrue.compensation.steps import Step, Steps
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, StepError


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRule:
    """What is allowed between a target left alone and its compensated neighbours.

    Attributes:
        max_mm: Largest step.
        allow: Write the program all the same.
    """

    max_mm: float
    allow: bool = False

    def __post_init__(self) -> None:
        """Refuses a limit that is none.

        Raises:
            ConfigurationError: Below 0, or not finite.
        """
        if not 0.0 <= self.max_mm < math.inf:
            raise ConfigurationError(
                f"--max-step is {self.max_mm:g} mm, expected 0 or more.", hint="--max-step 0.1"
            )

    def require(self, steps: Steps, name: str) -> None:
        """Passes if the program may be written.

        Raises:
            StepError: A step beyond the limit, and steps are not allowed.
        """
        if self.allow or steps.worst is None or steps.largest <= self.max_mm * MM:
            return
        fault = StepError(
            f"{_counted(steps)}, above {self.max_mm:g} mm; {_which(steps.worst)}. Nothing was "
            "written.",
            source=name,
            hint="--allow-steps; the notes say why targets are left alone, and what cures it.",
        )
        fault.detail = {"steps": self.document(steps)}
        raise fault

    def document(self, steps: Steps) -> dict[str, Any]:
        """Returns JSON values: the steps, and what is allowed."""
        return {**steps.document(), "limit_mm": self.max_mm, "allowed": self.allow}


def path_sentence(steps: Steps) -> str:
    """Returns how much of the path is compensated; empty if all of it, or if there is none."""
    if not 0.0 <= steps.corrected < steps.length:
        return ""
    share = 100.0 * steps.corrected / steps.length
    return (
        f"{steps.corrected / MM:.1f} of {steps.length / MM:.1f} mm of the path "
        f"({share:.1f} %) lie between compensated targets"
    )


def steps_sentence(steps: Steps) -> str:
    """Returns how many steps there are and which is the largest; empty without any."""
    return "" if steps.worst is None else f"{_counted(steps)}; {_which(steps.worst)}."


def _counted(steps: Steps) -> str:
    size = f"{steps.largest / MM:.3f} mm"
    where = "in the path between targets left alone and compensated ones"
    if steps.count == 1:
        return f"1 step of {size} {where}"
    return f"{steps.count} steps {where}, the largest {size}"


def _which(step: Step) -> str:
    return f"from {step.before} to {step.after}, {step.left} is left alone"
