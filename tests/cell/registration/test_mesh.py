"""Meshes: the nearest point is exact, a free-form part is found, a bad file is named."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.registration.ambiguity import symmetric_alternatives
from robotrue.cell.registration.fit import Noise, Registration, displace_frame
from robotrue.cell.registration.touches import fit_all_touches, fit_touches
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose_from_xyz_abc
from robotrue.core.surfaces import TriangleMesh, read_mesh
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, ImplausibleDataError, MissingExtraError, ShapeError
from robotrue.measurement.probing_set import ProbingSet

T = pose_from_xyz_abc(np.array([1.0, 0.2, 0.6]), np.array([0.4, 0.1, -0.8]))
BOX = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * [0.2, 0.1, 0.15]
# Corner i has x, y, z from bits 2, 1, 0; two triangles a face, counter-clockwise from outside.
_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX_FACES = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))])


def on_mesh(mesh: TriangleMesh, centre: Array, *, radius: float = 0.0) -> ProbingSet:
    return ProbingSet(
        names=tuple(str(i + 1) for i in range(len(centre))),
        point=np.zeros((len(centre), 3)),
        position=centre,
        surfaces=(mesh,),
        touched=np.zeros(len(centre), dtype=np.int64),
        radius=radius,
    )


def fit_surfaces(touches: ProbingSet, start: Array, *, sigma: float) -> Registration:
    return fit_all_touches(touches, touches.position, sigma=sigma, start=start)


def box() -> TriangleMesh:
    return TriangleMesh(vertices=BOX, faces=BOX_FACES)


def free_form(n: int = 28) -> TriangleMesh:
    """A lumpy closed surface, about 400 x 200 x 300 mm, with no symmetry."""
    polar, turn = np.meshgrid(
        np.linspace(0, np.pi, n + 1)[1:-1],
        np.linspace(0, 2 * np.pi, 2 * n, endpoint=False),
        indexing="ij",
    )
    ring = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    unit = np.vstack([ring, [[0, 0, 1], [0, 0, -1]]])
    x, y, z = unit.T
    size = 1 + 0.2 * x * y + 0.25 * x**3 + 0.15 * np.sin(3 * z) + 0.1 * np.cos(4 * y) * z
    faces = []
    for i in range(n - 2):
        for j in range(2 * n):
            a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
            faces += [(a, a + 2 * n, b + 2 * n), (a, b + 2 * n, b)]
    north, south, last = len(ring), len(ring) + 1, (n - 2) * 2 * n
    for j in range(2 * n):
        k = (j + 1) % (2 * n)
        faces += [(north, j, k), (south, last + k, last + j)]
    return TriangleMesh(vertices=unit * size[:, None] * [0.2, 0.1, 0.15], faces=np.array(faces))


def touched(mesh: TriangleMesh, n: int, seed: int, radius: float, sigma: float) -> Array:
    """Probe centres (n, 3) m in base on the half of the part that faces +y."""
    rng = np.random.default_rng(seed)
    seen = np.flatnonzero(mesh.normals[:, 1] > -0.1)
    face = rng.choice(seen, n, replace=False)
    offset = radius + sigma * rng.normal(size=(n, 1))
    return apply(T, mesh.vertices[mesh.faces[face]].mean(axis=1) + offset * mesh.normals[face])


def test_nearest_point_of_a_box_is_the_clamped_one() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.4, 0.4, (300, 3))
    half = np.array([0.2, 0.1, 0.15])
    outside = (np.abs(points) > half).any(axis=1)
    nearest, _ = box().nearest_points(points[outside])
    np.testing.assert_allclose(nearest, np.clip(points[outside], -half, half), atol=1e-12)
    distance, normal = box().nearest(points)
    inner = (half - np.abs(points[~outside])).min(axis=1)
    np.testing.assert_allclose(distance[~outside], -inner, atol=1e-12)
    clamped = np.linalg.norm(points - np.clip(points, -half, half), axis=1)
    np.testing.assert_allclose(distance[outside], clamped[outside], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)


def test_nearest_agrees_with_every_triangle_looked_at() -> None:
    mesh = free_form(12)
    points = np.random.default_rng(2).uniform(-0.3, 0.3, (50, 3))
    found = np.linalg.norm(points - mesh.nearest_points(points)[0], axis=1)
    # Dense barycentric samples bound the true distance from above.
    share = np.array([(i, j, 20 - i - j) for i in range(21) for j in range(21 - i)]) / 20
    samples = np.einsum("sk,fkd->fsd", share, mesh.vertices[mesh.faces]).reshape(-1, 3)
    dense = np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])
    assert (found <= dense + 1e-12).all()
    np.testing.assert_allclose(found, dense, atol=1.5 * MM)


def test_the_normal_is_the_gradient_of_the_distance() -> None:
    mesh = free_form(12)
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.3, 0.3, (40, 3))
    distance, normal = mesh.nearest(points)
    step = 1e-6 * rng.normal(size=(40, 3))
    change = mesh.nearest(points + step)[0] - distance
    clear = np.abs(distance) > 5 * MM
    np.testing.assert_allclose(change[clear], (step * normal).sum(axis=1)[clear], atol=1e-9)


@pytest.mark.parametrize(("angle_deg", "shift_mm"), [(3.0, 6.0), (25.0, 50.0)])
def test_point_to_plane_finds_a_free_form_part(angle_deg: float, shift_mm: float) -> None:
    mesh = free_form()
    rng = np.random.default_rng(4)
    for seed in range(5):
        step = rng.normal(size=(2, 3))
        step /= np.linalg.norm(step, axis=1)[:, None]
        start = displace_frame(
            T, np.concatenate([step[0] * shift_mm * MM, step[1] * angle_deg * DEG])
        )
        touches = on_mesh(mesh, touched(mesh, 30, seed, 3 * MM, 0.0), radius=3 * MM)
        fit = fit_surfaces(touches, start, sigma=0.1 * MM)
        np.testing.assert_allclose(fit.T_base_part, T, atol=1e-6)


def test_a_start_too_far_off_shows_in_the_misfit() -> None:
    mesh = free_form()
    start = displace_frame(T, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.5]))
    touches = on_mesh(mesh, touched(mesh, 30, 1, 3 * MM, 0.1 * MM), radius=3 * MM)
    assert fit_surfaces(touches, T, sigma=0.1 * MM).misfit == pytest.approx(1.0, abs=0.4)
    assert fit_surfaces(touches, start, sigma=0.1 * MM).misfit > 10.0


def test_noise_on_a_free_form_part_is_as_the_covariance_says() -> None:
    mesh = free_form()
    sigma = 0.1 * MM
    grid = mesh.vertices[::10]
    errors, stated = [], []
    for seed in range(12):
        touches = on_mesh(mesh, touched(mesh, 100, seed, 3 * MM, sigma), radius=3 * MM)
        fit = fit_surfaces(touches, T, sigma=sigma)
        errors.append(np.linalg.norm(apply(fit.T_base_part, grid) - apply(T, grid), axis=1))
        lever = grid @ T[:3, :3].T
        rows = np.concatenate(
            [np.broadcast_to(np.eye(3), (len(grid), 3, 3)), -_skew(lever)], axis=2
        )
        stated.append(np.trace(rows @ fit.covariance @ rows.transpose(0, 2, 1), axis1=1, axis2=2))
    seen = np.sqrt(np.mean(np.square(errors)))
    assert seen == pytest.approx(np.sqrt(np.mean(stated)), rel=0.3)
    assert seen < 0.1 * MM


def _skew(v: Array) -> Array:
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=1).reshape(-1, 3, 3)


def test_a_wrong_touch_on_a_mesh_is_named() -> None:
    mesh = free_form()
    centre = touched(mesh, 40, 9, 3 * MM, 0.1 * MM)
    centre[[4, 17]] += 6 * MM
    start = displace_frame(T, np.array([3 * MM, -3 * MM, 3 * MM, 0.03, 0.02, -0.03]))
    fit = fit_touches(
        on_mesh(mesh, centre, radius=3 * MM),
        centre,
        start=start,
        noise=Noise(touch=0.1 * MM, robot=0.1 * MM),
    )
    assert fit.outliers == ("5", "18")
    grid = mesh.vertices
    off = np.linalg.norm(apply(fit.T_base_part, grid) - apply(T, grid), axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.25 * MM


def test_a_block_looks_the_same_after_half_a_turn_but_not_after_a_quarter() -> None:
    rng = np.random.default_rng(5)
    half = np.array([0.2, 0.1, 0.15])
    points = rng.uniform(-0.9, 0.9, (18, 3)) * half
    for row in range(18):
        points[row, row % 3] = half[row % 3]
    touches = on_mesh(box(), apply(T, points))
    fit = fit_surfaces(
        touches, displace_frame(T, np.array([0, 0, 0, 0.02, 0.02, 0])), sigma=0.1 * MM
    )
    np.testing.assert_allclose(fit.T_base_part, T, atol=1e-9)
    found = symmetric_alternatives(touches, touches.position, fit.T_base_part, sigma=0.1 * MM)
    assert sorted(round(a.angle / DEG) for a in found) == [180, 180, 180]


def test_bad_triangles_are_named() -> None:
    with pytest.raises(ShapeError, match="0 triangles"):
        TriangleMesh(vertices=BOX, faces=np.empty((0, 3), dtype=np.int64))
    with pytest.raises(ImplausibleDataError, match="the first is number 0"):
        TriangleMesh(vertices=BOX, faces=np.array([[0, 0, 1], [0, 1, 2]]))
    assert box().open_edges == 0
    assert TriangleMesh(vertices=BOX, faces=BOX_FACES[1:]).open_edges == 3


def stl(path: Path, faces: Array) -> Path:
    lines = ["solid box"]
    for face in faces:
        corners = BOX[face] / MM
        n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        n = n / np.linalg.norm(n)
        lines.append(f"facet normal {n[0]} {n[1]} {n[2]}\nouter loop")
        lines += [f"vertex {p[0]} {p[1]} {p[2]}" for p in corners]
        lines.append("endloop\nendfacet")
    path.write_text("\n".join([*lines, "endsolid box\n"]))
    return path


def test_an_stl_in_millimetres_is_read(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    mesh = read_mesh(stl(tmp_path / "box.stl", BOX_FACES))
    points = np.random.default_rng(6).uniform(-0.4, 0.4, (50, 3))
    np.testing.assert_allclose(mesh.nearest(points)[0], box().nearest(points)[0], atol=1e-9)
    inside_out = read_mesh(stl(tmp_path / "turned.stl", BOX_FACES[:, ::-1]))
    np.testing.assert_allclose(inside_out.nearest(points)[0], box().nearest(points)[0], atol=1e-9)


def test_a_mesh_with_a_hole_or_no_mesh_is_named(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    with pytest.raises(ImplausibleDataError, match="4 open edges, a hole; the first is at"):
        read_mesh(stl(tmp_path / "open.stl", BOX_FACES[:-2]))
    broken = tmp_path / "broken.stl"
    broken.write_bytes(b"nothing of the kind")
    with pytest.raises(FormatError):
        read_mesh(broken)
    with pytest.raises(FormatError):
        read_mesh(tmp_path / "absent.stl")


def test_without_trimesh_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingExtraError, match=r"robotrue\[mesh\]"):
        read_mesh(stl(tmp_path / "box.stl", BOX_FACES))
