"""A robot on a rail and a part on a turntable: the actual tool lands on the part as it stands."""

from __future__ import annotations

import re
from dataclasses import replace

import cases
import numpy as np
import pytest

from robotrue.calibration.model import Query
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.core.poses import inverse, pose
from robotrue.core.rotations import abc_from_matrix, matrix_from_rotation_vector
from robotrue.core.rotations import quat_wxyz_from_matrix as quaternion
from robotrue.core.units import DEG, MM
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch, inverse_branches

COUNT = 40
RAIL = ExternalAxis(number=1, direction=np.array([0.0, 1.0, 0.0]), at=0.2, carries_robot=True)
TURN = ExternalAxis(
    number=2,
    name="STN1",
    direction=np.array([0.0, 0.1, 1.0]),
    point=np.array([1.2, 0.1, 0.3]),
    at=-10.0 * DEG,
    frames=("3", "STN1"),
)
FRAMES = {"3": cases.FRAME, "STN1": cases.FRAME}
TABLE = FrameTable(bases=FRAMES, tools={"1": cases.TOOL, "TOOL_1": cases.TOOL})
RODDED = replace(TABLE, external=(RAIL,))
BOTH = replace(TABLE, external=(RAIL, TURN))
JOINTS = cases.path_joints(COUNT)
E1_MM = np.linspace(-300.0, 900.0, COUNT).round(3)
E2_DEG = np.linspace(20.0, -60.0, COUNT).round(3)


def frames_in_base(turned: bool) -> np.ndarray:
    """The work frame (n, 4, 4) in the base of the robot where its rail has taken it."""
    rail = np.tile(np.eye(4), (COUNT, 1, 1))
    rail[:, 1, 3] = E1_MM * MM - RAIL.at
    frame = np.tile(cases.FRAME, (COUNT, 1, 1))
    if turned:
        turn = matrix_from_rotation_vector((E2_DEG * DEG - TURN.at)[:, None] * TURN.direction)
        frame = pose(turn, TURN.point - turn @ TURN.point) @ frame
    return inverse(rail) @ frame


def krl(T: np.ndarray, turned: bool) -> str:
    head = "DEF part()\nBAS(#TOOL,1)\n" + f"BAS(#{'EX_BASE' if turned else 'BASE'},3)\n"
    lines = [
        "{{X {:.5f},Y {:.5f},Z {:.5f},A {:.6f},B {:.6f},C {:.6f},E1 {},E2 {}}}".format(
            *t[:3, 3] / MM, *abc_from_matrix(t[:3, :3]) / DEG, e1, e2
        )
        for t, e1, e2 in zip(T, E1_MM, E2_DEG, strict=True)
    ]
    return head + "".join(f"{'LIN' if k else 'PTP'} {x}\n" for k, x in enumerate(lines)) + "END\n"


def rapid(T: np.ndarray, turned: bool) -> str:
    held = 'FALSE,"STN1"' if turned else 'TRUE,""'
    user = "[[0,0,0],[1,0,0,0]]"
    if not turned:
        q = ",".join(f"{v:.12f}" for v in quaternion(cases.FRAME[:3, :3]))
        user = "[[{:.9f},{:.9f},{:.9f}],[{}]]".format(*cases.FRAME[:3, 3] / MM, q)
    lines = [
        f"MODULE part\nPERS wobjdata w:=[FALSE,{held},{user},[[0,0,0],[1,0,0,0]]];\nPROC m()\n"
    ]
    for k, (t, e1, e2) in enumerate(zip(T, E1_MM, E2_DEG, strict=True)):
        q = ",".join(f"{v:.9f}" for v in quaternion(t[:3, :3]))
        xyz = ",".join(f"{v:.5f}" for v in t[:3, 3] / MM)
        target = f"[[{xyz}],[{q}],[0,0,0,0],[{e1},{e2},9E9,9E9,9E9,9E9]]"
        lines.append(f"Move{'L' if k else 'J'} {target},v9,z1,TOOL_1\\WObj:=w;\n")
    return "".join([*lines, "ENDPROC\nENDMODULE\n"])


def fanuc(T: np.ndarray, turned: bool) -> str:
    moves = "".join(f"{k:4d}:L P[{k}] 9mm/sec FINE ;\n" for k in range(1, COUNT + 1))
    records = ""
    for k, (t, e1, e2) in enumerate(zip(T, E1_MM, E2_DEG, strict=True), 1):
        xyz = ",".join(f"{n} = {v:.5f} mm" for n, v in zip("XYZ", t[:3, 3] / MM, strict=True))
        wpr = abc_from_matrix(t[:3, :3])[::-1] / DEG
        turns = ",".join(f"{n} = {v:.6f} deg" for n, v in zip("WPR", wpr, strict=True))
        records += f"P[{k}]{{\n GP1:\n UF : 3, UT : 1, CONFIG : 'N U T, 0, 0, 0',\n{xyz},\n{turns}"
        records += f",\nE1= {e1} mm,E2= {e2} deg\n}};\n"
    return f"/PROG A\n/MN\n{moves}/POS\n{records}/END\n"


def jbi(T: np.ndarray, turned: bool) -> str:
    lines = ["/JOB", "//NAME A", "//POS", f"///NPOS {COUNT},{COUNT},0,0,0,0", "///USER 3"]
    lines += ["///TOOL 1", "///POSTYPE USER", "///RECTAN", "///RCONF 0,0,0,0,0,0,0,0"]
    for k, t in enumerate(T):
        numbers = [*t[:3, 3] / MM, *abc_from_matrix(t[:3, :3])[::-1] / DEG]
        lines.append(f"C{k:05d}=" + ",".join(f"{v:.6f}" for v in numbers))
    lines += [f"BC{k:05d}={e1}" for k, e1 in enumerate(E1_MM)]
    lines += ["//INST", "///GROUP1 RB1,BS1", "NOP"]
    lines += [f"MOVL C{k:05d} BC{k:05d} V=20.0" for k in range(COUNT)]
    return "\r\n".join([*lines, "END", ""])


def read(name: str, text: bytes, table: FrameTable) -> Program:
    return find_language(name).read(text, name="part", frames=table)


@pytest.mark.parametrize(
    ("name", "make", "turned"),
    [
        ("krl", krl, False), ("krl", krl, True),
        ("rapid", rapid, False), ("rapid", rapid, True),
        ("fanuc_ls", fanuc, False), ("fanuc_ls", fanuc, True),
        ("jbi", jbi, False),
    ],
)  # fmt: skip
def test_the_actual_tool_lands_in_the_moved_frame(name, make, turned) -> None:
    model = cases.rigid_model()
    wanted = inverse(frames_in_base(turned)) @ forward(model.robot, JOINTS)
    data = make(wanted, turned).encode()
    table = BOTH if turned else replace(BOTH, external=(RAIL, replace(TURN, frames=())))
    program = read(name, data, table)
    assert not program.reason.any(), program.notes
    np.testing.assert_allclose(
        program.T_base_frame[program.frame], frames_in_base(turned), atol=1e-9
    )
    result = compensate(model, program, settings=CompensationSettings(home=JOINTS[0]))
    assert (result.status == Status.COMPENSATED).all(), result.notes
    assert np.linalg.norm(result.shift, axis=1).mean() > 0.5 * MM
    out = find_language(name).write(program, result.replacement)
    external = re.compile(rb"E\d\s*=?\s*-?[\d.]+|BC\d+=.*|\[-?[\d.]+,-?[\d.]+,9E9.*?\]")
    assert external.findall(out) == external.findall(data)
    again = read(name, out, table)
    T_base_tool = frames_in_base(turned) @ pose(again.rotation, again.position)
    flange = model.robot.with_tool(np.eye(4))
    told = inverse_batch(flange, T_base_tool @ inverse(cases.TOOL), near=JOINTS)
    _, position, rotation = model.actual(Query(joints=told))
    landed = inverse(frames_in_base(turned)) @ pose(rotation, position)
    assert np.linalg.norm((landed - wanted)[:, :3, 3], axis=1).max() < 0.5e-3 * MM
    assert np.abs((landed - wanted)[:, :3, :3]).max() < 5e-6


@pytest.mark.parametrize(
    ("name", "make"), [("krl", krl), ("rapid", rapid), ("fanuc_ls", fanuc), ("jbi", jbi)]
)
def test_without_the_description_nothing_is_touched(name, make) -> None:
    wanted = inverse(frames_in_base(False)) @ forward(cases.kr160(), JOINTS)
    data = make(wanted, False).encode()
    program = read(name, data, TABLE)
    away = program.reason == Reason.EXTERNAL_AXIS
    lost = program.reason == Reason.UNKNOWN_FRAME  # BASE on a rail
    assert (away | lost).all()
    assert any("[[controller.external]]" in note or "base" in note for note in program.notes)


def test_a_rail_alone_leaves_the_turntable_undescribed() -> None:
    wanted = inverse(frames_in_base(False)) @ forward(cases.kr160(), JOINTS)
    program = read("krl", krl(wanted, False).encode(), RODDED)
    assert (program.reason == Reason.EXTERNAL_AXIS).all()
    assert any("external axis E2 is -60 to 20" in note for note in program.notes)


def test_a_value_left_out_is_not_taken_for_zero() -> None:
    wanted = inverse(frames_in_base(False)) @ forward(cases.kr160(), JOINTS)
    text = re.sub(r",E1 [-\d.]+,E2 [-\d.]+}", "}", krl(wanted, False), count=1)
    table = replace(BOTH, external=(RAIL, replace(TURN, frames=())))
    program = read("krl", text.encode(), table)
    assert program.reason.tolist() == [Reason.EXTERNAL_AXIS] + [0] * (COUNT - 1)
    assert any("leave out the value of an external axis" in note for note in program.notes)


def test_pulses_of_a_rail_need_their_ratio() -> None:
    wanted = inverse(frames_in_base(False)) @ forward(cases.kr160(), JOINTS)
    text = re.sub(
        r"BC(\d+)=(.*)", lambda m: f"BC{m[1]}={float(m[2]) * 1000:.0f}", jbi(wanted, False)
    )
    assert (read("jbi", text.encode(), RODDED).reason == Reason.EXTERNAL_AXIS).all()
    table = replace(RODDED, external=(replace(RAIL, per_pulse=1e-3),))
    program = read("jbi", text.encode(), table)
    assert not program.reason.any()
    np.testing.assert_allclose(
        program.T_base_frame[program.frame], frames_in_base(False), atol=1e-9
    )


def test_a_program_begins_on_the_branch_another_file_leaves_the_arm_on() -> None:
    model = cases.rigid_model()
    T = forward(model.robot, JOINTS)
    flange = model.robot.with_tool(np.eye(4))
    other = inverse_branches(flange, T[:1] @ inverse(cases.TOOL))[0]
    other = other[np.isfinite(other).all(axis=1)]
    other = other[np.abs(other - JOINTS[0]).max(axis=1) > 0.5]
    controller = model.robot.controller
    assert controller is not None
    for joints in other[:2]:
        start = controller.to_controller(joints[None])[0]
        program = replace(cases.program_of(T[:1]), start=start)
        result = compensate(model, program)
        np.testing.assert_allclose(result.joints[0], joints, atol=0.02)
    assert len(other) >= 2
