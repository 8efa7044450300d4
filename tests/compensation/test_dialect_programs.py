"""Programs of other makers, from their bytes to compensated bytes."""

from __future__ import annotations

from dataclasses import replace

import cases
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import inverse
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Reason
from robotrue.robot.configuration import configuration_words
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset

TABLE = FrameTable(bases={"1": cases.FRAME}, tools={"1": cases.TOOL})


def printed(T_base_tool: np.ndarray) -> np.ndarray:
    """X Y Z in mm and the turns about X, Y, Z in deg (n, 6) in the work frame."""
    T = inverse(cases.FRAME) @ T_base_tool
    abc = abc_from_matrix(T[:, :3, :3])
    return np.concatenate([T[:, :3, 3] / MM, abc[:, ::-1] / DEG], axis=1)


def jbi(robot, joints: np.ndarray) -> bytes:
    words = configuration_words(robot, "yaskawa", joints)
    lines = ["/JOB", "//NAME A", "//POS", f"///NPOS {len(joints)},0,0,0,0,0", "///USER 1"]
    lines += ["///TOOL 1", "///POSTYPE USER", "///RECTAN"]
    for i, row in enumerate(printed(forward(robot, joints))):
        lines.append("///RCONF " + ",".join(map(str, [*words[i], 0, 0])))
        lines.append(f"C{i:05d}=" + ",".join(f"{v:.4f}" for v in row))
    lines += ["//INST", "NOP", "MOVJ C00000 VJ=5.0"]
    lines += [f"MOVL C{i:05d} V=20.0" for i in range(1, len(joints))]
    return "\r\n".join([*lines, "END", ""]).encode()


def fanuc(robot, joints: np.ndarray) -> bytes:
    words = configuration_words(robot, "fanuc", joints)
    lines = ["/PROG A", "/MN"]
    lines += [f"{i:4d}:{'LJ'[i == 1]} P[{i}] 5% FINE ;" for i in range(1, len(joints) + 1)]
    lines.append("/POS")
    for i, row in enumerate(printed(forward(robot, joints))):
        f, u, t, *turns = words[i].tolist()
        config = f"{'NF'[f]} {'DU'[u]} {'BT'[t]}, " + ", ".join(map(str, turns))
        parts = [f"{n} = {v:10.4f}" for n, v in zip("XYZWPR", row, strict=True)]
        lines += [f"P[{i + 1}]{{", "   GP1:", f"\tUF : 1, UT : 1,\t\tCONFIG : '{config}',"]
        lines += ["\t" + " mm,\t".join(parts[:3]) + " mm,\t" + " deg,\t".join(parts[3:]) + " deg"]
        lines += ["};"]
    return "\n".join([*lines, "/END", ""]).encode()


@pytest.mark.parametrize(("name", "make"), [("jbi", jbi), ("fanuc_ls", fanuc)])
def test_from_bytes_to_compensated_bytes(name, make):
    maker = {"jbi": "yaskawa", "fanuc_ls": "fanuc"}[name]
    arm = preset("GP225") if name == "jbi" else replace(preset("KR160"), maker=maker)
    robot, language = arm.with_tool(cases.TOOL), find_language(name)
    joints = np.array([5, 10, -15, 20, 50, 30]) * DEG + np.linspace(0, 0.3, 12)[:, None]
    data = make(robot, joints)
    program = language.read(data, name="part", frames=TABLE)
    assert not program.notes
    result = compensate(cases.rigid_model(robot=robot), program)
    assert (result.status == Status.COMPENSATED).all()
    assert np.abs(result.joints - joints).max() < 0.05  # the branch the words ask for
    out = language.write(program, result.replacement)
    again = language.read(out, name="part", frames=TABLE)
    # Four decimals of a millimetre and a degree.
    assert np.abs(again.position - result.replacement.position).max() < 0.51e-4 * MM
    assert np.abs(again.rotation - result.replacement.rotation).max() < 2e-4 * DEG
    shift = np.linalg.norm(again.position - program.position, axis=1)
    assert shift.min() > 0.05 * MM
    new = result.replacement.words
    assert np.array_equal(again.words, np.where(new == NO_WORD, program.words, new))


def val3(robot, joints: np.ndarray) -> bytes:
    lines = ["<Programs xmlns='http://www.staubli.com/robotics/VAL3/Program/2'>"]
    for kind, name, father, T in (
        ("frame", "fPart", "world", cases.FRAME), ("tool", "tMill", "flange", cases.TOOL),
    ):  # fmt: skip
        text = val3_pose(T[None])[0]
        lines += [f"<Data type='{kind}' name='{name}'>", f"<Value {text} fatherId='{father}[0]'/>"]
        lines += ["</Data>"]
    lines += ["<Data type='pointRx' name='p'>"]
    places = val3_pose(inverse(cases.FRAME) @ forward(robot, joints))
    for key, text in enumerate(places):
        lines.append(f"<Value key='{key}' {text} fatherId='fPart[0]'/>")
    lines += ["</Data>", "<Program name='a'><Code>"]
    lines += [f"movel(p[{key}],tMill,mNom)" for key in range(len(joints))]
    return "\n".join([*lines, "</Code></Program></Programs>", ""]).encode()


def val3_pose(T: np.ndarray) -> list[str]:
    turns = Rotation.from_matrix(T[:, :3, :3]).as_euler("XYZ", degrees=True)
    rows = np.concatenate([T[:, :3, 3] / MM, turns], axis=1)
    names = ("x", "y", "z", "rx", "ry", "rz")
    return [" ".join(f"{n}='{v:.6f}'" for n, v in zip(names, r, strict=True)) for r in rows]


def test_val3_points_are_compensated_in_their_frame_and_tool():
    robot, language = preset("KR160").with_tool(cases.TOOL), find_language("val3")
    joints = np.array([5, 10, -15, 20, 50, 30]) * DEG + np.linspace(0, 0.3, 12)[:, None]
    data = val3(robot, joints)
    program = language.read(data, name="part.pgx", frames=FrameTable())
    settings = CompensationSettings(home=joints[0])
    result = compensate(cases.rigid_model(robot=robot), program, settings=settings)
    assert (result.status == Status.COMPENSATED).all()
    assert np.abs(result.joints - joints).max() < 0.05
    again = language.read(
        language.write(program, result.replacement), name="part.pgx", frames=FrameTable()
    )
    assert np.abs(again.position - result.replacement.position).max() < 0.51e-6 * MM
    assert np.abs(again.rotation - result.replacement.rotation).max() < 2e-6 * DEG
    assert np.linalg.norm(again.position - program.position, axis=1).min() > 0.05 * MM


def fanuc_axes(values: np.ndarray) -> bytes:
    joined = ",\t".join(f"J{i}= {v:.6f} deg" for i, v in enumerate(values, 1))
    return (
        "/PROG A\n/MN\n   1:J P[1] 5% FINE ;\n/POS\nP[1]{\n   GP1:\n\tUF : 1, UT : 1,\n\t"
        f"{joined}\n}};\n/END\n"
    ).encode()


def test_fanuc_joint_3_is_that_of_an_arm_that_counts_it_from_the_horizontal():
    serial = replace(preset("KR160"), maker="fanuc").with_tool(cases.TOOL)
    coupling = np.eye(6)
    coupling[2, 1] = -1.0
    coupled = replace(serial, joint_map=coupling)
    values = np.array([10.0, -20.0, 30.0, 20.0, 40.0, 10.0])
    program = find_language("fanuc_ls").read(fanuc_axes(values), name="part.ls", frames=TABLE)
    assert program.reason.tolist() == [Reason.JOINT_TARGET]
    settings = CompensationSettings(axis_targets=True)
    refused = compensate(cases.rigid_model(robot=serial), program, settings=settings)
    assert refused.status.tolist() == [Status.UNCHANGED_SOURCE]
    assert any("Fanuc counts J3 from the horizontal" in note for note in refused.notes)
    done = compensate(cases.rigid_model(robot=coupled), program, settings=settings)
    assert done.status.tolist() == [Status.COMPENSATED]
    assert coupled.controller is not None
    expected = coupled.controller.to_controller(done.joints)
    np.testing.assert_allclose(done.replacement.axes, expected)
    out = find_language("fanuc_ls").write(program, done.replacement)
    again = find_language("fanuc_ls").read(out, name="part.ls", frames=TABLE)
    np.testing.assert_allclose(again.axes, done.replacement.axes, atol=0.51e-6 * DEG)
    assert np.abs(again.axes - program.axes).max() > 1e-3 * DEG
