"""A KRL program that drives to poses and triggers an instrument at each. KRL text, no geometry.

Every pose: PTP to its pre-position where it has one, PTP to the pose, wait until it is quiet, pulse
a digital output, wait until the instrument has averaged. Axis targets in degrees with four
decimals; the program sets neither tool nor base, and moves are exact stops (no C_PTP).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.program.measuring_defaults import TRIGGER_OUTPUT

_LONGEST_NAME: Final = 24
_HIGHEST_OUTPUT: Final = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """Trigger for the instrument.

    Attributes:
        output: Number of the digital output.
        pulse: s, length of the pulse.
        settle: s of rest before it.
        measure: s of rest after it.
        speed: Per cent of the axis speeds.
    """

    output: int = TRIGGER_OUTPUT
    pulse: float = 0.2
    settle: float = 2.0
    measure: float = 3.0
    speed: int = 20

    def __post_init__(self) -> None:
        """Refuses what the controller would.

        Raises:
            ConfigurationError: An output, a time or a speed out of range.
        """
        if not 1 <= self.output <= _HIGHEST_OUTPUT:
            raise ConfigurationError(
                f"digital output {self.output}, expected 1 to {_HIGHEST_OUTPUT}."
            )
        if not 1 <= self.speed <= 100:
            raise ConfigurationError(f"speed {self.speed} %, expected 1 to 100.")
        if not (0.1 <= self.pulse <= 3.0 and self.settle >= 0.0 and self.measure >= 0.0):
            raise ConfigurationError(
                f"pulse {self.pulse:g} s, settle {self.settle:g} s, measure {self.measure:g} s: "
                "expected a pulse of 0.1 to 3 s and times of 0 or more."
            )


def measuring_program(name: str, axes: Array, pre: Array, trigger: Trigger) -> bytes:
    """Returns the ``.src`` file.

    Args:
        name: Name of the program, up to 24 letters, digits and underscores.
        axes: (n, 6) rad, the controller's axis values of the poses.
        pre: (n, 6) rad of their pre-positions, or (0, 6): none.
        trigger: Output and times.

    Raises:
        ConfigurationError: A name KRL does not allow, or an arm without six axes.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > _LONGEST_NAME:
        raise ConfigurationError(
            f"program name {name!r}: KRL allows up to {_LONGEST_NAME} letters, digits and "
            "underscores, a letter first.",
            hint="another file name, e.g. poses.src.",
        )
    if axes.shape[1] != 6:
        raise ConfigurationError(f"a KRL program for {axes.shape[1]} axes, expected 6.")
    lines = [
        "&ACCESS RVP",
        f"DEF {name}()",
        f"; {len(axes)} poses; output {trigger.output} triggers the instrument at each",
        "; drive it slowly once without the pulses: only stated obstacles were avoided",
        "BAS(#INITMOV,0)",
        f"BAS(#VEL_PTP,{trigger.speed})",
    ]
    for k, pose in enumerate(axes):
        lines.append(f"; pose {k + 1}")
        if len(pre):
            lines.append(f"PTP {_axis_target(pre[k])}")
        lines += [
            f"PTP {_axis_target(pose)}",
            f"WAIT SEC {trigger.settle:.1f}",
            f"PULSE($OUT[{trigger.output}],TRUE,{trigger.pulse:.1f})",
            f"WAIT SEC {trigger.measure:.1f}",
        ]
    return ("\r\n".join([*lines, "END", ""])).encode("ascii")


def _axis_target(axes: Array) -> str:
    degrees = np.round(axes / DEG, 4) + 0.0  # no -0.0000
    return "{" + ",".join(f"A{i + 1} {value:.4f}" for i, value in enumerate(degrees)) + "}"
