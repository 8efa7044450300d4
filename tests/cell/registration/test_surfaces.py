"""Surface fits: planes, cylinders, 3-2-1; what is left open is named."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.cell.registration.ambiguity import symmetric_alternatives
from robotrue.cell.registration.baselines import fit_three_two_one
from robotrue.cell.registration.fit import Registration, displace_frame
from robotrue.cell.registration.touches import fit_all_touches
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.surfaces import Cylinder, Plane, Surface
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ObservabilityError, ShapeError
from robotrue.measurement.probing_set import ProbingSet

T = pose_from_xyz_abc(np.array([1.0, 0.2, 0.6]), np.array([0.4, 0.1, -0.8]))
START = displace_frame(T, np.array([6.0 * MM, -6.0 * MM, 4.0 * MM, 0.05, -0.04, 0.05]))
HALF = np.array([0.2, 0.1, 0.15])
BLOCK = tuple(
    Plane(point=s * HALF * np.eye(3)[i], normal=s * np.eye(3)[i]) for i in range(3) for s in (1, -1)
)
"""+x, -x, +y, -y, +z, -z."""
RADIUS = 3.0 * MM


def probe(
    surfaces: tuple[Surface, ...], touched: Array, centre: Array, *, radius: float = 0.0
) -> ProbingSet:
    return ProbingSet(
        names=tuple(str(i + 1) for i in range(len(centre))),
        point=np.zeros((len(centre), 3)),
        position=centre,
        surfaces=surfaces,
        touched=touched,
        radius=radius,
    )


def fit_surfaces(touches: ProbingSet, start: Array, *, sigma: float | None = None) -> Registration:
    return fit_all_touches(touches, touches.position, sigma=sigma, start=start)


def touch(
    faces: list[int], *, sigma: float = 0.0, seed: int = 5, radius: float = RADIUS
) -> ProbingSet:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.9, 0.9, (len(faces), 3)) * HALF
    for row, face in enumerate(faces):
        axis, sign = face // 2, 1 - 2 * (face % 2)
        points[row, axis] = sign * (HALF[axis] + radius + sigma * rng.normal())
    return probe(surfaces=BLOCK, touched=np.array(faces), centre=apply(T, points), radius=radius)


def step(found: Array) -> Array:
    turn = found[:3, :3] @ T[:3, :3].T
    return np.concatenate([found[:3, 3] - T[:3, 3], rotation_vector_from_matrix(turn)])


def test_exact_touches_give_the_exact_frame_with_a_real_ball() -> None:
    fit = fit_surfaces(touch([0, 2, 4] * 4), START, sigma=0.1 * MM)
    np.testing.assert_allclose(fit.T_base_part, T, atol=1e-12)
    without = probe(
        surfaces=BLOCK, touched=np.array([0, 2, 4] * 4), centre=touch([0, 2, 4] * 4).position
    )
    ignored = fit_surfaces(without, START, sigma=0.1 * MM)
    np.testing.assert_allclose(
        np.linalg.norm(ignored.T_base_part[:3, 3] - T[:3, 3]), RADIUS * np.sqrt(3), rtol=1e-6
    )


def test_covariance_is_what_monte_carlo_finds() -> None:
    sigma = 0.1 * MM
    faces = [0, 2, 4] * 5
    exact = touch(faces)
    fit = fit_surfaces(exact, T, sigma=sigma)
    outward = np.array([BLOCK[f].normal for f in faces]) @ T[:3, :3].T
    rng = np.random.default_rng(6)
    steps = []
    for _ in range(150):
        noisy = probe(
            surfaces=BLOCK,
            touched=exact.touched,
            centre=exact.position + sigma * rng.normal(size=(15, 1)) * outward,
            radius=RADIUS,
        )
        steps.append(step(fit_surfaces(noisy, T, sigma=sigma).T_base_part))
    seen = np.sqrt(np.mean(np.square(steps), axis=0))
    np.testing.assert_allclose(seen, np.sqrt(np.diag(fit.covariance)), rtol=0.18)


def test_sigma_from_residuals_and_one_that_cannot_be() -> None:
    fit = fit_surfaces(touch([0, 2, 4] * 20, sigma=0.2 * MM), START)
    assert fit.sigma == pytest.approx(0.2 * MM, rel=0.2)
    assert fit.rms == pytest.approx(0.2 * MM, rel=0.25)
    with pytest.raises(ShapeError, match="sigma in m is needed"):
        fit_surfaces(touch([0, 0, 0, 2, 2, 4]), START)


def open_motion(faces: list[int]) -> str:
    with pytest.raises(ObservabilityError) as caught:
        fit_surfaces(touch(faces), START, sigma=0.1 * MM)
    return str(caught.value)


def test_a_face_never_touched_leaves_its_shift_open() -> None:
    assert open_motion([0, 2] * 6) == (
        "12 touches do not locate the part. Undetermined, in part axes: shift along (+0.00, +0.00, "
        "+1.00) (free). Allowed is 20 times one touch. Try: probe a face whose normal that motion "
        "changes, far from the others."
    )


def test_one_face_only_leaves_three_motions_open() -> None:
    text = open_motion([0] * 9)
    assert "shift along (+0.00, +1.00, +0.00) (free)" in text
    assert "shift along (+0.00, +0.00, +1.00) (free)" in text
    assert "turn about (+1.00, +0.00, +0.00)" in text


def test_a_turned_part_leaves_its_turn_open() -> None:
    rng = np.random.default_rng(7)
    angle, height = rng.uniform(0, 2 * np.pi, 20), rng.uniform(0, 0.1, 20)
    side = np.stack([0.05 * np.cos(angle), 0.05 * np.sin(angle), height], axis=1)
    top = np.column_stack([rng.uniform(-0.03, 0.03, (6, 2)), np.full(6, 0.1)])
    surfaces = (
        Cylinder(point=np.zeros(3), axis=np.array([0.0, 0.0, 1.0]), radius=0.05),
        Plane(point=np.array([0.0, 0.0, 0.1]), normal=np.array([0.0, 0.0, 1.0])),
    )
    touches = probe(
        surfaces=surfaces,
        touched=np.array([0] * 20 + [1] * 6),
        centre=apply(T, np.vstack([side, top])),
    )
    with pytest.raises(ObservabilityError, match=r"turn about \(\+0\.00, \+0\.00, \+1\.00\)"):
        fit_surfaces(touches, START, sigma=0.1 * MM)


def test_a_boss_and_a_bore_hold_a_plate() -> None:
    rng = np.random.default_rng(8)
    angle = rng.uniform(0, 2 * np.pi, 24)
    height = rng.uniform(-0.02, 0.0, 24)
    place = np.array([[0.0, 0.0, 0.0]] * 12 + [[0.2, 0.0, 0.0]] * 12)
    wide = np.array([0.04 + RADIUS] * 12 + [0.03 - RADIUS] * 12)
    round_points = place + np.stack([wide * np.cos(angle), wide * np.sin(angle), height], axis=1)
    top = np.column_stack([rng.uniform(-0.05, 0.25, (9, 2)), np.full(9, RADIUS)])
    z = np.array([0.0, 0.0, 1.0])
    touches = probe(
        surfaces=(
            Cylinder(point=place[0], axis=z, radius=0.04),
            Cylinder(point=place[-1], axis=z, radius=0.03, hole=True),
            Plane(point=np.zeros(3), normal=z),
        ),
        touched=np.array([0] * 12 + [1] * 12 + [2] * 9),
        centre=apply(T, np.vstack([round_points, top])),
        radius=RADIUS,
    )
    fit = fit_surfaces(touches, START, sigma=0.1 * MM)
    np.testing.assert_allclose(fit.T_base_part, T, atol=1e-9)


def test_too_few_touches_are_refused() -> None:
    with pytest.raises(ObservabilityError, match="5 touches on surfaces"):
        fit_surfaces(touch([0, 0, 0, 2, 2]), START, sigma=0.1 * MM)


def test_three_two_one_lays_the_part_without_a_start() -> None:
    touches = touch([0, 0, 0, 2, 2, 4])
    faces = (BLOCK[0], BLOCK[2], BLOCK[4])
    fit = fit_three_two_one(faces, touches.position, sigma=0.1 * MM, radius=RADIUS)
    np.testing.assert_allclose(fit.T_base_part, T, atol=1e-12)
    assert fit.method == "3-2-1"
    assert fit.degrees_of_freedom == 0
    assert fit.rms < 1e-12


def test_three_two_one_on_other_corners_of_the_block() -> None:
    for faces in ([1, 3, 5], [5, 0, 3], [2, 5, 1]):
        touches = touch([faces[0]] * 3 + [faces[1]] * 2 + [faces[2]])
        planes = tuple(BLOCK[f] for f in faces)
        fit = fit_three_two_one(planes, touches.position, sigma=MM, radius=RADIUS)  # type: ignore[arg-type]
        np.testing.assert_allclose(fit.T_base_part, T, atol=1e-12)


def test_three_two_one_names_what_is_wrong() -> None:
    centre = np.array(touch([0, 0, 0, 2, 2, 4]).position)
    faces = (BLOCK[0], BLOCK[2], BLOCK[4])
    line = centre.copy()
    line[2] = 0.5 * (line[0] + line[1])
    with pytest.raises(ObservabilityError, match="A1, A2, A3 lie on one line"):
        fit_three_two_one(faces, line, sigma=MM)
    same = centre.copy()
    same[4] = same[3]
    with pytest.raises(ObservabilityError, match="B1 and B2 give no direction"):
        fit_three_two_one(faces, same, sigma=MM)
    with pytest.raises(ImplausibleDataError, match="mirror image of the corner"):
        fit_three_two_one((BLOCK[0], BLOCK[2], BLOCK[5]), centre, sigma=MM)
    with pytest.raises(ObservabilityError, match="do not meet in a corner"):
        fit_three_two_one((BLOCK[0], BLOCK[2], BLOCK[1]), centre, sigma=MM)


def test_a_block_turned_by_half_a_turn_is_named_and_a_boss_settles_it() -> None:
    touches = touch([0, 3, 4] * 6, sigma=0.05 * MM)
    fit = fit_surfaces(touches, START, sigma=0.1 * MM)
    others = symmetric_alternatives(touches, touches.position, fit.T_base_part, sigma=0.1 * MM)
    halves = [a for a in others if abs(a.angle - 180.0 * DEG) < DEG]
    assert any(abs(a.axis_in_part[2]) > 0.99 for a in halves)
    assert "the touches do not separate the two" in str(others[0])
    boss = Cylinder(point=np.array([0.1, 0.05, 0.0]), axis=np.array([0.0, 0.0, 1.0]), radius=0.02)
    angle = np.linspace(0.0, 6.0, 6)
    ring = np.stack(
        [
            0.1 + (0.02 + RADIUS) * np.cos(angle),
            0.05 + (0.02 + RADIUS) * np.sin(angle),
            np.full(6, 0.17),
        ],
        axis=1,
    )
    held = probe(
        surfaces=(*BLOCK, boss),
        touched=np.concatenate([touches.touched, np.full(6, 6)]),
        centre=np.vstack([touches.position, apply(T, ring)]),
        radius=RADIUS,
    )
    fit = fit_surfaces(held, START, sigma=0.1 * MM)
    assert not [
        a
        for a in symmetric_alternatives(held, held.position, fit.T_base_part, sigma=0.1 * MM)
        if abs(a.angle - 180.0 * DEG) < DEG and abs(a.axis_in_part[2]) > 0.99
    ]


def test_touches_are_checked() -> None:
    with pytest.raises(ShapeError, match="counted from 0"):
        probe(surfaces=BLOCK, touched=np.array([6]), centre=np.zeros((1, 3)))
    with pytest.raises(ShapeError, match="probe radius"):
        probe(surfaces=BLOCK, touched=np.array([0]), centre=np.zeros((1, 3)), radius=-1.0)
    with pytest.raises(ShapeError, match="normal has length 0"):
        Plane(point=np.zeros(3), normal=np.zeros(3))
    with pytest.raises(ShapeError, match="radius is 0"):
        Cylinder(point=np.zeros(3), axis=np.ones(3), radius=0.0)
