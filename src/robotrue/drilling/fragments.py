"""The correction move as text for the machine: a few lines, in its own language."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import (
    abc_from_matrix,
    quat_wxyz_from_matrix,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.drilling.head import HeadMove
from robotrue.errors import ConfigurationError


def gcode(move: HeadMove, *, feed_mm_per_min: float) -> str:
    """Returns the move of an XYZAB machine: relative X, Y, Z with A and B, then absolute again.

    Raises:
        ConfigurationError: X, Y and Z are not known: the tip would leave the hole.
    """
    if not np.isfinite(move.shift).all():
        raise ConfigurationError(
            "X, Y and Z of the move are not known: the tip would leave the hole.",
            hint="give [head] pivot_to_tip_mm in the foot file and learn the model again.",
        )
    words = [f"{a}{v / MM:+.4f}" for a, v in zip("XYZ", move.shift, strict=True)]
    words += [f"{a}{v / DEG:+.5f}" for a, v in zip("AB", move.turn, strict=True)]
    return f"G91\nG1 {' '.join(words)} F{feed_mm_per_min:g}\nG90\n"


def _krl(T: Array) -> str:
    x, y, z = T[:3, 3] / MM
    a, b, c = abc_from_matrix(T[:3, :3]) / DEG
    return f"LIN {{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.5f},B {b:.5f},C {c:.5f}}}\n"


def _rapid(T: Array) -> str:
    place = ",".join(f"{v:.4f}" for v in T[:3, 3] / MM)
    turn = ",".join(f"{v:.9f}" for v in quat_wxyz_from_matrix(T[:3, :3]))
    return (
        "ConfL\\Off;\n"
        f"MoveL [[{place}],[{turn}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
        "v20,fine,drill\\WObj:=base;\n"
        "ConfL\\On;\n"
    )


def _urscript(T: Array) -> str:
    values = [*T[:3, 3], *rotation_vector_from_matrix(T[:3, :3])]
    return f"movel(p[{','.join(f'{v:.7f}' for v in values)}],a=0.2,v=0.02)\n"


ROBOT: Final[Mapping[str, Callable[[Array], str]]] = MappingProxyType(
    {"krl": _krl, "rapid": _rapid, "urscript": _urscript}
)
"""From the pose to command (4, 4), tool in base, to one straight move in the robot's base."""


def robot_fragment(language: str, T_base_tool: Array) -> str:
    """Returns one straight move to a pose in the robot's own base, without approximation.

    In RAPID the tool is called ``drill`` and the work object ``base``: one at the robot's base.

    Args:
        language: ``"krl"``, ``"rapid"`` or ``"urscript"``.
        T_base_tool: (4, 4), what the controller is told.

    Raises:
        ConfigurationError: Another language.
    """
    if language not in ROBOT:
        raise ConfigurationError(
            f"no fragments in {language!r}; there are {', '.join(ROBOT)}.", hint="--as krl"
        )
    return ROBOT[language](T_base_tool)
