"""What registering is told besides the arm and the touches."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.mesh import TriangleMesh
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError

TOUCH: Final = 0.1 * MM
"""One touch, per axis: a tip or ball by hand or by a trigger."""
TOOL: Final = 0.3 * MM
"""A tip whose place in the flange comes from a drawing or a pointing exercise, per axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """Noise, tool, tolerance, mesh. SI.

    Attributes:
        touch: m per axis, one touch: probe, surface, hand; without the arm.
        robot: m per axis, the arm's error that is no rigid motion of the part, for telling wrong
            touches; default: the model's own at the touches, or that of a nominal arm.
        tool_sigma: m per axis, how well the tip is known in the flange; 0: unchanged since the
            model was made. Default: 0 where the tip is the point the model was made with, else
            0.3 mm.
        tolerance: m that machined points must keep; default: not judged.
        fit: ``auto``, ``frame`` (the model stays as it is) or ``joint``.
        T_flange_tool: (4, 4) of the tip; default: the tool of the model.
        mesh: The part; touches with a normal then lie on it.
        on_mesh: m, how far a nominal point may be off it.
        arm: Payload, repeatability and priors of the arm.
    """

    touch: float = TOUCH
    robot: float | None = None
    tool_sigma: float | None = None
    tolerance: float | None = None
    fit: Literal["auto", "frame", "joint"] = "auto"
    T_flange_tool: Array | None = None
    mesh: TriangleMesh | None = None
    on_mesh: float = 0.2 * MM
    arm: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        """Refuses sizes that cannot be.

        Raises:
            ConfigurationError: Negative, not finite, or 0 where nothing is exact.
        """
        for name, zero in (
            ("touch", False),
            ("robot", True),
            ("tool_sigma", True),
            ("tolerance", False),
            ("on_mesh", False),
        ):
            value = getattr(self, name)
            if value is not None and not (0.0 if zero else 1e-9) <= value < 0.1:
                raise ConfigurationError(
                    f"{name.replace('_', ' ')} is {value / MM:g} mm, expected "
                    f"{'0' if zero else 'above 0'} to 100 mm.",
                    hint="sizes are in mm on the command line and in m in Python.",
                )
        if self.fit not in ("auto", "frame", "joint"):
            raise ConfigurationError(
                f"fit {self.fit!r}, expected auto, frame or joint.", hint="--fit auto"
            )
