"""Which configuration the arm takes: by words, by a start posture, or by nothing at all."""

from __future__ import annotations

from dataclasses import replace

import cases
import numpy as np
import pytest

from robotrue.calibration.archive import robot_arrays, robot_document, robot_from
from robotrue.calibration.model import Query
from robotrue.calibration.terms.term import rigid_tables
from robotrue.cell.cell_text import cell_text
from robotrue.cell.config import parse_cell
from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.solve_targets import other_configurations
from robotrue.compensation.stance import start_joints
from robotrue.core.archive import Archive
from robotrue.core.arm_words import NO_WORD
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Reason
from robotrue.robot.configuration import configuration_words
from robotrue.robot.forward import forward
from robotrue.robot.makers import apply_maker
from robotrue.robot.model import Configuration
from robotrue.robot.presets import preset

SIX = {"kuka": "KR160", "abb": "irb120", "yaskawa": "gp225", "fanuc": "r2000"}
BENT = np.array([20.0, 10.0, 15.0, 25.0, 50.0, 30.0]) * DEG


WIDE = np.tile([-179.0, 179.0], (6, 1)) * DEG
"""Room for the arm to reach over its back."""


def table(robot, **more: str) -> str:
    """A cell.toml of the arm as a DH table that names no preset."""
    keys = "".join(f"{key} = {value}\n" for key, value in more.items())
    rows = ", ".join(
        f"{{theta_deg = {t / DEG!r}, alpha_deg = {al / DEG!r}, d_mm = {d / MM!r}, "
        f"a_mm = {a / MM!r}}}"
        for t, al, d, a in zip(
            *(each.tolist() for each in (robot.theta, robot.alpha, robot.d, robot.a)), strict=True
        )
    )
    limits = (robot.limits / DEG).tolist()
    return (
        f'schema = 1\n[robot]\nconvention = "dh"\ndh = [{rows}]\nlimits_deg = {limits}\n{keys}'
        "[tool]\nxyz_mm = [60, 40, 250]\n"
    )


def counted(robot) -> dict[str, str]:
    controller = robot.controller
    return {
        "axes_sign": str([int(each) for each in controller.sign]),
        "axes_offset_deg": str((controller.offset / DEG).tolist()),
    }


def postures(robot) -> np.ndarray:
    """The posture of the pendant's axes, and every other branch of its pose inside the limits."""
    flange = forward(robot.with_tool(np.eye(4)), BENT[None])
    other = other_configurations(robot, flange, BENT[None])[0, :8]
    return np.concatenate([BENT[None], other[np.isfinite(other).all(axis=1)]])


@pytest.mark.parametrize("maker", sorted(SIX))
def test_words_choose_the_branch_of_a_dh_table_with_a_maker(maker: str) -> None:
    known = replace(preset(SIX[maker]), limits=WIDE)
    more = {} if maker == "fanuc" else counted(known)  # Fanuc: q counts as the pendant does
    cell = parse_cell(table(known, maker=f'"{maker}"', **more).encode(), "cell.toml")
    assert cell.robot.maker == maker
    wanted = postures(known)
    assert len(wanted) > 2
    words = configuration_words(known, maker, wanted)  # of the preset: the arm by itself
    model = cases.rigid_model(robot=cell.robot)
    seen = []
    for joints, word in zip(wanted, words, strict=True):
        program = cases.program_of(
            forward(cell.robot, joints[None]), tool=cell.robot.T_flange_tool,
            motion=Motion.PTP, words=word[None], words_of=maker,
        )  # fmt: skip
        result = compensate(model, program)
        assert result.status.tolist() == [Status.COMPENSATED]
        assert np.abs(result.joints[0] - joints).max() < 0.05
        target = forward(cell.robot, joints[None])[:, :3, 3]
        landed = model.actual(Query(joints=result.joints))[1]
        assert np.abs(landed - target).max() < 1e-6
        assert result.summary()["configuration"]["chosen_by"] == "words"
        seen.append(result.replacement.position[0])
    apart = np.linalg.norm(np.array(seen)[1:] - seen[0], axis=1)
    assert apart.max() > 0.2 * MM  # another branch is another correction


@pytest.mark.parametrize("maker", ["kuka", "abb", "yaskawa"])
def test_without_a_maker_words_are_not_read_past(maker: str) -> None:
    robot = replace(preset(SIX[maker]), maker="generic").with_tool(cases.TOOL)
    words = configuration_words(robot, maker, BENT[None])
    program = cases.program_of(
        forward(robot, BENT[None]), motion=Motion.PTP, words=words, words_of=maker
    )
    model = cases.rigid_model(robot=robot)
    left = compensate(model, program)
    assert left.status.tolist() == [Status.UNCHANGED_CONFIGURATION]
    assert f'[robot] maker = "{maker}"' in left.notes[0]
    assert "--start A1,..,A6" in left.notes[1]
    done = compensate(model, program, settings=CompensationSettings(home=BENT))
    assert done.status.tolist() == [Status.COMPENSATED]
    assert np.abs(done.joints[0] - BENT).max() < 0.05


def test_another_branch_under_way_is_not_followed_without_a_maker() -> None:
    robot = replace(cases.kr160(), maker="generic")
    joints = np.radians([[10, -25, 20, 30, 55, 40]] * 4) + np.linspace(0, 0.1, 4)[:, None]
    other = postures(robot)[1]
    joints = np.concatenate([joints, other[None], other[None] + 0.01])
    words = configuration_words(robot, "kuka", joints)
    words[1:4, :] = NO_WORD
    motion = np.where(np.isin(np.arange(6), [0, 4]), int(Motion.PTP), int(Motion.LIN))
    program = replace(cases.program_of(forward(robot, joints), words=words), motion=motion)
    result = compensate(
        cases.rigid_model(robot=robot), program, settings=CompensationSettings(home=joints[0])
    )
    assert result.counts() == {"compensated": 4, "unchanged_configuration": 2}
    assert (result.status[4:] == Status.UNCHANGED_CONFIGURATION).all()


def test_words_behind_axis_values_are_not_read_past_either() -> None:
    robot = replace(cases.kr160(), maker="generic")
    joints = cases.path_joints(3)
    words = configuration_words(robot, "kuka", joints)
    axes = np.full((3, 6), np.nan)
    axes[0] = robot.controller.to_controller(joints[0])
    motion = np.array([Motion.PTP, Motion.PTP, Motion.LIN], dtype=np.int64)
    reason = np.array([int(Reason.JOINT_TARGET), 0, 0])
    program = replace(
        cases.program_of(forward(robot, joints), words=words, reason=reason, axes=axes),
        motion=motion,
    )
    result = compensate(cases.rigid_model(robot=robot), program)
    assert (result.status[1:] == Status.UNCHANGED_CONFIGURATION).all()
    known = replace(robot, maker="kuka")
    result = compensate(cases.rigid_model(robot=known), program)
    assert (result.status[1:] == Status.COMPENSATED).all()


CONFIGS = ("N U T, 0, 0, 0", "F U T, 0, 0, 0", "N D B, 0, 0, 0")


def fanuc_point(config: str) -> bytes:
    return (
        "/PROG A\n/MN\n   1:J P[1] 5% FINE ;\n/POS\nP[1]{\n   GP1:\n"
        f"\tUF : 1, UT : 1,\t\tCONFIG : '{config}',\n"
        "\tX =  900.0000 mm,\tY = 300.0000 mm,\tZ = 700.0000 mm,\n"
        "\tW = 175.0000 deg,\tP = 10.0000 deg,\tR = 20.0000 deg\n};\n/END\n"
    ).encode()


def test_the_same_fanuc_point_with_other_letters_gets_other_bytes() -> None:
    frames = FrameTable(bases={"1": np.eye(4)}, tools={"1": cases.TOOL})
    robot = replace(preset("r2000"), name="bare", maker="generic", controller=None)
    model = cases.rigid_model(robot=apply_maker(replace(robot, limits=WIDE), "fanuc"))
    out = []
    for config in CONFIGS:
        program = find_language("fanuc_ls").read(fanuc_point(config), name="a.ls", frames=frames)
        result = compensate(model, program)
        assert result.status.tolist() == [Status.COMPENSATED], (config, result.notes)
        have = configuration_words(model.robot, "fanuc", result.joints)[0, :3].tolist()
        letters = config.split(",")[0].split()
        assert have == ["NF".index(letters[0]), "DU".index(letters[1]), "BT".index(letters[2])]
        out.append(find_language("fanuc_ls").write(program, result.replacement))
    assert len(set(out)) == 3


def test_a_first_target_that_says_nothing_is_left_alone_until_the_start_is_stated() -> None:
    model, joints = cases.rigid_model(), cases.path_joints(30)
    program = cases.program_of(forward(model.robot, joints))
    left = compensate(model, program)
    assert (left.status == Status.UNCHANGED_CONFIGURATION).all()
    assert not left.replacement.changed.any()
    stated = left.summary()["configuration"]
    assert (stated["line"], stated["chosen_by"]) == (10, "middle of the limits")
    # Any of the branches, if it is the one that is stated.
    flange = forward(model.robot.with_tool(np.eye(4)), joints[:1])
    branches = other_configurations(model.robot, flange, joints[:1])[0, :8]
    branches = [joints[0], *branches[np.isfinite(branches).all(axis=1)]]
    assert len(branches) > 1
    corrections = []
    for start in branches:
        done = compensate(model, program, settings=CompensationSettings(home=start))
        assert done.status[0] == Status.COMPENSATED
        assert np.abs(done.joints[0] - start).max() < 0.05
        corrections.append(done.shift[0])
        assert done.summary()["configuration"]["chosen_by"] == "start posture"
        shown = model.robot.controller.to_controller(start) / DEG
        np.testing.assert_allclose(done.summary()["configuration"]["axes_deg"], shown, atol=1e-3)
    assert np.linalg.norm(np.array(corrections)[1:] - corrections[0], axis=1).max() > 0.3 * MM


def test_where_the_branches_agree_nothing_need_be_stated() -> None:
    joints = cases.path_joints(30)
    model = cases.rigid_model(size=0.005)
    result = compensate(model, cases.program_of(forward(model.robot, joints)))
    assert (result.status == Status.COMPENSATED).all()
    model = cases.rigid_model()
    loose = CompensationSettings(alike=0.02)
    result = compensate(model, cases.program_of(forward(model.robot, joints)), settings=loose)
    assert (result.status == Status.COMPENSATED).all()


def test_axis_values_on_the_way_end_the_guess() -> None:
    model, joints = cases.rigid_model(), cases.path_joints(9)
    program = cases.program_of(forward(model.robot, joints))
    axes = np.full((9, 6), np.nan)
    axes[4] = model.robot.controller.to_controller(joints[4])
    reason = np.where(np.arange(9) == 4, int(Reason.JOINT_TARGET), 0)
    result = compensate(model, replace(program, axes=axes, reason=reason))
    assert (result.status[:4] == Status.UNCHANGED_CONFIGURATION).all()
    assert result.status[4] == Status.UNCHANGED_AXIS_TARGET
    assert (result.status[5:] == Status.COMPENSATED).all()
    assert np.abs(result.joints[5:] - joints[5:]).max() < 0.05


def test_models_that_only_predict_are_asked_alike() -> None:
    flat, joints = cases.rigid_model(), cases.path_joints(6)
    hidden = replace(flat, flat=False)
    program = cases.program_of(forward(flat.robot, joints))
    left = compensate(hidden, program)
    assert (left.status == Status.UNCHANGED_CONFIGURATION).all()
    done = compensate(hidden, program, settings=CompensationSettings(home=joints[0]))
    assert (done.status == Status.COMPENSATED).all()


def test_an_arm_without_closed_branches_is_searched() -> None:
    robot = preset("UR10").with_tool(cases.TOOL)
    start = np.radians([20, -70, 80, -60, -80, 10])
    joints = start + 0.1 * np.sin(np.linspace(0, 2, 5)[:, None] + np.arange(6))
    model = cases.TableModel(tables=rigid_tables(cases.with_errors(robot, 4, size=0.5)))
    program = cases.program_of(forward(robot, joints), words_of="", words=np.empty((5, 0), int))
    assert (compensate(model, program).status == Status.UNCHANGED_CONFIGURATION).all()
    done = compensate(model, program, settings=CompensationSettings(home=joints[0]))
    assert (done.status == Status.COMPENSATED).all()


def test_q_that_does_not_count_as_the_maker_does_is_refused() -> None:
    known = preset("KR160")
    bare = replace(known, maker="generic", controller=None)
    with pytest.raises(ConfigurationError, match=r"joints 1, 2, 3, 4, 5, 6 .* axes_sign"):
        apply_maker(bare, "kuka")
    made = apply_maker(bare, "kuka", sign=known.controller.sign, offset=known.controller.offset)
    assert np.array_equal(
        configuration_words(made, "kuka", BENT), configuration_words(known, "kuka", BENT)
    )
    turned = replace(preset("gp225"), maker="generic", controller=None)
    assert apply_maker(turned, "yaskawa").maker == "yaskawa"
    turned = replace(turned, theta=turned.theta + np.array([0, 0, 0, np.pi, 0, 0]))
    with pytest.raises(ConfigurationError, match=r"joint 5 .*"):
        apply_maker(turned, "yaskawa")  # the mark of axis 4 on the other side turns axis 5 round


def test_the_maker_is_kept_in_cell_and_archive() -> None:
    known = preset("r2000")
    cell = parse_cell(
        (table(known, maker='"fanuc"') + "[controller]\nstart_deg = [1, 2, 3, 4, 5, 6]\n").encode(),
        "cell.toml",
    )
    again = parse_cell(cell_text(cell).encode(), "cell.toml")
    assert again.robot.maker == "fanuc"
    np.testing.assert_allclose(again.controller.start / DEG, [1, 2, 3, 4, 5, 6])
    archive = Archive(
        kind="x", schema=1, document={"robot": robot_document(cell.robot)},
        arrays=robot_arrays(cell.robot),
    )  # fmt: skip
    kept = robot_from(archive)
    assert kept.maker == "fanuc"
    shown = kept.controller.to_controller(np.array([0, 20, 30, 0, 0, 0]) * DEG) / DEG
    np.testing.assert_allclose(shown, [0, 20, 10, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(kept.controller.to_model(shown * DEG) / DEG, [0, 20, 30, 0, 0, 0])
    older = Archive(
        kind="x", schema=1, document=archive.document,
        arrays={k: v for k, v in archive.arrays.items() if "coupling" not in k},
    )  # fmt: skip
    assert not robot_from(older).controller.coupling.size


def test_axis_targets_of_a_fanuc_are_those_of_the_pendant() -> None:
    robot = preset("r2000").with_tool(cases.TOOL)
    joints = np.array([10.0, 20.0, 30.0, 5.0, -60.0, 15.0]) * DEG
    axes = np.array([10.0, 20.0, 10.0, 5.0, -60.0, 15.0]) * DEG
    model = cases.rigid_model(robot=robot)
    words = np.full((1, 6), NO_WORD)
    program = replace(cases.axis_program(axes[None]), words_of="fanuc", words=words)
    done = compensate(model, program, settings=CompensationSettings(axis_targets=True))
    assert done.status.tolist() == [Status.COMPENSATED]
    assert np.abs(done.joints[0] - joints).max() < 0.01
    landed = model.actual(Query(joints=done.joints))[1]
    assert np.abs(landed - forward(robot, joints[None])[:, :3, 3]).max() < 1e-6
    told = done.replacement.axes[0]
    np.testing.assert_allclose(told[2], done.joints[0, 2] - done.joints[0, 1], atol=1e-12)


def test_a_start_posture_is_checked() -> None:
    robot = preset("KR160")
    found = start_joints(robot, np.empty(0), "0,-90,90,0,45,0")
    np.testing.assert_allclose(robot.controller.to_controller(found) / DEG, [0, -90, 90, 0, 45, 0])
    assert not len(start_joints(robot, np.empty(0)))
    with pytest.raises(ConfigurationError, match=r"axis 5 at 150 deg, its limits are -125 to 125"):
        start_joints(robot, np.array([0, -90, 90, 0, 150, 0]) * DEG)
    with pytest.raises(ConfigurationError, match=r"start posture '1,2', expected 6 numbers"):
        start_joints(robot, np.empty(0), "1,2")


def test_numbers_of_another_arm_are_no_start() -> None:
    robot = replace(preset("KR160"), controller=Configuration(sign=np.ones(6), offset=np.zeros(6)))
    with pytest.raises(ConfigurationError, match="has 3 axes"):
        start_joints(robot, np.zeros(3))
