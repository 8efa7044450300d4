"""The robot carries the part to a tool in the cell: the actual tool lands on the part."""

from __future__ import annotations

from dataclasses import replace

import cases
import numpy as np
import pytest

from robotrue.calibration.model import Query
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.result import zero_correction
from robotrue.core.poses import inverse, pose, pose_from_xyz_abc
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.rotations import quat_wxyz_from_matrix as quaternion
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_batch
from robotrue.robot.statics import Load

COUNT = 30
PART = cases.TOOL
SPINDLE = pose_from_xyz_abc(np.array([1400.0, 150.0, 900.0]) * MM, np.array([20, 85, -40]) * DEG)
JOINTS = cases.path_joints(COUNT)
TABLE = FrameTable(bases={"2": SPINDLE}, tools={"1": PART}, fixed_tool="tool_in_part")


def rapid(T: np.ndarray) -> bytes:
    def literal(t: np.ndarray) -> str:
        q = ",".join(f"{v:.12f}" for v in quaternion(t[:3, :3]))
        return "[[{:.6f},{:.6f},{:.6f}],[{}]]".format(*t[:3, 3] / MM, q)

    lines = [
        f"MODULE part\nPERS tooldata spin:=[FALSE,{literal(SPINDLE)},"
        "[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        f'PERS wobjdata w:=[TRUE,TRUE,"",{literal(PART)},[[0,0,0],[1,0,0,0]]];\nPROC m()\n'
    ]
    for k, t in enumerate(T):
        target = literal(t)[:-1] + ",[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        lines.append(f"Move{'L' if k else 'J'} {target},v9,z1,spin\\WObj:=w;\n")
    return "".join([*lines, "ENDPROC\nENDMODULE\n"]).encode()


def krl(T: np.ndarray) -> bytes:
    lines = ["DEF part()", "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #TCP}", "BAS(#FRAMES)"]
    for k, t in enumerate(T):
        numbers = [*t[:3, 3] / MM, *abc_from_matrix(t[:3, :3]) / DEG]
        parts = ",".join(f"{n} {v:.6f}" for n, v in zip("XYZABC", numbers, strict=True))
        lines.append(f"{'LIN' if k else 'PTP'} {{{parts}}}")
    return "\r\n".join([*lines, "END", ""]).encode()


def printed(name: str, program: Program) -> np.ndarray:
    """The tool in the part (n, 4, 4), as the file says it."""
    return inverse(pose(program.rotation, program.position))


@pytest.mark.parametrize(("name", "make"), [("rapid", rapid), ("krl", krl)])
@pytest.mark.parametrize("force", [0.0, 400.0])
def test_the_actual_tool_lands_on_the_part(name, make, force: float) -> None:
    model = cases.rigid_model(robot=cases.kr160(PART))
    wanted = inverse(forward(model.robot, JOINTS)) @ SPINDLE
    data = make(wanted)
    program = find_language(name).read(data, name="part", frames=TABLE)
    assert program.held.all()
    assert not program.reason.any(), program.notes
    np.testing.assert_allclose(printed(name, program), wanted, atol=2e-8)
    push = np.array([force, -force, 0.5 * force, 0.0, 0.0, 0.0])
    settings = CompensationSettings(wrench=push if force else np.empty(0), home=JOINTS[0])
    result = compensate(model, program, settings=settings)
    assert (result.status == Status.COMPENSATED).all(), result.notes
    said = f"{COUNT} targets carry the part to a fixed tool in the cell"
    assert any(said in note for note in result.summary()["notes"])
    assert find_language(name).write(program, zero_correction(program)) == data
    out = find_language(name).write(program, result.replacement)
    told = printed(name, find_language(name).read(out, name="part", frames=TABLE))
    assert np.linalg.norm((told - wanted)[:, :3, 3], axis=1).mean() > 0.5 * MM

    # The controller drives its nominal arm; the part is where the actual arm takes it.
    flange = model.robot.with_tool(np.eye(4))
    T_base_part = SPINDLE @ inverse(told)
    driven = inverse_batch(flange, T_base_part @ inverse(PART), near=JOINTS)
    T_wanted = SPINDLE @ inverse(wanted)
    moment = np.cross(SPINDLE[:3, 3] - T_wanted[:, :3, 3], push[:3])
    wrench = np.concatenate([np.tile(push[:3], (COUNT, 1)), moment], axis=1)
    _, position, rotation = model.actual(Query(joints=driven, load=Load(wrench=wrench)))
    landed = inverse(pose(rotation, position)) @ SPINDLE
    assert np.linalg.norm((landed - wanted)[:, :3, 3], axis=1).max() < 0.5e-3 * MM
    assert np.abs((landed - wanted)[:, :3, :3]).max() < 5e-6


def test_krl_waits_for_the_cell_to_say_what_tcp_means() -> None:
    wanted = inverse(forward(cases.kr160(PART), JOINTS)) @ SPINDLE
    silent = find_language("krl").read(
        krl(wanted), name="p.src", frames=replace(TABLE, fixed_tool="")
    )
    assert (silent.reason == Reason.TOOL_ON_FLOOR).all()
    assert any("fixed_tool in [controller]" in note for note in silent.notes)
    other = replace(TABLE, fixed_tool="part_in_tool")
    plain = find_language("krl").read(krl(wanted), name="p.src", frames=other)
    assert not plain.held.any()
    assert not plain.reason.any()
    np.testing.assert_allclose(pose(plain.rotation, plain.position), wanted, atol=2e-8)
    np.testing.assert_array_equal(plain.T_base_frame[plain.frame[0]], SPINDLE)


def test_a_tool_in_the_cell_needs_a_part_on_the_robot() -> None:
    wanted = inverse(forward(cases.kr160(PART), JOINTS)) @ SPINDLE
    for old, new in ((b"[TRUE,TRUE,", b"[FALSE,TRUE,"), (b"[FALSE,[[1400", b"[TRUE,[[1400")):
        data = rapid(wanted).replace(old, new)
        program = find_language("rapid").read(data, name="part", frames=TABLE)
        assert (program.reason == Reason.TOOL_ON_FLOOR).all()
