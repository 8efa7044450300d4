"""Deviation of lines and arcs between compensated targets."""

from __future__ import annotations

import cases
import numpy as np
import pytest

from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.arcs import (
    circles,
    from_circles,
    from_helices,
    from_segments,
    on_circles,
)
from robotrue.compensation.split_deviation import job_deviation, measure_moves
from robotrue.compensation.split_shapes import JobMoves, along, job_moves, loads
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.program.insertion import Moves
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.robot.statics import Load

HOME = np.array([5, -30, 30, 10, 60, 20]) * DEG
MIDDLE = forward(cases.kr160(), HOME[None])[0]


def job_of(T: np.ndarray, arc: bool = False, wrench: np.ndarray | None = None, **more) -> JobMoves:
    """A job of lines from target to target, or of one arc, compensated by a rigid model."""
    model = more.pop("model", None) or cases.rigid_model()
    program = cases.program_of(T)
    settings = CompensationSettings(
        home=HOME, wrench=np.empty(0) if wrench is None else wrench, **more
    )
    result = compensate(model, program, settings=settings)
    assert (result.status == Status.COMPENSATED).all()
    n = len(T)
    moves = Moves(
        start=np.array([0]) if arc else np.arange(n - 1),
        via=np.array([1]) if arc else np.full(n - 1, -1),
        end=np.array([2]) if arc else np.arange(1, n),
        line=np.arange(1) if arc else np.arange(n - 1),
        obstacle=np.zeros(1 if arc else n - 1, dtype=int),
    )
    return job_moves(model, [program], moves, [result], [settings])


def at(offsets: np.ndarray, turns: np.ndarray | None = None) -> np.ndarray:
    T = np.tile(MIDDLE, (len(offsets), 1, 1))
    T[:, :3, 3] += offsets
    if turns is not None:
        T[:, :3, :3] = MIDDLE[:3, :3] @ matrix_from_rotation_vector(turns)
    return T


def half_circle(radius: float) -> np.ndarray:
    angle = np.array([0.0, 0.5, 1.0]) * np.pi
    place = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    return at(radius * place)


def tangent(force: float) -> np.ndarray:
    angle = np.array([0.0, 0.5, 1.0]) * np.pi
    out = np.zeros((3, 6))
    out[:, 0], out[:, 1] = -force * np.sin(angle), force * np.cos(angle)
    return out


def test_circles_go_through_their_points():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(50, 3, 3))
    found = circles(*np.swapaxes(points, 0, 1))
    rows = np.arange(50)
    for k, angle in enumerate((np.zeros(50), found.second, found.third)):
        assert np.abs(on_circles(found, rows, angle) - points[:, k]).max() < 1e-9
        assert from_circles(points[:, k], found, rows).max() < 1e-9
    assert (found.second < found.third).all()  # the second is met before the third
    off = points[:, 0] + 0.1 * np.cross(found.outward, found.ahead)
    assert from_circles(off, found, rows) == pytest.approx(0.1)
    straight = circles(*np.array([[[0.0, 0, 0]], [[1.0, 0, 0]], [[2.0, 0, 0]]]))
    assert np.isnan(straight.radius).all()


def test_an_arc_of_a_plane_climbs_with_its_angle():
    angle = np.linspace(0.0, 3.0, 9)
    on = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    normal = np.tile([0.0, 0, 1.0], (9, 1))
    begin, middle, end = (np.tile(on[k], (9, 1)) for k in (0, 4, 8))
    middle = middle + 5.0 * normal  # out of the plane it is not followed
    assert from_helices(on, begin, middle, end, normal).max() < 1e-12
    off = on + 0.01 * normal
    assert from_helices(off, begin, middle, end, normal) == pytest.approx(0.01)
    out = on * [1.02, 1.02, 1.0]
    assert from_helices(out, begin, middle, end, normal) == pytest.approx(0.02)


def test_distance_from_a_segment_ends_at_its_ends():
    start, end = np.zeros((3, 3)), np.tile([2.0, 0, 0], (3, 1))
    points = np.array([[1.0, 0.5, 0], [3.0, 0, 0], [-1.0, 1.0, 0]])
    assert from_segments(points, start, end) == pytest.approx([0.5, 1.0, np.sqrt(2.0)])
    assert from_segments(points[:1], start[:1], start[:1]) == pytest.approx(np.hypot(1.0, 0.5))


def test_a_line_is_off_by_what_a_target_in_it_says():
    ends = np.array([[-0.15, 0, 0], [0.15, 0, 0]])
    found = job_deviation(job_of(at(ends)))
    assert found.length[0] == pytest.approx(0.3)
    there = ends[0] + found.at[0] * (ends[1] - ends[0])
    assert found.place[0] == pytest.approx(MIDDLE[:3, 3] + there)
    program = cases.program_of(at(np.array([ends[0], there, ends[1]])))
    settings = CompensationSettings(home=HOME)
    told = compensate(cases.rigid_model(), program, settings=settings).replacement.position
    bow = from_segments(told[1:2], told[:1], told[2:])[0]
    assert found.size[0] == pytest.approx(bow, rel=1e-3)
    assert bow > 1.0 * UM


def test_lines_bow_with_the_square_of_their_length():
    """Over 20 arms: 10, 50, 100 and 200 mm; the note's arm has 0.01, 0.19 and 0.75 um."""
    sizes = []
    for seed in range(20):
        ends = np.array([[-0.1, 0, 0], [-0.05, 0, 0], [-0.025, 0, 0], [-0.005, 0, 0]])
        T = at(np.concatenate([ends, -ends[::-1]]))
        job = job_of(T, model=cases.rigid_model(seed))
        moves = Moves(start=[0, 1, 2, 3], via=[-1] * 4, end=[7, 6, 5, 4], line=[1] * 4,
                      obstacle=[0] * 4)  # fmt: skip
        pairs = JobMoves(
            model=job.model, moves=moves, poses=job.poses, joints=job.joints, status=job.status,
            load=job.load, settings=job.settings,
        )  # fmt: skip
        sizes.append(measure_moves(pairs, np.arange(4), np.ones(4, int)).size / UM)
    sizes = np.array(sizes)
    law = sizes[:, 0] / sizes[:, 1]
    assert np.median(law) == pytest.approx(4.0, rel=0.05)
    assert np.median(sizes[:, 0] / sizes[:, 3]) == pytest.approx(400.0, rel=0.1)
    assert 0.5 < np.median(sizes[:, 1]) < 10.0


def test_arcs_stay_arcs_when_small_and_do_not_under_a_force_that_turns():
    """The note: r 5 mm 1.6 um, r 200 mm 42 um; any radius under 300 N 62 to 76 um."""
    free = [job_deviation(job_of(half_circle(r), arc=True)).size[0] / UM for r in (0.005, 0.1)]
    pushed = [
        job_deviation(
            job_of(half_circle(r), arc=True, wrench=tangent(300.0), model=cases.rigid_model())
        ).size[0] / UM
        for r in (0.005, 0.1)
    ]  # fmt: skip
    assert free[0] < 8.0
    assert 10.0 < free[1] < 200.0
    assert free[1] > 10.0 * free[0]
    assert min(pushed) > 30.0
    assert pushed[0] > 10.0 * free[0]


def test_a_force_turns_with_the_tangent_between_targets():
    job = job_of(half_circle(0.05), arc=True, wrench=tangent(300.0))
    shapes = job.shapes(np.array([0]))
    t = np.linspace(0.0, 1.0, 9)
    move = np.zeros(9, int)
    force = loads(shapes, move, t)[:, :3]
    angle = np.pi * t
    wanted = 300.0 * np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    assert np.abs(force - wanted).max() < 1e-9
    place, _ = along(shapes, move, t)
    assert np.abs(np.linalg.norm(place - MIDDLE[:3, 3], axis=1) - 0.05).max() < 1e-12
    even = job_of(half_circle(0.05), arc=True, wrench=np.tile([0, 0, 50.0, 0, 0, 0], (3, 1)))
    assert len(even.load) == 0  # the same everywhere is no load that changes


def test_the_tool_turns_evenly_and_over_the_auxiliary_point_where_it_lies_on_the_way():
    turns = np.array([[0, 0, 0], [0, 0, 0.2], [0, 0, 0.4]])
    T = half_circle(0.05)
    T[:, :3, :3] = MIDDLE[:3, :3] @ matrix_from_rotation_vector(turns)
    t, move = np.array([0.25, 0.75]), np.zeros(2, int)
    for via, wanted in (([0, 0, 0.2], (0.1, 0.3)), ([0.5, 0, 0.0], (0.1, 0.3))):
        T[1, :3, :3] = MIDDLE[:3, :3] @ matrix_from_rotation_vector(np.array(via))
        _, rotation = along(job_of(T, arc=True).shapes(np.array([0])), move, t)
        for R, angle in zip(rotation, wanted, strict=True):
            turn = matrix_from_rotation_vector(np.array([0, 0, angle]))
            assert np.abs(R - MIDDLE[:3, :3] @ turn).max() < 1e-9


def test_short_lines_are_bounded_not_looked_at():
    n = 12000
    k = 100
    i = np.arange(n)
    row, col = i // k, np.where((i // k) % 2 == 0, i % k, k - 1 - i % k)
    offsets = np.stack([(col / k - 0.5), (row / (n // k) - 0.5), 0.0 * i], axis=1) * 0.06
    job = job_of(at(offsets))
    found = job_deviation(job)
    assert found.bounded.mean() > 0.6
    assert np.isfinite(found.size).all()
    looked = measure_moves(job, np.arange(n - 1), np.ones(n - 1, int), steps=2)
    assert (looked.size <= found.size + 1e-13).all()
    assert found.size[found.bounded].max() < 0.1 * UM


def test_long_lines_are_looked_at_however_many_there_are():
    """Fails when a bound above what matters stands for the deviation itself."""
    n = 4400
    across = np.where(np.arange(n) % 2 == 0, -0.03, 0.03)
    offsets = np.stack([across, np.linspace(-0.02, 0.02, n), np.zeros(n)], axis=1)
    job = job_of(at(offsets))
    found = job_deviation(job)
    assert not found.bounded.any()
    looked = measure_moves(job, np.arange(n - 1), np.ones(n - 1, int), steps=2)
    assert (found.size >= looked.size - 1e-13).all()
    assert (found.size < 2.0 * looked.size).all()


def test_a_model_with_backlash_is_looked_at_everywhere():
    n = 5000
    offsets = np.stack([np.linspace(-0.05, 0.05, n), np.zeros(n), np.zeros(n)], axis=1)
    model = cases.rich_model(harmonics=2, centres=3)
    found = job_deviation(job_of(at(offsets), model=model))
    assert not found.bounded.any()


def test_moves_that_begin_at_no_compensated_target_are_not_known():
    T = at(np.array([[-0.05, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0]]))
    program = cases.program_of(T, reason=np.array([0, 1, 0]))
    model, settings = cases.rigid_model(), CompensationSettings(home=HOME)
    result = compensate(model, program, settings=settings)
    moves = Moves(start=[0, 1, -1], via=[-1] * 3, end=[1, 2, 2], line=[1, 2, 3], obstacle=[0] * 3)
    found = job_deviation(job_moves(model, [program], moves, [result], [settings]))
    assert np.isnan(found.size).all()
    assert (found.status == Status.UNCHANGED_SOURCE).all()


def test_a_place_on_the_way_that_cannot_be_compensated_is_named():
    settings = {"max_shift": 10e-3}
    job = job_of(at(np.array([[-0.05, 0, 0], [0.05, 0, 0]])), **settings)
    tight = JobMoves(
        model=job.model, moves=job.moves, poses=job.poses, joints=job.joints, status=job.status,
        load=job.load, settings=CompensationSettings(home=HOME, max_shift=1e-6),
    )  # fmt: skip
    found = job_deviation(tight)
    assert np.isnan(found.size[0])
    assert found.status[0] == Status.UNCHANGED_STEP


def test_a_payload_that_changes_is_refused():
    T = at(np.array([[-0.05, 0, 0], [0.05, 0, 0]]))
    load = Load(mass=np.array([1.0, 2.0]), com=np.zeros((1, 3)))
    with pytest.raises(ConfigurationError, match=r"payload changes from target to target of part"):
        job_of(T, load=load)


def test_errors_of_orientation_do_not_count_as_places():
    """A turn on the spot: the deviation is that of a point, its turn is told beside it."""
    job = job_of(at(np.zeros((2, 3)), np.array([[0, 0, 0], [0.4, 0, 0]])))
    found = job_deviation(job)
    assert found.length[0] == 0.0
    assert np.isfinite(found.size[0])
    assert found.turn[0] > 0.0


def test_the_force_of_the_note_in_its_order():
    """KR160, sigma 0.3 mm and 0.02 deg, stiffness of the paper: 10 arms, medians, simulated."""
    sizes = []
    for seed in range(10):
        robot = cases.kr160(pose(np.eye(3), np.array([0.0, 0.0, 0.2])))
        rng, errors = np.random.default_rng(seed), np.zeros(robot.errors.shape)
        for group, sd in (("theta", 0.02 * DEG), ("alpha", 0.02 * DEG), ("d", 0.3 * MM),
                          ("a", 0.3 * MM)):  # fmt: skip
            part = parameter_slice(6, group)
            errors[part] = rng.normal(size=errors[part].shape) * sd
        compliance = 1.0 / (1e6 * np.array([1.75, 1.72, 1.95, 0.73, 0.51, 0.44]))
        errors[parameter_slice(6, "compliance")] = compliance
        model = cases.TableModel(tables=cases.rigid_tables(robot.with_errors(errors)))
        T = np.tile(forward(robot, HOME[None])[0], (3, 1, 1))
        T[:, :3, 3] += half_circle(0.005)[:, :3, 3] - MIDDLE[:3, 3]
        program = cases.program_of(T, tool=robot.T_flange_tool)
        row = []
        for force in (0.0, 300.0):
            wrench = tangent(force) if force else np.empty(0)
            settings = CompensationSettings(home=HOME, wrench=wrench)
            result = compensate(model, program, settings=settings)
            moves = Moves(start=[0], via=[1], end=[2], line=[1], obstacle=[0])
            row.append(
                job_deviation(job_moves(model, [program], moves, [result], [settings])).size[0]
            )
        sizes.append(row)
    free, pushed = np.median(np.array(sizes), axis=0) / UM
    assert 0.5 < free < 5.0
    assert 30.0 < pushed < 200.0
