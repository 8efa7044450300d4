"""The estimate from touches: laws, what it learns, what it names, and what it refuses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robotrue.calibration.belief import belief_of, model_of, widened, with_centres
from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.probing import (
    ProbingEstimate,
    ProbingSettings,
    before_touching,
    estimate_probing,
    model_of_estimate,
)
from robotrue.calibration.probing_scales import few_factor
from robotrue.calibration.residual import LearnedModel
from robotrue.calibration.residual import from_archive as model_from_archive
from robotrue.calibration.rigid_flexible import RigidFlexibleModel
from robotrue.calibration.smooth import SmoothBasis, choose_centres
from robotrue.calibration.touches import frame_displacement
from robotrue.core.arrays import Array
from robotrue.core.mesh import TriangleMesh
from robotrue.core.poses import apply, fit_rigid, inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.surfaces import Plane
from robotrue.core.units import MM
from robotrue.errors import (
    ConfigurationError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
    RobotrueError,
)
from robotrue.measurement.probing_set import KnownDistance, ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, inverse_batch
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue.simulation.feng2018_cell import (
    FACES,
    SIZE,
    START,
    T_BASE_DRAWN,
    CellSizes,
    FengCell,
    Posture,
    feng_cell,
    joints_touching,
    machine,
    touch,
    touch_points,
    tracker_poses,
)

EXACT = CellSizes(arm=0.0, tip=0.0, touch=0.0, repeatability=0.0)
SETTINGS = ProbingSettings(touch_sigma=0.1 * MM, tool_sigma=0.3 * MM)
FACE: dict[Posture, Plane] = {
    posture: Plane(
        point=np.where(np.arange(3) == axis, level, 0.0),
        normal=(1.0 if level > 0.0 else -1.0) * np.eye(3)[axis],
    )
    for posture, (axis, level) in FACES.items()
}
"""The faces of the block as planes."""


def known_arm(cell: FengCell) -> RigidFlexibleModel:
    """A model that knows the arm without any doubt."""
    actual = cell.robot.actual
    size = len(actual.errors)
    nominal = actual.nominal()
    return RigidFlexibleModel(
        robot=nominal,
        errors=actual.errors,
        covariance=np.zeros((size, size)),
        repeatability=0.0,
        white=0.0,
    )


@cache
def cell(seed: int) -> FengCell:
    return feng_cell(seed)


def touched(
    where: FengCell, count: int, *, seed: int = 0, postures: tuple[Posture, ...] = ("R", "L", "T")
) -> ProbingSet:
    """``count`` touches of feature points in every posture."""
    rng = np.random.default_rng([seed, where.seed])
    points = [touch_points(p, count, rng) for p in postures]
    joints = [touch(where, x, p, rng) for x, p in zip(points, postures, strict=True)]
    return of(np.concatenate(points), np.concatenate(joints))


def of(point: Array, joints: Array) -> ProbingSet:
    names = tuple(f"p{i + 1}" for i in range(len(point)))
    return ProbingSet(names=names, point=point, joints=joints, source="simulated")


def spoilt(touches: ProbingSet, rows: list[int], by: float) -> ProbingSet:
    """The set with some nominal points moved: the probe touched something else."""
    point = touches.point.copy()
    rng = np.random.default_rng(9)
    away = rng.normal(size=(len(rows), 3))
    point[rows] += by * away / np.linalg.norm(away, axis=1)[:, None]
    return replace(touches, point=point)


def frame_error(found: Array, true: Array) -> Array:
    turn = rotation_vector_from_matrix(found[:3, :3] @ true[:3, :3].T)
    return np.concatenate([found[:3, 3] - true[:3, 3], turn])


# Laws


def test_a_perfectly_known_arm_gives_the_rigid_fit() -> None:
    where = cell(3)
    touches = touched(where, 4)
    model = known_arm(where)
    found = estimate_probing(model, touches, ProbingSettings(touch_sigma=0.2 * MM))
    nominal = forward(model.robot, touches.joints)[:, :3, 3]
    tips = nominal + model.predict(Query(joints=touches.joints)).error
    np.testing.assert_allclose(found.T_base_part[0], fit_rigid(touches.point, tips), atol=1e-9)
    placed = apply(found.T_base_part[0], touches.point)
    np.testing.assert_allclose(found.residuals, tips - placed, atol=1e-9)
    assert not found.outliers
    lever = tips - found.T_base_part[0][:3, 3]
    rows = np.zeros((12, 3, 6))
    rows[:, :, :3] = np.eye(3)
    for i, (x, y, z) in enumerate(lever):
        rows[i, :, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    flat = rows.reshape(-1, 6)
    expected = found.sigma**2 * np.linalg.inv(flat.T @ flat)
    sd = np.sqrt(np.diagonal(expected))
    unit = np.outer(sd, sd)
    np.testing.assert_allclose(found.covariance() / unit, expected / unit, atol=2e-4)


def test_exact_touches_of_an_exact_arm_give_the_exact_frame() -> None:
    where = feng_cell(5, EXACT)
    found = estimate_probing(where.nominal, touched(where, 4), SETTINGS)
    np.testing.assert_allclose(found.T_base_part[0], where.T_base_part, atol=2e-8)
    assert found.rms < 1e-8


def test_parts_in_one_set_are_each_found() -> None:
    where = feng_cell(5, EXACT)
    one = touched(where, 4)
    part = np.repeat([0, 7], [6, 6])
    found = estimate_probing(where.nominal, replace(one, part=part), SETTINGS)
    assert sorted(found.T_base_part) == [0, 7]
    for k in (0, 7):
        np.testing.assert_allclose(found.T_base_part[k], where.T_base_part, atol=1e-7)
        assert found.covariance(k).shape == (6, 6)
    assert found.columns(0).stop == found.columns(7).start
    assert found.columns(7).stop == len(found.belief.mean) == len(found.joint_covariance())
    with pytest.raises(ModelMismatchError, match="part 1 was not touched"):
        found.covariance(1)


# What it learns


def test_touches_alone_calibrate_the_arm() -> None:
    better, covered = [], []
    for seed in range(4):
        where = cell(seed)
        touches = touched(where, 10)
        found = estimate_probing(where.nominal, touches, SETTINGS)
        model = model_of_estimate(found)
        rng = np.random.default_rng(seed)
        for posture in ("R", "L"):
            points = rng.uniform(0.0, 1.0, (20, 3)) * SIZE
            points[:, FACES[posture][0]] = FACES[posture][1]
            joints = touch(where, points, posture, rng)
            true = apply(inverse(where.T_base_part), machine(where, joints))
            nominal = forward(where.nominal, joints)[:, :3, 3]
            after = nominal + model.predict(Query(joints=joints)).error
            plain = fit_rigid(touches.point, forward(where.nominal, touches.joints)[:, :3, 3])
            off = apply(inverse(found.T_base_part[0]), after) - true
            before = apply(inverse(plain), nominal) - true
            better.append(np.sqrt((off**2).sum(axis=1).mean() / (before**2).sum(axis=1).mean()))
        sd = np.sqrt(np.diagonal(found.covariance()))
        covered.append(frame_error(found.T_base_part[0], where.T_base_part) / sd)
        assert not found.outliers
        assert 0.6 < found.misfit < 1.4
        assert isinstance(model, LearnedModel)
        assert model.training_summary()["method"] == "probing"
    assert np.median(better) < 0.25
    assert np.abs(covered).max() < 3.5


def test_a_changed_tool_is_found_and_the_lineage_kept() -> None:
    where = cell(2)
    model = fit(where.nominal, tracker_poses(where, np.random.default_rng(1)), method="elastic")
    tool = where.robot.actual.T_flange_tool.copy()
    change = np.array([0.8, -0.5, 0.6]) * MM
    tool[:3, 3] += change
    other = replace(
        where, robot=replace(where.robot, actual=replace(where.robot.actual, T_flange_tool=tool))
    )
    touches = touched(other, 8)
    settings = replace(SETTINGS, tool_sigma=0.6 * MM)
    found = estimate_probing(model, touches, settings)
    place = parameter_slice(6, "tool")
    moved = found.belief.errors[place][:3] - model.errors[place][:3]
    sd = np.sqrt(found.belief.variance[place][:3])
    assert np.abs(moved - change).max() < 0.25 * MM
    assert (np.abs(moved - change) < 3.5 * sd).all()
    steps = [step["step"] for step in model_of_estimate(found).training_summary()["lineage"]]
    assert steps == ["fit", "probing"]


def test_an_untold_tool_change_is_no_noise() -> None:
    where = feng_cell(5, CellSizes(tip=1.5 * MM))
    unchanged = known_arm(replace(where, robot=replace(where.robot, actual=where.nominal)))
    with pytest.raises(ImplausibleDataError, match=r"disagree with the rest.*tool of the touches"):
        estimate_probing(unchanged, touched(where, 8), replace(SETTINGS, tool_sigma=0.0))


def test_another_tool_needs_to_be_said_how_well_known() -> None:
    where = cell(2)
    model = known_arm(where)
    tool = where.robot.actual.T_flange_tool
    with pytest.raises(ConfigurationError, match="nothing says how well it is known"):
        before_touching(model, ProbingSettings(T_flange_tool=tool))
    belief = before_touching(model, ProbingSettings(T_flange_tool=tool, tool_sigma=1 * MM))
    place = parameter_slice(6, "tool")
    np.testing.assert_allclose(belief.variance[place], [1e-6] * 3 + [0.0] * 3)
    assert not belief.errors[place].any()


def test_a_smooth_residual_reaches_to_the_touches_and_is_kept() -> None:
    where = cell(2)
    measured = tracker_poses(where, np.random.default_rng(1))
    plain = belief_of(fit(where.nominal, measured, method="elastic"))
    basis = choose_centres(measured.joints, np.full(12, 0.6), most=20, enough=0.05)
    none = SmoothBasis(centres=np.zeros((0, 12)), scale=basis.scale)
    belief = with_centres(replace(plain, basis=none, amplitude=0.05 * MM), basis)
    variance = np.zeros(len(belief.mean))
    variance[belief.starts[2] :] = (0.05 * MM) ** 2
    model = model_of(widened(belief, variance), {"method": "gp"})
    touches = touched(where, 6)
    found = estimate_probing(model, touches, replace(SETTINGS, tool_sigma=0.0))
    assert found.belief.centres > belief.centres == 20
    refined = model_of_estimate(found)
    again = model_from_archive(refined.to_archive())
    query = Query(joints=touches.joints)
    np.testing.assert_array_equal(again.predict(query).error, refined.predict(query).error)
    other = replace(SETTINGS, T_flange_tool=model.robot.T_flange_tool, tool_sigma=0.3 * MM)
    assert before_touching(model, other).white > 0.05 * MM


def test_tracker_points_join_the_touches() -> None:
    where = cell(4)
    measured = tracker_poses(where, np.random.default_rng(2), count=30)
    touches = touched(where, 4)
    alone = estimate_probing(where.nominal, touches, SETTINGS)
    settings = replace(SETTINGS, tool_sigma=0.0)
    both = estimate_probing(where.nominal, touches, settings, measurements=measured)
    assert np.trace(both.covariance()[:3, :3]) < 0.3 * np.trace(alone.covariance()[:3, :3])


def test_few_touches_of_one_side_say_that_they_are_few() -> None:
    factors = []
    for postures in (("R",), ("R", "L", "T")):
        touches = touched(cell(2), 30 // len(postures), postures=postures)
        found = estimate_probing(cell(2).nominal, touches, SETTINGS)
        factors.append(found.belief.inflation)
        joint = found.joint_covariance()[found.columns(0), found.columns(0)]
        turn = frame_displacement(found.T_base_part[0])
        np.testing.assert_allclose(found.covariance(), turn @ joint @ turn.T, atol=1e-12)
    assert factors[0] > factors[1] + 0.1 > 1.1
    np.testing.assert_allclose([few_factor(t) for t in (6.0, 1e6)], [1.28369, 1.0], rtol=1e-4)


# Surfaces, sockets, gauges


def on_faces(where: FengCell, count: int, radius: float, *, seed: int = 0) -> ProbingSet:
    """Touches of the block's faces by a ball, aimed a little beside their nominal points."""
    rng = np.random.default_rng(seed)
    points, joints, normal = [], [], []
    for posture, face in FACE.items():
        x = touch_points(posture, count, rng)
        aside = 1.0 * MM * rng.normal(size=x.shape)
        aside -= (aside @ face.normal)[:, None] * face.normal
        attitude = forward(where.nominal, START[posture][None])[0, :3, :3]
        centre = apply(where.T_base_part, x + aside + radius * face.normal)
        noise = where.sizes.touch * rng.normal(size=x.shape)
        joints.append(joints_touching(where, centre + noise, attitude, posture))
        points.append(x)
        normal.append(np.broadcast_to(face.normal, x.shape))
    touches = of(np.concatenate(points), np.concatenate(joints))
    return replace(touches, normal=np.concatenate(normal), radius=radius)


def block_mesh() -> TriangleMesh:
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * SIZE
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    return TriangleMesh(vertices=vertices, faces=np.array(faces))


def side_face(touches: ProbingSet, where: FengCell) -> ProbingSet:
    """The set with three full points, which hold the direction no touched face looks in."""
    rng = np.random.default_rng(8)
    points = touch_points("R", 3, rng)
    joints = touch(where, points, "R", rng)
    nan = np.full((3, 3), np.nan)
    names = (*touches.names, "a", "b", "c")
    return ProbingSet(
        names=names,
        point=np.concatenate([touches.point, points]),
        joints=np.concatenate([touches.joints, joints]),
        normal=np.concatenate([touches.normal, nan]),
        radius=touches.radius,
    )


@pytest.mark.parametrize("kind", ["normals", "planes", "mesh"])
def test_touches_on_surfaces_hold_the_part(kind: str) -> None:
    where = feng_cell(6, EXACT)
    touches = side_face(on_faces(where, 5, 3.0 * MM), where)
    if kind != "normals":
        touched_face = np.where(touches.full, -1, np.repeat([0, 1, 2, -1], [5, 5, 5, 3]))
        surfaces: tuple[Plane | TriangleMesh, ...] = tuple(FACE.values())
        if kind == "mesh":
            surfaces, touched_face = (block_mesh(),), np.minimum(touched_face, 0)
        touches = replace(
            touches,
            normal=np.full((18, 3), np.nan),
            surfaces=surfaces,
            touched=touched_face,
        )
    found = estimate_probing(where.nominal, touches, SETTINGS)
    np.testing.assert_allclose(found.T_base_part[0], where.T_base_part, atol=1e-6)
    assert found.distances.max() < 1e-6


def test_a_touch_off_the_part_is_named() -> None:
    where = cell(1)
    touches = side_face(on_faces(where, 6, 2.0 * MM), where)
    point = touches.point.copy()
    point[[4, 9]] += 3.0 * MM * touches.normal[[4, 9]]
    found = estimate_probing(where.nominal, replace(touches, point=point), SETTINGS)
    assert found.outliers == ("p5", "p10")
    np.testing.assert_allclose(found.distances[[4, 9]], 3.0 * MM, atol=0.6 * MM)


def test_faces_that_leave_a_motion_free_are_refused() -> None:
    where = feng_cell(6, EXACT)
    with pytest.raises(ObservabilityError, match=r"shift along \(\+1.00"):
        estimate_probing(where.nominal, on_faces(where, 5, 0.0), SETTINGS)


def socket_touches(
    where: FengCell, place: Array, number: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Joints of six attitudes with the tip at a place, and the part number of each."""
    robot: RobotModel = where.nominal
    start = START["T"]
    lean = 0.35 * rng.normal(size=(40, 3))
    attitude = matrix_from_rotation_vector(lean) @ forward(robot, start[None])[0, :3, :3]
    shown = np.tile(place, (40, 1))
    for _ in range(4):
        joints = inverse_batch(
            robot, pose(attitude, shown), near=start, branch=branch_of(robot, start)
        )
        good = np.isfinite(joints).all(axis=1)
        attitude, shown, joints = attitude[good], shown[good], joints[good]
        shown = shown + place - machine(where, joints)
    return joints[:6], np.full(6, number)


def test_sockets_and_their_known_distance() -> None:
    where = feng_cell(6, CellSizes(arm=0.0, tip=1.0 * MM, touch=0.0, repeatability=0.0))
    rng = np.random.default_rng(3)
    places = {1: np.array([0.95, -0.15, 0.7]), 2: np.array([1.05, 0.2, 0.75])}
    visits = [socket_touches(where, p, k, rng) for k, p in places.items()]
    length = float(np.linalg.norm(places[2] - places[1]))
    touches = ProbingSet(
        names=tuple(str(i) for i in range(12)),
        point=np.zeros((12, 3)),
        joints=np.concatenate([q for q, _ in visits]),
        part=np.concatenate([k for _, k in visits]),
        sockets=(1, 2),
        distances=(KnownDistance(first=1, second=2, length=length, sigma=0.02 * MM),),
    )
    settings = ProbingSettings(touch_sigma=0.05 * MM, tool_sigma=1.0 * MM)
    found = estimate_probing(where.nominal, touches, settings)
    tip = where.robot.actual.T_flange_tool[:3, 3] - where.nominal.T_flange_tool[:3, 3]
    np.testing.assert_allclose(
        found.belief.errors[parameter_slice(6, "tool")][:3], tip, atol=0.35 * MM
    )
    assert found.covariance(1).shape == (3, 3)
    apart = found.T_base_part[2][:3, 3] - found.T_base_part[1][:3, 3]
    assert abs(np.linalg.norm(apart) - length) < 0.01 * MM
    without = estimate_probing(where.nominal, replace(touches, distances=()), settings)

    def along(estimate: ProbingEstimate) -> float:
        joint = estimate.joint_covariance()
        direction = apart / np.linalg.norm(apart)
        row = np.zeros(len(joint))
        row[estimate.columns(1)], row[estimate.columns(2)] = direction, -direction
        return float(np.sqrt(row @ joint @ row))

    assert along(found) < 0.025 * MM < along(without)


# Wrong touches


def test_wrong_touches_are_named_and_cost_nothing() -> None:
    where = cell(7)
    touches = touched(where, 10)
    clean = estimate_probing(where.nominal, touches, SETTINGS)
    wrong = [3, 11, 12, 25]
    for by in (2.0 * MM, 15.0 * MM):
        found = estimate_probing(where.nominal, spoilt(touches, wrong, by), SETTINGS)
        assert found.outliers == ("p4", "p12", "p13", "p26")
        assert found.believed.sum() == 26
        apart = frame_error(found.T_base_part[0], clean.T_base_part[0])
        assert np.linalg.norm(apart[:3]) < 0.3 * MM
        assert (found.distances[wrong] > 0.8 * by).all()
    assert not clean.outliers


def test_good_touches_of_a_poor_arm_are_kept() -> None:
    where = feng_cell(8, CellSizes(arm=3.0))
    found = estimate_probing(where.nominal, touched(where, 10), SETTINGS)
    assert len(found.outliers) <= 1


def test_swapped_names_among_many_are_named() -> None:
    where = cell(7)
    touches = touched(where, 5)
    point = touches.point.copy()
    point[[2, 8]] = point[[8, 2]]
    found = estimate_probing(where.nominal, replace(touches, point=point), SETTINGS)
    assert found.outliers == ("p3", "p9")


@pytest.mark.parametrize("count", [1, 2])
def test_swapped_names_among_few_are_refused(count: int) -> None:
    where = cell(7)
    touches = touched(where, count).subset(np.arange(3 * count)[: 3 if count == 1 else 4])
    point = touches.point.copy()
    point[[0, 2]] = point[[2, 0]]
    with pytest.raises(ImplausibleDataError):
        estimate_probing(where.nominal, replace(touches, point=point), SETTINGS)


def test_touches_that_mostly_disagree_are_refused() -> None:
    where = cell(7)
    with pytest.raises(ImplausibleDataError, match=r"of part 0 disagree.*p1"):
        estimate_probing(
            where.nominal, spoilt(touched(where, 3), [0, 2, 4, 6, 8], 9.0 * MM), SETTINGS
        )


# Bad input


def test_points_that_fix_no_frame_are_refused() -> None:
    where = feng_cell(5, EXACT)
    rng = np.random.default_rng(0)
    line = np.linspace(0.1, 0.9, 6)[:, None] * np.array([0.4, 0.0, 0.3])
    with pytest.raises(ObservabilityError, match=r"p1, .* lie on one line of the part"):
        estimate_probing(where.nominal, of(line, touch(where, line, "R", rng)), SETTINGS)
    same = np.tile([0.1, 0.0, 0.2], (5, 1))
    with pytest.raises(ObservabilityError, match="at 1 different places"):
        estimate_probing(where.nominal, of(same, touch(where, same, "R", rng)), SETTINGS)
    with pytest.raises(ObservabilityError, match="p1, p2 are at 2 different places"):
        estimate_probing(where.nominal, touched(where, 1).subset([0, 1]), SETTINGS)


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        (lambda t: replace(t, point=1e3 * t.point), ImplausibleDataError, r"span .* mm and the"),
        (lambda t: replace(t, point=t.point * [1, -1, 1]), ImplausibleDataError, "mirror image"),
        (lambda t: replace(t, joints=t.joints * [1, 1, -1, 1, 1, 1]), ImplausibleDataError, "."),
        (
            lambda t: replace(t, joints=t.joints[:, :5]),
            ModelMismatchError,
            "touches have 5 joints, the robot has 6",
        ),
        (
            lambda t: ProbingSet(names=t.names, point=t.point, position=t.point),
            ObservabilityError,
            "without the robot's joints",
        ),
        (lambda t: t.subset([]), ObservabilityError, "0 touches"),
        (lambda t: replace(t, part=np.full(12, -1)), ConfigurationError, "part number -1"),
    ],
)
def test_what_cannot_be_is_refused(
    changed: Callable[[ProbingSet], ProbingSet], error: type[RobotrueError], words: str
) -> None:
    where = cell(5)
    touches = changed(touched(where, 4))
    with pytest.raises(error, match=words):
        estimate_probing(where.nominal, touches, SETTINGS)


@pytest.mark.parametrize("wrong", [{"touch_sigma": 0.1}, {"touch_sigma": 0.0}, {"tool_sigma": 0.3}])
def test_settings_refuse_millimetres_and_touches_without_noise(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigurationError, match=f"{next(iter(wrong))} .* mm, allowed"):
        ProbingSettings(**wrong)


def test_noise_above_what_was_stated_is_learned_and_said() -> None:
    where = feng_cell(5, CellSizes(touch=0.3 * MM))
    found = estimate_probing(where.nominal, touched(where, 12), SETTINGS)
    assert len(found.outliers) <= 2
    assert 0.2 * MM < found.sigma < 0.4 * MM
    assert any("times the stated" in doubt for doubt in found.summary["doubts"])
    quiet = estimate_probing(cell(5).nominal, touched(cell(5), 12), SETTINGS)
    assert not any("times the stated" in doubt for doubt in quiet.summary["doubts"])


def test_drawn_start_is_used_where_it_is_given() -> None:
    where = feng_cell(5, EXACT)
    settings = replace(SETTINGS, start={0: T_BASE_DRAWN})
    found = estimate_probing(where.nominal, touched(where, 4), settings)
    np.testing.assert_allclose(found.T_base_part[0], where.T_base_part, atol=2e-8)
