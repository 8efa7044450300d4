"""A program compensated with the free rotation about its tool axis chosen, and what it won."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.compensate import compensate
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.redundancy import FreeSpinSettings, choose_spins
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError
from robotrue.program.program import Program
from robotrue.robot.spin import SpinSettings

_SHOWN = (
    ("stiffness_N_per_um", "stiffness along the force", "N/um"),
    ("deflection_across_feed_um", "deflection across the feed", "um"),
    ("limit_distance_deg", "distance from joint limits", "deg"),
    ("wrist_angle_deg", "angle of axes 4 and 6", "deg"),
)


def require_free_spin(model: ErrorModel | None, force: Array | DescribedForce) -> None:
    """Checks that there is a model to ask, and that the force does not turn with the tool frame.

    Raises:
        ConfigurationError: There is none, or it does.
    """
    if model is None:
        raise ConfigurationError(
            "--free-spin asks a calibrated model how the arm bends; here is only a cell.",
            hint="robotrue calibrate CELL MEASUREMENTS -o MODEL.",
        )
    if not isinstance(force, DescribedForce):
        return
    for part in force.parts:
        if part.axes == "tool":
            raise ConfigurationError(
                f"force {part.name!r} is in tool axes, which --free-spin turns.",
                hint='axes = "path" turns with the feed; axes = "base" stands still.',
            )


def compensate_with_spins(
    model: ErrorModel, program: Program, settings: CompensationSettings, cutter: Array
) -> tuple[Compensation, dict[str, Any]]:
    """Returns the compensation of a program with its spins chosen anew, and what they won.

    Raises:
        ConfigurationError: As :func:`robotrue.compensation.redundancy.choose_spins`.
    """
    free = FreeSpinSettings(spin=SpinSettings(cutter=cutter))
    found = choose_spins(model, program, free, settings=settings)
    result = found.written(program, compensate(model, found.program, settings=settings))
    return result, {**found.summary(), "notes": list(found.notes)}


def spin_sentences(won: Mapping[str, Any]) -> list[str]:
    """Returns what was won, one sentence each."""
    out = [
        f"tool axis: {won['targets_turned']} targets turned in {won['runs_turned']} of "
        f"{won['runs']} runs, at most by {won['largest_spin_deg']:.1f} deg"
    ]
    for key, what, unit in _SHOWN:
        if key in won:
            old, new = won[key]["before"], won[key]["after"]
            out.append(
                f"predicted {what}: {old['mean']:.3g} {unit} mean, {old['worst']:.3g} worst before;"
                f" {new['mean']:.3g} mean, {new['worst']:.3g} worst after"
            )
    return out
