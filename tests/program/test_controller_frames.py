"""Frames in controllers' words: each text read back by the rule it names."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.rotations import (
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
    quat_wxyz_from_matrix,
)
from robotrue.errors import ConfigurationError
from robotrue.program.controller_frames import controller_frame, frame_forms

ANGLE = st.floats(-180.0, 180.0)
LENGTH = st.floats(-3.0, 3.0)
NUMBER = r"(-?\d+\.\d+)"


def about(axis: int, degrees: float) -> np.ndarray:
    """The elementary rotation, written out here."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out


def numbers(text: str, *names: str, between: str = r"[ :]+") -> list[float]:
    return [float(re.search(rf"\b{name}{between}{NUMBER}", text)[1]) for name in names]  # type: ignore[index]


def read(form: str, text: str) -> np.ndarray:
    """The pose of a text, by the rule of its controller."""
    if form == "krl":
        *xyz, a, b, c = numbers(text.split("\n")[1], "X", "Y", "Z", "A", "B", "C")
        return pose(about(2, a) @ about(1, b) @ about(0, c), np.array(xyz) / 1e3)
    if form == "fanuc":
        *xyz, w, p, r = numbers(text, "X", "Y", "Z", "W", "P", "R", between=r":\s+")
        return pose(about(2, r) @ about(1, p) @ about(0, w), np.array(xyz) / 1e3)
    if form == "yaskawa":
        *xyz, rx, ry, rz = numbers(text, "X", "Y", "Z", "Rx", "Ry", "Rz", between=r":\s+")
        return pose(about(2, rz) @ about(1, ry) @ about(0, rx), np.array(xyz) / 1e3)
    if form == "g54":
        *xyz, a, b, c = numbers(text.split("\n")[1], "X", "Y", "Z", "A", "B", "C", between="")
        return pose(about(2, c) @ about(1, b) @ about(0, a), np.array(xyz) / 1e3)
    if form == "val3":
        *xyz, rx, ry, rz = numbers(text, "x", "y", "z", "rx", "ry", "rz", between='="')
        return pose(about(0, rx) @ about(1, ry) @ about(2, rz), np.array(xyz) / 1e3)
    values = [float(v) for v in re.findall(NUMBER, text.split("\n")[1])]
    if form == "rapid":
        return pose(matrix_from_quat_wxyz(np.array(values[3:7])), np.array(values[:3]) / 1e3)
    return pose(matrix_from_rotation_vector(np.array(values[3:6])), np.array(values[:3]))


@pytest.mark.parametrize("form", sorted(frame_forms()))
@settings(max_examples=20, deadline=None)
@given(LENGTH, LENGTH, LENGTH, ANGLE, ANGLE, ANGLE)
def test_read_back_it_is_the_frame(
    form: str, x: float, y: float, z: float, a: float, b: float, c: float
) -> None:
    T = pose_from_xyz_abc(np.array([x, y, z]), np.deg2rad([a, b, c]))
    found = read(form, controller_frame(T, form).text)
    np.testing.assert_allclose(found, T, atol=2e-7)


def test_the_two_krl_lines_and_the_two_g54_lines_agree() -> None:
    T = pose_from_xyz_abc(np.array([0.1, 0.2, 0.3]), np.deg2rad([10.0, 20.0, 30.0]))
    krl = controller_frame(T, "krl", number=4).text.split("\n")
    assert krl[2] == "BASE_DATA[4]=" + krl[1].removeprefix("$BASE=")
    g54 = controller_frame(T, "g54", number=2).text
    assert "G55 X100.0000 Y200.0000 Z300.0000 A30.000000 B20.000000 C10.000000\n" in g54
    assert "$P_UIFR[2]=CTRANS(X,100.0000,Y,200.0000,Z,300.0000):CROT(X,30.000000," in g54


@settings(max_examples=30, deadline=None)
@given(ANGLE, ANGLE, ANGLE)
@example(0.0, 3.0, 180.0)
def test_quaternions_are_of_unit_length_and_read_back(a: float, b: float, c: float) -> None:
    R = about(2, a) @ about(1, b) @ about(0, c)
    q = quat_wxyz_from_matrix(R)
    assert abs(float(np.linalg.norm(q)) - 1.0) < 1e-12
    assert q[0] >= 0.0
    np.testing.assert_allclose(matrix_from_quat_wxyz(q), R, atol=1e-7)


def test_names_become_words_every_language_takes() -> None:
    assert "PERS wobjdata w_Left_side__2:=" in controller_frame(
        np.eye(4), "rapid", name="Left side #2"
    ).text  # fmt: skip
    assert (
        controller_frame(np.eye(4), "ur", name="2nd").text.split("\n")[1].startswith("p_2nd = p[")
    )


def test_what_a_controller_does_not_have() -> None:
    with pytest.raises(ConfigurationError, match="frame format 'scara', expected krl, rapid"):
        controller_frame(np.eye(4), "scara")
    with pytest.raises(ConfigurationError, match="frame number 0 of krl, allowed 1 to 128"):
        controller_frame(np.eye(4), "krl", number=0)
