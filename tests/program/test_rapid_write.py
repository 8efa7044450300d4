"""New numbers in RAPID modules: style, sign, confdata, and every other byte."""

from __future__ import annotations

import re

import numpy as np
import pytest
from rapid_samples import REST, changed_lines, module, move, read, replacement, target, write

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc, quat_wxyz_from_matrix
from robotrue.core.units import DEG
from robotrue.errors import ShapeError

TURN = matrix_from_abc(np.array([0.01, -0.02, 0.03]) * DEG)


def test_no_correction_is_the_same_bytes() -> None:
    odd = f"[[-0.000,+5.,.5],[-1,-0,0,2.20429143688028E-14],[0,0,-1,0],{REST}]"
    program = module(move(target(7)) + move(odd) + f"MoveAbsJ [[1,2,3,4,5,6],{REST}],v1,z1,tool0;")
    change = replacement(program, changed=np.ones(3, dtype=bool))
    assert write(program, change).encode() == program.data


def test_a_shift_changes_only_its_numbers() -> None:
    program = module(move(target(1, 2, 3)) + move(target(4, 5, 6)))
    change = replacement(program, by_mm=(0.5, 0, -0.0004))
    assert changed_lines(program, change) == [
        move(target(1.5, 2, 3)).strip(), move(target(4.5, 5, 6)).strip()
    ]  # fmt: skip


def test_styles() -> None:
    odd = f"[[-0.000,+5.,.5],[1,0,0,0],[0,0,-1,0],{REST}]"
    program = module(move(odd))
    (line,) = changed_lines(program, replacement(program, by_mm=(0.0123, 0.02, 0.25)))
    assert "[[0.012,+5.0200,.7500],[1,0,0,0]," in line
    (line,) = changed_lines(program, replacement(program, rotation=TURN))
    q = quat_wxyz_from_matrix(TURN)
    assert f"[[-0.000,+5.,.5],[{q[0]:.8f},{q[1]:.8f},{q[2]:.8f},{q[3]:.8f}]," in line


def test_the_sign_of_the_quaternion_stays_and_its_length_is_one() -> None:
    program = module(move(f"[[1,2,3],[-0.5003,-0.5003,0.5003,0.5003],[0,0,0,0],{REST}]"))
    (line,) = changed_lines(program, replacement(program, rotation=TURN))
    q = np.array(re.findall(r"-?0\.\d{8}", line), dtype=float)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=2e-8)
    np.testing.assert_allclose(q, [-0.5, -0.5, 0.5, 0.5], atol=1e-3)
    again = read(write(program, replacement(program, rotation=TURN)))
    np.testing.assert_allclose(again.rotation[0], program.rotation[0] @ TURN, atol=4e-8)


def test_confdata_are_renewed_where_told() -> None:
    program = module(move(target()) + move(target(2)))
    words = np.array([[NO_WORD, -1, NO_WORD, 4], [0, 0, -1, 0]])
    (line,) = changed_lines(program, replacement(program, words=words))
    assert line == move(target().replace("[0,0,-1,0]", "[0,-1,-1,4]")).strip()


def test_axis_targets_on_request() -> None:
    text = f"MoveAbsJ [[10,-70.000,1.5E1,5,60,-20],{REST}],v1,z1,spindle;"
    program = module(text)
    axes = program.axes + np.array([0.01, 0.0001, 0.02, 0, 0, 0]) * DEG
    change = replacement(program, axes=axes, changed=np.array([True]))
    (line,) = changed_lines(program, change)
    assert line == text.replace("[[10,-70.000,1.5E1", "[[10.0100,-70.000,1.5020000E1")


def test_tools_and_work_objects_are_never_touched() -> None:
    program = module(f"fixture.uframe:=[[1,2,3],[1,0,0,0]];\n{move(target())}")
    assert len(changed_lines(program, replacement(program, by_mm=(1, 1, 1), rotation=TURN))) == 1


def test_values_that_cannot_be_written() -> None:
    program = module(move(target()))
    with pytest.raises(ShapeError, match=r"part\.mod:6: the new target is .*nan"):
        write(program, replacement(program, by_mm=(float("nan"), 0, 0)))
    with pytest.raises(ShapeError, match="changed has shape"):
        write(program, replacement(program).take(np.array([0, 0])))
