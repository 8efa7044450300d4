"""``register`` in simulated cells: what it finds, what it promises, what it doubts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, identity_of
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, inverse
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import MM
from robotrue.errors import ModelMismatchError, ShapeError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.presets import preset
from robotrue.validation.part_registration import register
from robotrue.validation.registered_part import RegisteredPart
from robotrue.validation.registration_frame import RegistrationSettings
from robotrue_reproductions.feng2018.machining_cell import (
    FACES,
    SIZE,
    FengCell,
    Posture,
    attitude,
    compensated_joints,
    feng_cell,
    machine,
    touch,
    touch_points,
    tracker_poses,
    with_tool_change,
)

ARM = FitSettings(repeatability=0.03 * MM * 3.6158)
TOLD = RegistrationSettings(arm=ARM)


def probed(
    cell: FengCell, sides: Sequence[tuple[Posture, int]], rng: np.random.Generator
) -> ProbingSet:
    points = [touch_points(side, n, rng) for side, n in sides]
    joints = [touch(cell, p, side, rng) for p, (side, _) in zip(points, sides, strict=True)]
    names = [f"{side}{i}" for side, n in sides for i in range(n)]
    return ProbingSet(names=tuple(names), point=np.vstack(points), joints=np.vstack(joints))


def machined(cell: FengCell, part: RegisteredPart, arm: ErrorModel | None, side: Posture) -> float:
    """Rms error in mm of points cut in the found frame, compensated by the model it belongs to."""
    rng = np.random.default_rng(77)
    points = touch_points(side, 12, rng)
    T = np.zeros((12, 4, 4))
    T[:] = np.eye(4)
    T[:, :3, :3] = attitude(side)
    T[:, :3, 3] = apply(part.frames[0].registration.T_base_part, points)
    hit = machine(cell, compensated_joints(arm or cell.nominal, T, side), rng)
    off = hit - apply(cell.T_base_part, points)
    return float(np.sqrt((off**2).sum(axis=1).mean())) / MM


def rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


THREE: list[tuple[Posture, int]] = [("R", 5), ("L", 5), ("T", 5)]


def test_touches_of_three_sides_learn_a_nominal_arm() -> None:
    alone, joint = [], []
    for seed in range(4):
        cell = feng_cell(seed)
        touches = probed(cell, THREE, np.random.default_rng(seed))
        found = register(NominalModel(robot=cell.nominal), touches, settings=TOLD)
        assert found.route == "joint"
        assert found.refined is not None
        assert found.identity == identity_of(found.refined)
        assert found.touched_with == identity_of(NominalModel(robot=cell.nominal))
        plain = register(
            NominalModel(robot=cell.nominal), touches, settings=replace(TOLD, fit="frame")
        )
        assert plain.refined is None
        for side in ("R", "L"):
            alone.append(machined(cell, plain, None, side))
            joint.append(machined(cell, found, found.refined, side))
    assert rms(joint) < 0.3 < 0.5 < rms(alone)


@pytest.fixture(scope="module")
def calibrated() -> tuple[FengCell, ErrorModel]:
    cell = feng_cell(11)
    measurements = tracker_poses(cell, np.random.default_rng(12))
    return cell, fit(cell.nominal, measurements, method="elastic", settings=ARM)


def test_a_calibrated_arm_needs_no_more_than_its_frame(
    calibrated: tuple[FengCell, ErrorModel],
) -> None:
    cell, model = calibrated
    touches = probed(cell, THREE, np.random.default_rng(13))
    for way in ("frame", "joint"):
        found = register(model, touches, settings=replace(TOLD, fit=way))  # type: ignore[arg-type]
        assert found.verdict == "GO"
        assert found.route == way
        assert machined(cell, found, found.refined or model, "R") < 0.2
        assert machined(cell, found, found.refined or model, "L") < 0.2
        # The step from the found to the true frame lies where its covariance says.
        fit_ = found.frames[0].registration
        off = fit_.T_base_part @ inverse(cell.T_base_part)
        turn = rotation_vector_from_matrix(off[:3, :3])
        shift = fit_.T_base_part[:3, 3] - cell.T_base_part[:3, 3]
        step = np.concatenate([shift, turn])
        assert step @ np.linalg.solve(fit_.covariance, step) < 22.5  # 99.9 % of chi^2 with 6


def test_a_tool_change_that_is_told_is_estimated(calibrated: tuple[FengCell, ErrorModel]) -> None:
    cell, model = calibrated
    changed = with_tool_change(cell, np.random.default_rng(14))
    touches = probed(changed, THREE, np.random.default_rng(15))
    found = register(model, touches, settings=replace(TOLD, tool_sigma=0.3 * MM))
    assert max(machined(changed, found, found.refined, side) for side in ("R", "L")) < 0.2
    told = replace(TOLD, tool_sigma=0.3 * MM)
    one_side = register(
        model, probed(changed, [("R", 10)], np.random.default_rng(16)), settings=told
    )
    assert any("within 10 deg of one attitude" in doubt for doubt in one_side.doubts)


def test_another_tool_than_the_measured_one_is_doubted(
    calibrated: tuple[FengCell, ErrorModel],
) -> None:
    cell, model = calibrated
    touches = probed(cell, THREE, np.random.default_rng(17))
    tool = cell.nominal.T_flange_tool.copy()
    tool[0, 3] += 0.1 * MM
    found = register(model, touches, settings=replace(TOLD, T_flange_tool=tool))
    assert any("known to 0.3 mm per axis" in doubt for doubt in found.doubts)
    assert machined(cell, found, found.refined, "L") < 0.25


def test_a_wrong_touch_is_named_in_every_route(calibrated: tuple[FengCell, ErrorModel]) -> None:
    cell, model = calibrated
    touches = probed(cell, THREE, np.random.default_rng(18))
    wrong = touches.point.copy()
    wrong[7] += [0.003, 0.0, 0.0]  # as if the drawing was misread
    touches = replace(touches, point=wrong)
    for arm, way in (
        (model, "frame"),
        (model, "joint"),
        (NominalModel(robot=cell.nominal), "joint"),
    ):
        settings = replace(TOLD, fit=way)  # type: ignore[arg-type]
        fit_ = register(arm, touches, settings=settings).frames[0].registration
        assert fit_.outliers == ("L2",)
        assert fit_.distances[7] > 2.0 * MM


def block() -> TriangleMesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * SIZE
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return TriangleMesh(vertices=corners, faces=np.array(faces))


def test_normals_and_a_mesh_find_the_same_block(calibrated: tuple[FengCell, ErrorModel]) -> None:
    cell, model = calibrated
    touches = probed(cell, [("R", 10), ("L", 10), ("T", 10)], np.random.default_rng(19))
    normal = np.full((30, 3), np.nan)
    for row, name in enumerate(touches.names):
        axis, level = FACES[name[0]]  # type: ignore[index]
        normal[row] = np.eye(3)[axis] * (1.0 if level > 0.0 else -1.0)
    normal[[0, 14]] = np.nan  # two corners as feature points hold the block along x
    touches = replace(touches, normal=normal)
    plain = register(model, touches, settings=replace(TOLD, fit="frame"))
    meshed = register(model, touches, settings=replace(TOLD, fit="frame", mesh=block()))
    joint = register(model, touches, settings=replace(TOLD, fit="joint", mesh=block()))
    for found in (plain, meshed, joint):
        place = found.frames[0].registration.T_base_part
        corners = np.array([[0.0, 0.0, 0.0], SIZE])
        gap: Array = apply(place, corners) - apply(cell.T_base_part, corners)
        assert np.linalg.norm(gap, axis=1).max() < 0.5 * MM


def test_noise_stated_too_small_is_no_go(calibrated: tuple[FengCell, ErrorModel]) -> None:
    cell, model = calibrated
    touches = probed(cell, [("R", 12)], np.random.default_rng(20))
    small = replace(TOLD, touch=0.005 * MM, robot=0.05 * MM, fit="frame")
    found = register(model, touches, settings=small)
    assert found.verdict == "NO-GO"
    assert "lie just beyond the limit for good ones (0.171 mm)" in found.frames[0].reasons[0]
    assert register(model, touches, settings=replace(TOLD, fit="frame")).verdict == "GO"


def test_what_does_not_belong_together() -> None:
    cell = feng_cell(1)
    touches = probed(cell, [("R", 4)], np.random.default_rng(21))
    with pytest.raises(ShapeError, match=r"touches of parts \(0,\), names for 2"):
        register(NominalModel(robot=cell.nominal), touches, parts=("a", "b"))
    with pytest.raises(ModelMismatchError, match="6 joint columns"):
        register(NominalModel(robot=preset("Franka Panda")), touches)
