"""The estimate from touches: laws, what it learns, surfaces, sockets and gauges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from probing_cases import EXACT, FACE, SETTINGS, cell, frame_error, known_arm, of, touched

from robotrue.calibration.archive import open_model
from robotrue.calibration.belief import add_variance, with_amplitude, with_centres
from robotrue.calibration.calibrated_model import CalibratedModel, model_of
from robotrue.calibration.methods import fit
from robotrue.calibration.model import Query
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import (
    ProbingEstimate,
    ProbingSettings,
    before_touching,
    estimate_probing,
    model_of_estimate,
)
from robotrue.calibration.terms.smooth import choose_centres
from robotrue.calibration.touches import few_factor, frame_displacement
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid, inverse, pose
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.surfaces import Plane, TriangleMesh
from robotrue.core.units import MM
from robotrue.errors import (
    ConfigurationError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)
from robotrue.measurement.probing_set import KnownDistance, ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branch_of, inverse_batch
from robotrue.robot.model import RobotModel, parameter_slice
from robotrue_reproductions.feng2018.machining_cell import (
    FACES,
    SIZE,
    START,
    CellSizes,
    FengCell,
    feng_cell,
    joints_touching,
    machine,
    touch,
    touch_points,
    tracker_poses,
)

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
    found = estimate_probing(NominalModel(robot=where.nominal), touched(where, 4), SETTINGS)
    np.testing.assert_allclose(found.T_base_part[0], where.T_base_part, atol=2e-8)
    assert found.rms < 1e-8


def test_parts_in_one_set_are_each_found() -> None:
    where = feng_cell(5, EXACT)
    one = touched(where, 4)
    part = np.repeat([0, 7], [6, 6])
    found = estimate_probing(NominalModel(robot=where.nominal), replace(one, part=part), SETTINGS)
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
        found = estimate_probing(NominalModel(robot=where.nominal), touches, SETTINGS)
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
        assert isinstance(model, CalibratedModel)
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
    with pytest.raises(
        ImplausibleDataError, match=r"disagree with the others.*tool of the touches"
    ):
        estimate_probing(unchanged, touched(where, 8), replace(SETTINGS, tool_sigma=0.0))


def test_another_tool_needs_to_be_said_how_well_known() -> None:
    where = cell(2)
    model = known_arm(where)
    tool = where.robot.actual.T_flange_tool
    with pytest.raises(ConfigurationError, match="without a stated uncertainty"):
        before_touching(model, ProbingSettings(T_flange_tool=tool))
    belief = before_touching(model, ProbingSettings(T_flange_tool=tool, tool_sigma=1 * MM))
    place = parameter_slice(6, "tool")
    np.testing.assert_allclose(belief.variance[place], [1e-6] * 3 + [0.0] * 3)
    assert not belief.errors[place].any()


def test_a_smooth_residual_reaches_to_the_touches_and_is_kept() -> None:
    where = cell(2)
    measured = tracker_poses(where, np.random.default_rng(1))
    plain = fit(where.nominal, measured, method="elastic").belief()
    basis = choose_centres(measured.joints, np.full(12, 0.6), most=20, enough=0.05)
    belief = with_amplitude(with_centres(plain, basis), 0.05 * MM)
    variance = np.zeros(len(belief.mean))
    variance[belief.place("smooth").start :] = (0.05 * MM) ** 2
    model = model_of(add_variance(belief, variance), {"method": "gp"})
    touches = touched(where, 6)
    found = estimate_probing(model, touches, replace(SETTINGS, tool_sigma=0.0))
    assert found.belief.smooth.size > belief.smooth.size == 3 * 20
    refined = model_of_estimate(found)
    again = open_model(refined.to_archive())
    query = Query(joints=touches.joints)
    np.testing.assert_array_equal(again.predict(query).error, refined.predict(query).error)
    other = replace(SETTINGS, T_flange_tool=model.robot.T_flange_tool, tool_sigma=0.3 * MM)
    assert before_touching(model, other).white > 0.05 * MM


def test_tracker_points_join_the_touches() -> None:
    where = cell(4)
    measured = tracker_poses(where, np.random.default_rng(2), count=30)
    touches = touched(where, 4)
    alone = estimate_probing(NominalModel(robot=where.nominal), touches, SETTINGS)
    settings = replace(SETTINGS, tool_sigma=0.0)
    both = estimate_probing(
        NominalModel(robot=where.nominal), touches, settings, measurements=measured
    )
    assert np.trace(both.covariance()[:3, :3]) < 0.3 * np.trace(alone.covariance()[:3, :3])


def test_few_touches_of_one_side_say_that_they_are_few() -> None:
    factors = []
    for postures in (("R",), ("R", "L", "T")):
        touches = touched(cell(2), 30 // len(postures), postures=postures)
        found = estimate_probing(NominalModel(robot=cell(2).nominal), touches, SETTINGS)
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
    found = estimate_probing(NominalModel(robot=where.nominal), touches, SETTINGS)
    np.testing.assert_allclose(found.T_base_part[0], where.T_base_part, atol=1e-6)
    assert found.distances.max() < 1e-6


def test_a_touch_off_the_part_is_named() -> None:
    where = cell(1)
    touches = side_face(on_faces(where, 6, 2.0 * MM), where)
    point = touches.point.copy()
    point[[4, 9]] += 3.0 * MM * touches.normal[[4, 9]]
    found = estimate_probing(
        NominalModel(robot=where.nominal), replace(touches, point=point), SETTINGS
    )
    assert found.outliers == ("p5", "p10")
    np.testing.assert_allclose(found.distances[[4, 9]], 3.0 * MM, atol=0.6 * MM)


def test_faces_that_leave_a_motion_free_are_refused() -> None:
    where = feng_cell(6, EXACT)
    with pytest.raises(ObservabilityError, match=r"shift along \(\+1.00"):
        estimate_probing(NominalModel(robot=where.nominal), on_faces(where, 5, 0.0), SETTINGS)


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
    found = estimate_probing(NominalModel(robot=where.nominal), touches, settings)
    tip = where.robot.actual.T_flange_tool[:3, 3] - where.nominal.T_flange_tool[:3, 3]
    np.testing.assert_allclose(
        found.belief.errors[parameter_slice(6, "tool")][:3], tip, atol=0.35 * MM
    )
    assert found.covariance(1).shape == (3, 3)
    apart = found.T_base_part[2][:3, 3] - found.T_base_part[1][:3, 3]
    assert abs(np.linalg.norm(apart) - length) < 0.01 * MM
    without = estimate_probing(
        NominalModel(robot=where.nominal), replace(touches, distances=()), settings
    )

    def along(estimate: ProbingEstimate) -> float:
        joint = estimate.joint_covariance()
        direction = apart / np.linalg.norm(apart)
        row = np.zeros(len(joint))
        row[estimate.columns(1)], row[estimate.columns(2)] = direction, -direction
        return float(np.sqrt(row @ joint @ row))

    assert along(found) < 0.025 * MM < along(without)
