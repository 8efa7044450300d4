"""RAPID modules and UR scripts, from their bytes to compensated bytes."""

from __future__ import annotations

import cases
import numpy as np
import pytest

from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import inverse
from robotrue.core.rotations import quat_wxyz_from_matrix, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable
from robotrue.robot.configuration import configuration_words
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset

REST = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def numbers(values: np.ndarray, digits: int) -> str:
    return ",".join(f"{value:.{digits}f}" for value in np.atleast_1d(values))


def frame(T: np.ndarray) -> str:
    quaternion = quat_wxyz_from_matrix(T[:3, :3])
    return f"[[{numbers(T[:3, 3] / MM, 6)}],[{numbers(quaternion, 12)}]]"


def rapid(robot, joints: np.ndarray) -> bytes:
    words = configuration_words(robot, "abb", joints)
    lines = [
        "MODULE part",
        f"PERS tooldata t1:=[TRUE,{frame(cases.TOOL)},[1,[0,0,1],[1,0,0,0],0,0,0]];",
    ]
    lines.append(f'PERS wobjdata w1:=[FALSE,TRUE,"",{frame(cases.FRAME)},[[0,0,0],[1,0,0,0]]];')
    lines += ["PROC main()", f"MoveAbsJ [[10,20,30,40,50,60],{REST}],v1,z1,t1;"]
    for i, T in enumerate(inverse(cases.FRAME) @ forward(robot, joints)):
        place = frame(T)[:-1] + f",[{','.join(map(str, words[i]))}],{REST}]"
        lines.append(f"{'MoveL' if i else 'MoveJ'} {place},v100,z1,t1\\WObj:=w1;")
    return "\n".join([*lines, "ENDPROC", "ENDMODULE", ""]).encode()


def urscript(robot, joints: np.ndarray, *, plane: np.ndarray | None = cases.FRAME) -> bytes:
    def p(T: np.ndarray) -> str:
        return f"p[{numbers(T[:3, 3], 9)},{numbers(rotation_vector_from_matrix(T[:3, :3]), 9)}]"

    lines = ["def part():", f"  set_tcp({p(cases.TOOL)})"]
    lines += [] if plane is None else [f"  plane = {p(plane)}"]
    lines.append("  movej([0.1,-1.0,1.0,0.5,0.5,0.5],1,1)")
    place, places = "{}", forward(robot, joints)
    if plane is not None:
        place, places = "pose_trans(plane,{})", inverse(plane) @ places
    for i, T in enumerate(places):
        lines.append(f"  {'movel' if i else 'movej'}({place.format(p(T))},1.2,0.25)")
    return "\n".join([*lines, "end", ""]).encode()


@pytest.mark.parametrize(
    ("name", "make", "arm"), [("rapid", rapid, "IRB120"), ("urscript", urscript, "UR10")]
)
def test_from_bytes_to_compensated_bytes(name, make, arm):
    robot, language = preset(arm).with_tool(cases.TOOL), find_language(name)
    middle = {"IRB120": [5, 10, -15, 20, 50, 85], "UR10": [15, -80, 90, -100, -80, 20]}[arm]
    joints = np.array(middle) * DEG + np.linspace(0, 0.2, 30)[:, None]
    data = make(robot, joints)
    program = language.read(data, name="part", frames=FrameTable())
    assert not program.notes
    model = cases.rigid_model(robot=robot, size=0.3)
    result = compensate(model, program)
    assert result.status[0] == Status.UNCHANGED_AXIS_TARGET
    assert (result.status[1:] == Status.COMPENSATED).all()
    if name == "rapid":  # confdata choose the branch; a UR pose says nothing of it
        assert np.abs(result.joints[1:] - joints).max() < 0.05
    out = language.write(program, result.replacement)
    again = language.read(out, name="part", frames=FrameTable())
    assert np.abs(again.position - result.replacement.position)[1:].max() < 0.51e-6 * MM * 1e3
    assert np.abs(again.rotation - result.replacement.rotation)[1:].max() < 1e-8
    assert np.linalg.norm(again.position - program.position, axis=1)[1:].min() > 0.01 * MM
    new = result.replacement.words
    assert np.array_equal(again.words, np.where(new == NO_WORD, program.words, new))
    if name == "rapid":
        follows = configuration_words(robot, "abb", result.joints[1:])
        assert np.array_equal(again.words[1:], follows)
    settings = CompensationSettings(axis_targets=True)
    asked = compensate(model, program, settings=settings)
    assert asked.status[0] == Status.COMPENSATED
    axes = language.read(
        language.write(program, asked.replacement), name="part", frames=FrameTable()
    ).axes
    np.testing.assert_allclose(axes[0], asked.replacement.axes[0], atol=0.51e-4 * DEG)
    assert np.abs(axes[0] - program.axes[0]).max() > 1e-3 * DEG
