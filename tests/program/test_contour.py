"""The largest contour: outlines against shadows, and the filter against a truth made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import binary_fill_holes

from robotrue.core.arrays import Array
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, ShapeError
from robotrue.program.contour import contour_of, keep_inside, side_direction
from robotrue.program.outline import area, distance, inside, outer_boundaries
from robotrue.program.toolpath import Remark, Toolpath

QUADS = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def block(low, high) -> tuple[Array, Array]:
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    vertices = np.asarray(low) + corners * (np.asarray(high) - np.asarray(low))
    faces = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces)


def joined(*parts: tuple[Array, Array]) -> TriangleMesh:
    start = np.cumsum([0, *(len(v) for v, _ in parts[:-1])])
    return TriangleMesh(
        vertices=np.concatenate([v for v, _ in parts]),
        faces=np.concatenate([f + s for (_, f), s in zip(parts, start, strict=True)]),
    )


def ring(around: int = 24, across: int = 12) -> TriangleMesh:
    """A torus: radius 100 mm, tube 30 mm, axis z."""
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    r = 0.1 + 0.03 * np.cos(b)
    vertices = np.stack([r * np.cos(a), r * np.sin(a), 0.03 * np.sin(b)], axis=-1).reshape(-1, 3)

    def index(i: int, j: int) -> int:
        return (i % around) * across + j % across

    faces = []
    for i in range(around):
        for j in range(across):
            p, q, s, t = index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)
            faces += [(p, q, s), (p, s, t)]
    return TriangleMesh(vertices=vertices, faces=np.array(faces))


def lumps() -> TriangleMesh:
    """A ball whose radius waves, so that its shadow's rim is folded."""
    mesh = ring(24, 24)
    v = mesh.vertices
    wave = 1.0 + 0.15 * np.sin(60 * v[:, 0]) * np.cos(70 * v[:, 1]) + 0.2 * np.sin(80 * v[:, 2])
    return TriangleMesh(vertices=v * wave[:, None], faces=mesh.faces)


def in_shadow(mesh: TriangleMesh, across: Array, points: Array) -> Array:
    """Which points of the plane some triangle covers, one triangle at a time."""
    corners = (mesh.vertices @ across.T)[mesh.faces]
    hit = np.zeros(len(points), dtype=bool)
    for a, b, c in corners:
        side = [
            (q[0] - p[0]) * (points[:, 1] - p[1]) - (q[1] - p[1]) * (points[:, 0] - p[0])
            for p, q in ((a, b), (b, c), (c, a))
        ]
        hit |= (np.min(side, axis=0) > 0.0) | (np.max(side, axis=0) < 0.0)
    return hit


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0.8, 1), (1, 0.2, 0.1), (0.3, -0.5, -0.7)])
@pytest.mark.parametrize("shape", [ring, lumps])
def test_the_outline_is_the_outer_boundary_of_the_shadow(shape, direction):
    mesh = shape()
    contour = contour_of(mesh, np.array(direction))
    assert len(contour.outlines) == 1
    ticks = np.linspace(-0.16, 0.16, 49) + 0.000123  # off the edges of triangles
    flat = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    shadow = in_shadow(mesh, contour.across, flat)
    filled = binary_fill_holes(shadow.reshape(49, 49)).ravel()  # holes count as inside
    off = contour.outside_by(flat @ contour.across)
    assert not (shadow & (off > 0.0)).any()
    clear = np.abs(off) > 0.007  # a cell from the line
    assert (filled == (off < 0.0))[clear].all()
    assert (filled & clear).sum() > 100
    assert (~filled & clear).sum() > 500


def test_a_hole_through_the_part_lies_inside_its_contour():
    contour = contour_of(ring(96, 24), np.array([0.0, 0.0, 1.0]))
    assert contour.keeps(np.zeros((1, 3)))[0]
    assert area(contour.outlines[0]) == pytest.approx(np.pi * 0.13**2, rel=2e-3)
    assert contour.top == pytest.approx(0.03)


def test_the_contour_is_the_largest_over_all_depths():
    """A small block on a large plate that overhangs: seen from either side the plate counts."""
    mesh = joined(
        block([0, 0, 0], [0.02, 0.02, 0.1]), block([-0.05, -0.05, 0.04], [0.1, 0.1, 0.06])
    )
    for direction in ([0, 0, 1.0], [0, 0, -1.0]):
        contour = contour_of(mesh, np.array(direction))
        assert [round(area(o), 9) for o in contour.outlines] == [pytest.approx(0.15**2)]


def test_two_bodies_have_a_contour_each():
    mesh = joined(block([0, 0, 0], [0.1, 0.1, 0.1]), block([0.2, 0, 0], [0.3, 0.1, 0.1]))
    contour = contour_of(mesh, np.array([0.0, 0.0, 2.0]))
    assert len(contour.outlines) == 2
    assert contour.keeps(
        np.array([[0.05, 0.05, 9.0], [0.15, 0.05, 0], [0.25, 0.05, 0]])
    ).tolist() == [
        True,
        False,
        True,
    ]


def test_distances_are_signed_and_a_margin_widens():
    contour = contour_of(joined(block([0, 0, 0], [0.1, 0.2, 0.1])), np.array([0.0, 0.0, 1.0]))
    points = np.array([[0.05, 0.1, 0.3], [0.13, 0.1, 0.0], [-0.03, -0.04, 0.0]])
    np.testing.assert_allclose(contour.outside_by(points), [-0.05, 0.03, 0.05], atol=1e-12)
    assert contour.keeps(points, margin=0.04).tolist() == [True, True, False]


def test_distances_within_a_band_are_those_of_all_edges():
    turn = np.linspace(0, 2 * np.pi, 400)[:-1]
    wavy = np.stack([np.cos(turn), np.sin(turn)], axis=1) * (1 + 0.1 * np.sin(40 * turn))[:, None]
    points = np.random.default_rng(2).uniform(-1.3, 1.3, (1500, 2))
    every = distance(wavy, points)
    start, along = wavy, np.roll(wavy, -1, axis=0) - wavy
    apart = points[:, None] - start
    share = np.clip((apart * along).sum(2) / (along**2).sum(1), 0, 1)
    truth = np.linalg.norm(apart - share[..., None] * along, axis=2).min(axis=1)
    np.testing.assert_allclose(every, truth, atol=1e-12)
    near = distance(wavy, points, within=0.05)
    np.testing.assert_array_equal(np.isfinite(near), every <= 0.05)
    np.testing.assert_allclose(near[np.isfinite(near)], every[every <= 0.05])


def test_points_on_the_contour_are_kept():
    contour = contour_of(PLATE, np.array([0.0, 0.0, 1.0]))
    rim = np.array([[0, 0.05, 0], [0.1, 0.05, 0], [0.05, 0, 0], [0.05, 0.1, 0], [0.1, 0.1, 0]])
    assert contour.keeps(rim).all()
    assert not contour.keeps(1.001 * rim[1:]).all()
    assert not contour.keeps(rim + np.array([0.0, 0.2, 0.0])).any()


def test_a_drawing_with_crossings_overlaps_and_a_dead_end():
    cross = np.array(
        [
            [[0, 0], [2, 0]], [[2, 0], [2, 2]], [[2, 2], [0, 2]], [[0, 2], [0, 0]],  # a square
            [[1, 1], [3, 1]], [[3, 1], [3, 3]], [[3, 3], [1, 3]], [[1, 3], [1, 1]],  # over it
            [[1, 0], [1.5, 0]],  # lies on an edge
            [[3, 2], [4, 2]],  # sticks out
            [[0.2, 0.2], [0.4, 0.2]], [[0.4, 0.2], [0.3, 0.4]], [[0.3, 0.4], [0.2, 0.2]],  # inside
        ],
        dtype=float,
    )  # fmt: skip
    loops = outer_boundaries(cross)
    assert len(loops) == 1
    assert area(loops[0]) == pytest.approx(7.0)
    probe = np.array([[0.5, 0.5], [2.5, 0.5], [2.5, 2.5], [0.5, 2.5], [1.5, 1.5]])
    assert inside(loops[0], probe).tolist() == [True, False, True, False, True]
    assert distance(loops[0], np.array([[2.5, 0.5]]))[0] == pytest.approx(0.5)


def path(points, rapid, **changes) -> Toolpath:
    n = len(points)
    values = {
        "name": "side",
        "source": "side.apt",
        "position": np.array(points, dtype=float) * MM,
        "axis": np.tile([0.0, 0.0, 1.0], (n, 1)),
        "feed": np.full(n, 0.01),
        "rapid": np.array(rapid, dtype=bool),
        "line": np.arange(1, n + 1),
        "operation": np.zeros(n, dtype=int),
        "operations": ("one",),
    }
    return Toolpath(**(values | changes))


PLATE = joined(block([0, 0, 0], [0.1, 0.1, 0.02]))


def test_points_outside_are_dropped_and_lifts_mended():
    """Two lines across a 100 mm plate; the CAM system flies at z = 50 mm."""
    side = path(
        [
            (-20, 20, 50), (-20, 20, 10),  # plunges outside: both go
            (10, 20, 10), (90, 20, 10),  # stays
            (120, 20, 10),  # outside
            (120, 20, 50), (120, 40, 50), (120, 40, 10),  # its lift
            (80, 40, 10), (50, 40, 10),  # stays
            (50, 40, 50), (50, 60, 50), (50, 60, 10),  # a lift inside: untouched
            (20, 60, 10),  # stays
            (-20, 60, 10), (-20, 60, 50),  # leaves
        ],
        [1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1],
        remarks=(Remark(before=4, line=99, text="COOLNT/OFF"),),
    )  # fmt: skip
    kept = keep_inside(side, contour_of(PLATE, side_direction(side)))
    truth = [
        (10, 20, 50), (10, 20, 10), (90, 20, 10), (90, 20, 50),
        (80, 40, 50), (80, 40, 10), (50, 40, 10),
        (50, 40, 50), (50, 60, 50), (50, 60, 10), (20, 60, 10), (20, 60, 50),
    ]  # fmt: skip
    np.testing.assert_allclose(kept.position / MM, truth, atol=1e-9)
    assert kept.rapid.astype(int).tolist() == [1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1]
    assert kept.line.tolist() == [3, 3, 4, 4, 9, 9, 10, 11, 12, 13, 14, 14]
    assert kept.remarks[0].before == 4  # before the next cut that is left
    assert kept.notes == (
        "side.apt: 6 of 10 cutting points lie inside the largest contour; 4 were dropped and 2 "
        "lifts made.",
    )


def test_a_path_inside_stays_as_it_is():
    side = path([(10, 10, 50), (10, 10, 5), (90, 90, 5), (90, 90, 50)], [1, 0, 0, 1])
    kept = keep_inside(side, contour_of(PLATE, side_direction(side)))
    np.testing.assert_array_equal(kept.position, side.position)
    np.testing.assert_array_equal(kept.rapid, side.rapid)


def test_without_rapid_points_lifts_clear_part_and_path():
    side = path([(10, 10, 5), (150, 10, 5), (90, 90, 5)], [0, 0, 0])
    kept = keep_inside(side, contour_of(PLATE, side_direction(side)), clearance=0.015)
    np.testing.assert_allclose(
        kept.position / MM, [(10, 10, 5), (10, 10, 35), (90, 90, 35), (90, 90, 5)], atol=1e-9
    )


def test_low_rapid_points_do_not_keep_lifts_low():
    side = path([(10, 10, 8), (10, 10, 5), (150, 10, 5), (90, 90, 5)], [1, 0, 0, 0])
    kept = keep_inside(side, contour_of(PLATE, side_direction(side)))
    assert kept.position[2, 2] == pytest.approx(30 * MM)  # 10 mm over the plate


def test_a_tilted_tool_is_lifted_along_its_axis():
    tilted = np.array([0.0, np.sin(0.3), np.cos(0.3)])
    side = path([(50, 50, 80), (50, 50, 0), (150, 50, 0)], [1, 0, 0], axis=np.tile(tilted, (3, 1)))
    kept = keep_inside(side, contour_of(PLATE, side_direction(side)))
    way = kept.position[-1] - kept.position[-2]
    np.testing.assert_allclose(way / np.linalg.norm(way), tilted, atol=1e-12)
    height = side.position @ tilted
    assert kept.position[-1] @ tilted == pytest.approx(height[0])


def test_a_part_in_another_place_or_unit_is_told():
    side = path([(210, 10, 5), (250, 10, 5)], [0, 0])
    with pytest.raises(
        ImplausibleDataError, match=r"the nearest is 110\.000 mm outside"
    ) as refused:
        keep_inside(side, contour_of(PLATE, side_direction(side)))
    assert refused.value.source == "side.apt"
    assert "same frame and unit" in str(refused.value)


def test_a_path_of_several_sides_has_no_one_contour():
    axes = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 1.0, 0]])
    side = path([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [0, 0, 0], axis=axes)
    with pytest.raises(ImplausibleDataError, match=r"side\.apt:3: .* off the mean"):
        side_direction(side)
    with pytest.raises(ImplausibleDataError, match="no move of the tool path cuts"):
        side_direction(path([(0, 0, 0)], [1]))


def test_a_mesh_with_holes_has_no_contour():
    vertices, faces = block([0, 0, 0], [0.1, 0.1, 0.1])
    with pytest.raises(ImplausibleDataError, match="3 edges of the mesh"):
        contour_of(TriangleMesh(vertices=vertices, faces=faces[1:]), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(ShapeError, match="direction has length 0"):
        contour_of(PLATE, np.zeros(3))
