"""Several sides as one job: lifts, moves between them, and the program that comes of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from robotrue.cell.cell import Cell
from robotrue.cell.obstacles import Box, HalfSpace
from robotrue.core.poses import apply, inverse, pose
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError, FormatError, ReachError
from robotrue.planning.arm_scene import to_obstacle
from robotrue.planning.machining import MachiningSettings, Side, job_moves, plan_machining
from robotrue.planning.transit import scene_without_reflector, transit
from robotrue.program.lang import find_language
from robotrue.program.posts import read_posts
from robotrue.program.posts.machining_moves import JobSpeeds
from robotrue.program.posts.post_writer import write_machining
from robotrue.program.program import FrameTable, Motion
from robotrue.program.toolpath import Remark, Toolpath
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset

TOOL = pose(matrix_from_abc(np.array([1.0, 60.0, -2.0]) * DEG), np.array([0.2, 0.01, 0.2]))
CELL = Cell(robot=preset("KUKA KR160 R1570").with_tool(TOOL))
PART = pose(matrix_from_abc(np.array([1.5, 0.3, -0.4]) * DEG), np.array([0.9123, -0.1, 0.5]))
AXES = {"front": [0, -1.0, 0], "back": [0, 1.0, 0], "top": [0, 0, 1.0]}
SIZE = np.array([0.4, 0.2, 0.3])


def path(side: str, n: int = 12, **changes) -> Toolpath:
    """A zigzag over one face of a block, 1 mm deep."""
    axis = np.array(AXES[side])
    along, up = (np.array([1.0, 0, 0]), np.array([0, 1.0, 0] if side == "top" else [0, 0, 1.0]))
    k = np.arange(n)
    p = 0.5 * SIZE + (0.5 * SIZE - MM) * axis
    p = p + np.outer(0.3 * (k / (n - 1) - 0.5), along) + np.outer(0.1 * (k % 2 - 0.5), up)
    values = {
        "name": side,
        "source": f"{side}.apt",
        "position": p,
        "axis": np.tile(axis, (n, 1)),
        "feed": np.full(n, 0.02),
        "rapid": np.zeros(n, dtype=bool),
        "line": np.arange(n) + 5,
        "operation": np.zeros(n, dtype=int),
        "operations": ("finish",),
    }
    return Toolpath(**(values | changes))


def sides(*names: str) -> list[Side]:
    return [Side(path=path(name), T_base_part=PART) for name in names]


def krl(job, speeds: JobSpeeds | None = None, name: str = "job") -> bytes:
    moves = job_moves(job, CELL.robot, name, speeds or JobSpeeds())
    return write_machining(read_posts()["krl"], moves).files[f"{name}.src"]


@pytest.fixture(scope="module")
def job():
    return plan_machining(CELL, sides("front", "back", "top"), MachiningSettings())


def test_the_program_reads_back_as_the_same_points(job):
    """Tool path -> KRL -> our reader: points within 1 um in base, frames and axes too."""
    program = find_language("krl").read(krl(job), name="job.src", frames=FrameTable())
    assert program.notes == ()
    assert (program.reason[program.motion == Motion.LIN] == 0).all()
    lin = np.flatnonzero(program.motion == Motion.LIN)
    T = program.T_base_frame[program.frame[lin]]
    want = np.concatenate([apply(PART, side.path.position) for side in job.sides])
    assert np.linalg.norm(apply(T, program.position[lin]) - want, axis=1).max() < 1 * UM
    axis = -(T[:, :3, :3] @ program.rotation[lin])[:, :, 2]
    along = np.concatenate([side.path.axis @ PART[:3, :3].T for side in job.sides])
    assert np.abs(axis - along).max() < 1e-6
    tool = program.T_flange_tool[program.tool[lin]]
    np.testing.assert_allclose(tool, np.broadcast_to(TOOL, tool.shape), atol=1e-9)
    np.testing.assert_allclose(T, np.broadcast_to(PART, T.shape), atol=1e-9)


def test_joint_moves_lead_to_the_first_point_of_each_side(job):
    program = find_language("krl").read(krl(job), name="job.src", frames=FrameTable())
    ptp = np.flatnonzero(program.motion == Motion.PTP)
    assert len(ptp) == sum(len(m) for m in job.moves)
    np.testing.assert_allclose(program.axes[ptp[0]], program.axes[ptp[-1]], atol=1e-6)  # home
    for row in np.flatnonzero(np.diff(program.motion) == Motion.LIN - Motion.PTP):
        joints = CELL.robot.controller.to_model(program.axes[row])
        at = forward(CELL.robot, joints[None])[0, :3, 3]
        first = apply(PART, program.position[row + 1])
        assert np.linalg.norm(at - first) < 5 * UM  # axes have four decimals of a degree


def test_each_side_begins_and_ends_clear_of_part_and_paths(job):
    low, high = SIZE * 0.0, SIZE
    for side in job.sides:
        for end in (0, -1):
            outside = np.maximum(low - side.path.position[end], side.path.position[end] - high)
            assert outside.max() > 0.09
            assert side.path.rapid[end]
        assert side.path.cutting[1:-1].all()


def test_arm_and_tool_keep_clear_of_the_part_between_sides(job):
    """Checked by the distance of every tube, at postures 0.2 deg apart."""
    scene = scene_without_reflector(CELL)
    cut = np.concatenate([side.path.position[side.path.cutting] for side in job.sides])
    box = Box(name="part", low=cut.min(axis=0) + MM, high=cut.max(axis=0) - MM)
    ends = [s.joints[-1] for s in job.sides]
    starts = [job.moves[0][0], *ends]
    for start, move in zip(starts, job.moves, strict=True):
        knots = np.concatenate([start[None], move])
        for a, b in pairwise(knots):
            n = int(np.abs(b - a).max() / (0.2 * DEG)) + 2
            tubes = scene.tubes(a + np.linspace(0, 1, n)[:, None] * (b - a))[0][:, 1:]
            gap = to_obstacle(apply(inverse(PART), tubes), box) - scene.radius[1:]
            assert gap.min() > 0.0


def test_an_obstacle_changes_the_way(job):
    wall = Box(name="wall", low=np.array([1.3, -0.05, 0.9]), high=np.array([2.5, 0.05, 2.5]))
    scene = scene_without_reflector(replace(CELL, obstacles=(wall,)))
    free = scene_without_reflector(CELL)
    part = Box(name="part", low=np.zeros(3), high=SIZE)
    left, right = (CELL.robot.controller.to_model(np.array([a, -80, 60, 0, 40, 0.0]) * DEG)
                   for a in (35.0, -35.0))  # fmt: skip
    home = CELL.robot.controller.to_model(np.array([0, -130, 120, 0, 30, 0.0]) * DEG)
    assert len(transit(free, part, PART, left, right, home, what="over")) == 0
    around = transit(scene, part, PART, left, right, home, what="over")
    assert len(around) > 0
    floor = HalfSpace(name="ceiling", point=np.array([0, 0, 1.2]), normal=np.array([0, 0, -1.0]))
    low = scene_without_reflector(replace(CELL, obstacles=(floor,)))
    with pytest.raises(ReachError, match="no way over is clear: collision with ceiling"):
        transit(low, part, PART, left, right, home, what="over")


def test_remarks_feeds_and_exact_stops_stand_where_they_belong():
    feed = np.full(12, 0.02)
    feed[4:] = 0.01
    rapid = np.zeros(12, dtype=bool)
    rapid[8] = True
    remarks = (
        Remark(before=4, line=77, text="COOLNT/ON"),
        Remark(before=12, line=99, text="FINI ü"),
    )
    one = Side(path=path("top", feed=feed, rapid=rapid, remarks=remarks), T_base_part=PART)
    lines = krl(plan_machining(CELL, [one], MachiningSettings())).decode("ascii").split("\r\n")
    body = lines[lines.index("; operation finish") + 1 :]
    assert body[0] == "$VEL.CP=0.200000"
    assert body[1].startswith("LIN {")
    assert body[1].endswith("}")  # the lift, exact
    assert body[2] == "$VEL.CP=0.020000"
    assert all(line.endswith(" C_DIS") for line in body[3:7])
    assert body[7:9] == ["; 77: COOLNT/ON", "$VEL.CP=0.010000"]
    text = "\n".join(body)
    before, _, after = text.partition(
        "$VEL.CP=0.200000\nLIN",
    )[2].partition("$VEL.CP=0.200000\nLIN")
    assert not before.strip().splitlines()[-1].endswith("C_DIS")  # stops before it lifts
    assert "; 99: FINI ?" in after


def test_a_stop_halts_and_a_delay_waits():
    remarks = (
        Remark(before=4, line=20, text="STOP"),
        Remark(before=7, line=30, text="DELAY/ 2.5"),
        Remark(before=9, line=40, text="OPSTOP"),
    )
    one = Side(path=path("top", remarks=remarks), T_base_part=PART)
    lines = krl(plan_machining(CELL, [one], MachiningSettings())).decode().split("\r\n")
    for comment, action in (("; 20: STOP", "HALT"), ("; 30: DELAY/ 2.5", "WAIT SEC 2.500")):
        at = lines.index(comment)
        assert lines[at + 1] == action
        assert lines[at - 1].endswith("}")  # comes to rest before it
        assert lines[at + 2].endswith("C_DIS")
    at = lines.index("; 40: OPSTOP")
    assert lines[at - 1].endswith("C_DIS")
    assert lines[at + 1].startswith("LIN")


def test_a_point_that_cuts_without_a_feed_is_refused_with_its_line():
    feed = np.full(12, 0.02)
    feed[:3] = np.nan
    one = Side(path=path("top", feed=feed), T_base_part=PART)
    found = plan_machining(CELL, [one], MachiningSettings())
    with pytest.raises(FormatError, match=r"^top\.apt:5: this point cuts and no feed"):
        krl(found)
    assert b"$VEL.CP=0.005" in krl(found, JobSpeeds(feed=0.005))


def test_two_tools_and_two_clampings_are_refused():
    one = Side(path=path("front", tools=(("T1", 3),)), T_base_part=PART)
    two = Side(path=path("back", tools=(("T1", 3), ("T2", 9))), T_base_part=PART)
    with pytest.raises(
        ConfigurationError, match=r"^back\.apt:9: tool 'T2' is loaded after 'T1'|T2"
    ):
        plan_machining(CELL, [one, two], MachiningSettings())
    moved = PART @ pose(np.eye(3), np.array([0.05, 0, 0]))
    again = Side(path=path("back"), T_base_part=moved)
    with pytest.raises(ConfigurationError, match="a corner of the part 50 mm apart"):
        plan_machining(CELL, [one, again], MachiningSettings())


def test_a_lift_out_of_reach_is_not_blamed_on_the_point_under_it():
    settings = MachiningSettings(lift=1.2)
    with pytest.raises(ReachError, match=r"^top\.apt:(5|16): the lift of 1200 mm over this point"):
        plan_machining(CELL, sides("top"), settings)


def test_a_home_in_the_part_is_refused_and_a_clear_one_chosen():
    inside = np.array([0.0, -75.0, 105.0, 0.0, 0.0, 0.0]) * DEG
    with pytest.raises(ConfigurationError, match=r"home \(A1..A6 0, -75, 105, 0, 0, 0 deg\): coll"):
        plan_machining(CELL, sides("top"), MachiningSettings(home=inside))
    beyond = np.array([200.0, -90.0, 90.0, 0.0, 0.0, 0.0]) * DEG
    with pytest.raises(ConfigurationError, match="A1 is beyond its limits"):
        plan_machining(CELL, sides("top"), MachiningSettings(home=beyond))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: JobSpeeds(rapid=9.0), "rapid 9000 mm/s"),
        (lambda: JobSpeeds(blend=-1.0), "blend -1000 mm"),
        (lambda: JobSpeeds(joint=0), "joint speed 0 %"),
        (lambda: MachiningSettings(lift=-0.1), "the lift is -100 mm"),
    ],
)
def test_settings_out_of_range_are_refused(make, says):
    with pytest.raises(ConfigurationError, match=says):
        make()


def test_a_name_krl_does_not_allow(job):
    with pytest.raises(ConfigurationError, match="program name '1job'"):
        krl(job, name="1job")
