"""A found frame or tool as controllers take it: text to paste or to type in, Euler order named.

Numbers are printed to 1e-4 mm and 1e-6 deg (0.02 um over a metre). A controller's user frame stands
in its world frame; where that is not the robot's root ($ROBROOT, a shifted ABB base frame, Fanuc's
world at the height of axis 2) the difference has to be added there.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, frozen
from robotrue.core.rotations import (
    abc_from_matrix,
    quat_wxyz_from_matrix,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

ANY: Final = 1_000_000
"""Last number where frames have names and the number says nothing."""
FIRST: Final = 1
"""Entry of a controller's table that is filled where none is stated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerFrame:
    """A frame in a controller's own words.

    Attributes:
        system: Who reads it.
        order: How its three or four rotation numbers make the matrix.
        text: The lines.
    """

    system: str
    order: str
    text: str


def controller_frame(
    T_base_part: Array, form: str, *, name: str = "part", number: int = FIRST
) -> ControllerFrame:
    """Returns the frame as the controller takes it.

    Args:
        T_base_part: (4, 4) m.
        form: ``krl``, ``rapid``, ``fanuc``, ``yaskawa``, ``ur`` or ``g54``.
        name: Of the part; becomes a variable name.
        number: Of the controller's frame table.

    Raises:
        ConfigurationError: An unknown form, or a number the controller does not have.
    """
    if form not in FORMS:
        raise ConfigurationError(
            f"frame format {form!r}, expected {', '.join(FORMS)}.", hint="--frame-format krl"
        )
    low, high, write = FORMS[form]
    if not low <= number <= high:
        raise ConfigurationError(
            f"frame number {number} of {form}, allowed {low} to {high}.",
            hint=f"--frame-number {low}",
        )
    T: Array = frozen(T_base_part, (4, 4), "T_base_part")
    return write(T[:3, 3] / MM, T[:3, :3], _word(name), number)


def _krl(xyz: Array, R: Array, name: str, number: int) -> ControllerFrame:
    x, y, z = (_mm(v) for v in xyz)
    a, b, c = (_deg(v) for v in abc_from_matrix(R) / DEG)
    values = f"{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}"
    return ControllerFrame(
        system="KUKA KRL",
        order="R = Rz(A) Ry(B) Rx(C), deg",
        text=f"; {name} in base, mm; R = Rz(A) Ry(B) Rx(C), deg\n"
        f"$BASE={values}\nBASE_DATA[{number}]={values}\n",
    )


def _rapid(xyz: Array, R: Array, name: str, number: int) -> ControllerFrame:
    x, y, z = (_mm(v) for v in xyz)
    q = ",".join(f"{v:.9f}" for v in quat_wxyz_from_matrix(R) + 0.0)
    return ControllerFrame(
        system="ABB RAPID",
        order="unit quaternion [q1,q2,q3,q4] = [w,x,y,z]",
        text=f"! {name} as user frame, mm; [q1,q2,q3,q4] = [w,x,y,z]\n"
        f'PERS wobjdata w_{name[:29]}:=[FALSE,TRUE,"",[[{x},{y},{z}],[{q}]],'
        "[[0,0,0],[1,0,0,0]]];\n",
    )


def _fanuc(xyz: Array, R: Array, name: str, number: int) -> ControllerFrame:
    x, y, z = (_mm(v) for v in xyz)
    r, p, w = (_deg(v) for v in abc_from_matrix(R) / DEG)
    return ControllerFrame(
        system="Fanuc",
        order="R = Rz(R) Ry(P) Rx(W), deg",
        text=f"UFRAME[{number}] {name}, mm; R = Rz(R) Ry(P) Rx(W), deg\n"
        f"X: {x}  Y: {y}  Z: {z}\nW: {w}  P: {p}  R: {r}\n",
    )


def _yaskawa(xyz: Array, R: Array, name: str, number: int) -> ControllerFrame:
    x, y, z = (_mm(v) for v in xyz)
    rz, ry, rx = (_deg(v) for v in abc_from_matrix(R) / DEG)
    return ControllerFrame(
        system="Yaskawa",
        order="R = Rz(Rz) Ry(Ry) Rx(Rx), deg",
        text=f"User frame {number} {name}, mm; R = Rz(Rz) Ry(Ry) Rx(Rx), deg\n"
        f"X: {x}  Y: {y}  Z: {z}\nRx: {rx}  Ry: {ry}  Rz: {rz}\n",
    )


def _ur(xyz: Array, R: Array, name: str, number: int) -> ControllerFrame:
    position = ", ".join(f"{v * MM:.7f}" for v in xyz + 0.0)
    vector = ", ".join(f"{v:.9f}" for v in rotation_vector_from_matrix(R) + 0.0)
    return ControllerFrame(
        system="Universal Robots",
        order="rotation vector (rx, ry, rz): axis times angle, rad",
        text=f"# {name} in base, m; rotation vector, rad\n{name} = p[{position}, {vector}]\n",
    )


def _g54(xyz: Array, R: Array, name: str, number: int) -> ControllerFrame:
    x, y, z = (_mm(v) for v in xyz)
    c, b, a = (_deg(v) for v in abc_from_matrix(R) / DEG)
    return ControllerFrame(
        system=f"G{53 + number} work offset",
        order="R = Rz(C) Ry(B) Rx(A): about z, then the new y, then the new x, deg",
        text=f"; {name}, mm; R = Rz(C) Ry(B) Rx(A), deg\n"
        f"G{53 + number} X{x} Y{y} Z{z} A{a} B{b} C{c}\n"
        f"$P_UIFR[{number}]=CTRANS(X,{x},Y,{y},Z,{z}):CROT(X,{a},Y,{b},Z,{c})\n",
    )


def controller_tool(
    T_flange_tool: Array, form: str, *, name: str = "tool", number: int = FIRST
) -> ControllerFrame:
    """Returns a tool as the controller takes it.

    Args:
        T_flange_tool: (4, 4) m.
        form: ``krl``, ``rapid``, ``fanuc``, ``yaskawa`` or ``ur``.
        name: Of the tool.
        number: Of the controller's tool table.

    Raises:
        ConfigurationError: An unknown form, or a number the controller does not have.
    """
    if form not in TOOLS:
        raise ConfigurationError(
            f"tool format {form!r}, expected {', '.join(TOOLS)}.", hint="--tool-format krl"
        )
    low, high, write = TOOLS[form]
    if not low <= number <= high:
        raise ConfigurationError(
            f"tool number {number} of {form}, allowed {low} to {high}.",
            hint=f"--tool-number {low}",
        )
    T: Array = frozen(T_flange_tool, (4, 4), "T_flange_tool")
    frame = FORMS[form][2](T[:3, 3] / MM, T[:3, :3], _word(name), 1)
    return ControllerFrame(
        system=frame.system,
        order=frame.order,
        text=write(T[:3, 3] / MM, T[:3, :3], _word(name), number),
    )


def _krl_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    x, y, z = (_mm(v) for v in xyz)
    a, b, c = (_deg(v) for v in abc_from_matrix(R) / DEG)
    values = f"{{X {x},Y {y},Z {z},A {a},B {b},C {c}}}"
    return (
        f"; {name} in the flange, mm; R = Rz(A) Ry(B) Rx(C), deg\n"
        f"$TOOL={values}\nTOOL_DATA[{number}]={values}\n"
    )


def _rapid_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    x, y, z = (_mm(v) for v in xyz)
    q = ",".join(f"{v:.9f}" for v in quat_wxyz_from_matrix(R) + 0.0)
    return (
        f"! {name} in the flange, mm; [q1,q2,q3,q4] = [w,x,y,z]; mass and centre are not known\n"
        f"PERS tooldata t_{name[:29]}:=[TRUE,[[{x},{y},{z}],[{q}]],"
        "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];\n"
    )


def _fanuc_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    x, y, z = (_mm(v) for v in xyz)
    r, p, w = (_deg(v) for v in abc_from_matrix(R) / DEG)
    return (
        f"UTOOL[{number}] {name}, mm; R = Rz(R) Ry(P) Rx(W), deg\n"
        f"X: {x}  Y: {y}  Z: {z}\nW: {w}  P: {p}  R: {r}\n"
    )


def _yaskawa_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    rotation = (abc_from_matrix(R) / DEG)[::-1]
    values = ",".join([*(f"{v + 0.0:.3f}" for v in xyz), *(f"{v + 0.0:.4f}" for v in rotation)])
    return (
        "; in TOOL.CND: X,Y,Z mm, Rx,Ry,Rz deg, R = Rz(Rz) Ry(Ry) Rx(Rx)\n"
        f"//TOOL {number}\n///NAME {name[:16]}\n{values}\n"
    )


def _ur_tool(xyz: Array, R: Array, name: str, number: int) -> str:
    position = ", ".join(f"{v * MM:.7f}" for v in xyz + 0.0)
    vector = ", ".join(f"{v:.9f}" for v in rotation_vector_from_matrix(R) + 0.0)
    return f"# {name} in the flange, m; rotation vector, rad\nset_tcp(p[{position}, {vector}])\n"


TOOLS: Final[dict[str, tuple[int, int, Callable[[Array, Array, str, int], str]]]] = {
    "krl": (1, 128, _krl_tool),
    "rapid": (1, ANY, _rapid_tool),
    "fanuc": (1, 30, _fanuc_tool),
    "yaskawa": (0, 63, _yaskawa_tool),
    "ur": (1, ANY, _ur_tool),
}
"""Name of each form, first and last number of the tool table, and its writer."""


FORMS: Final[dict[str, tuple[int, int, Callable[[Array, Array, str, int], ControllerFrame]]]] = {
    "krl": (1, 128, _krl),
    "rapid": (1, ANY, _rapid),
    "fanuc": (1, 61, _fanuc),
    "yaskawa": (1, 63, _yaskawa),
    "ur": (1, ANY, _ur),
    "g54": (1, 6, _g54),
}
"""Name of each form, first and last number of the frame table, and its writer."""


def _mm(value: float) -> str:
    return f"{np.round(value, 4) + 0.0:.4f}"


def _deg(value: float) -> str:
    return f"{np.round(value, 6) + 0.0:.6f}"


def _word(name: str) -> str:
    """A variable name every one of the languages takes."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", name) or "part"
    return word if word[0].isalpha() else f"p_{word}"
