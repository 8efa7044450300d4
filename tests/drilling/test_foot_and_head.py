"""Readings, planes and moves against hand-computed values, and their identities."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.foot import Foot, Skin, plane_under, readings
from robotrue.drilling.head import (
    Head,
    normal_from_tilt,
    rotation,
    squaring_move,
    tilt_between,
    tilt_from_normal,
)
from robotrue.errors import ConfigurationError, ShapeError


def three(skin: Skin | None = None) -> Foot:
    """Three sensors at 60 mm."""
    return Foot(
        radius=np.full(3, 60.0 * MM),
        angle=np.array([90.0, 210.0, 330.0]) * DEG,
        skin=skin or Skin(),
    )


@pytest.mark.parametrize(
    ("a", "b", "h", "expected"),
    [
        (1.0, -0.5, 0.0, (1.047304, -0.977182, -0.070122)),
        (3.0, 2.0, 10.0, (13.144467, 10.244793, 6.610740)),
        (-4.0, 4.0, 0.0, (-4.195609, 5.740181, -1.544572)),
        (0.0, 0.0, 5.0, (5.0, 5.0, 5.0)),
    ],
)
def test_readings_of_known_tilts(a: float, b: float, h: float, expected: tuple[float, ...]) -> None:
    normal = normal_from_tilt("AB", np.array([[a, b]]) * DEG)
    got = readings(three(), normal, np.array([h * MM]))
    np.testing.assert_allclose(got[0] / MM, expected, atol=6e-7)


@pytest.mark.parametrize("order", ["AB", "BA"])
def test_the_inverse_gives_the_tilt_back_to_rounding(order: str) -> None:
    tilt = np.random.default_rng(1).uniform(-8.0, 8.0, (500, 2)) * DEG
    normal = normal_from_tilt(order, tilt)  # type: ignore[arg-type]
    plane = plane_under(three(), readings(three(), normal, np.full(500, 3.0 * MM)))
    back = tilt_from_normal(order, plane.normal)  # type: ignore[arg-type]
    np.testing.assert_allclose(back, tilt, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(plane.height, 3.0 * MM, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(
        rotation(order, tilt)[:, :, 2],  # type: ignore[arg-type]
        normal,
        rtol=0.0,
        atol=1e-15,
    )


def test_scatter_of_the_tilt_is_that_of_the_readings_over_the_radius() -> None:
    foot = three()
    expected = np.sqrt(2.0 / 3.0) / foot.radius[0] * foot.reading_sigma
    sigma = np.sqrt(np.diag(plane_under(foot, np.zeros((1, 3))).slope_covariance))
    np.testing.assert_allclose(sigma, expected, rtol=1e-12)
    assert expected / DEG / (foot.reading_sigma / UM) == pytest.approx(0.00077970, abs=5e-9)


@pytest.mark.parametrize(
    "skin", [Skin(kind="sphere", radius=np.nan), Skin(kind="sphere", radius=2.0)]
)
def test_a_curved_skin_does_not_tilt_a_lopsided_foot(skin: Skin) -> None:
    radius = np.array([60.0, 60.0, 60.0, 30.0, 45.0]) * MM
    angle = np.array([90.0, 210.0, 330.0, 40.0, 160.0]) * DEG
    curved = Foot(radius=radius, angle=angle, skin=Skin(kind="sphere", radius=2.0))
    normal = normal_from_tilt("AB", np.array([[1.0, -2.0]]) * DEG)
    d = readings(curved, normal, np.array([1.0 * MM]))
    seen = plane_under(Foot(radius=radius, angle=angle, skin=skin), d)
    np.testing.assert_allclose(seen.normal, normal, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(seen.curvature, 0.5, rtol=1e-9)
    flat = plane_under(Foot(radius=radius, angle=angle), d)
    assert tilt_between(flat.normal, normal)[0] > 0.05 * DEG


def test_the_skin_falls_away_where_the_radius_is_positive() -> None:
    foot = three(Skin(kind="cylinder", radius=1.5, axis=0.0))
    d = readings(foot, np.array([[0.0, 0.0, 1.0]]), np.zeros(1))
    np.testing.assert_allclose(d[0], foot.seat[:, 1] ** 2 / 3.0, rtol=1e-12)


def test_sensors_on_a_line_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="one line"):
        Foot(radius=np.array([10.0, 20.0, 30.0]) * MM, angle=np.zeros(3))


def test_curvature_needs_a_fourth_sensor() -> None:
    with pytest.raises(ConfigurationError, match="3 sensors for 4 unknowns"):
        three(Skin(kind="sphere", radius=np.nan))


@pytest.mark.parametrize(
    ("order", "before", "after", "expected"),
    [
        ("AB", (0.0, 0.0), (2.0, -1.5), (-9.161932, -12.210638, -0.333074)),
        ("BA", (0.0, 0.0), (2.0, -1.5), (-9.156351, -12.214824, -0.333074)),
        ("AB", (1.0, 2.0), (-3.0, 0.5), (-9.160536, 24.421508, -0.226487)),
    ],
)
def test_moves_of_the_linear_axes(
    order: str, before: tuple[float, float], after: tuple[float, float], expected: tuple[float, ...]
) -> None:
    head = Head(order=order, p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)  # type: ignore[arg-type]
    now, then = np.array(before) * DEG, np.array(after) * DEG
    normal = rotation(head.order, now).T @ normal_from_tilt(head.order, then)
    move = squaring_move(head, now, normal)
    np.testing.assert_allclose(move.shift / MM, expected, atol=6e-7)
    np.testing.assert_allclose(move.axes, then, atol=1e-15)


@pytest.mark.parametrize("order", ["AB", "BA"])
def test_the_tip_stays_and_the_spindle_stands_on_the_normal(order: str) -> None:
    random = np.random.default_rng(2)
    head = Head(
        order=order,  # type: ignore[arg-type]
        p_pivot_tip=np.array([12.0, -7.0, -350.0]) * MM,
        sense=(1.0, -1.0),
    )
    sense = np.array(head.sense)
    for _ in range(50):
        now = random.uniform(-5.0, 5.0, 2) * DEG
        normal = normal_from_tilt("AB", random.uniform(-5.0, 5.0, 2) * DEG)
        move = squaring_move(head, now, normal)
        before, after = rotation(head.order, sense * now), rotation(head.order, sense * move.axes)
        tip = move.shift + after @ head.p_pivot_tip
        np.testing.assert_allclose(tip, before @ head.p_pivot_tip, rtol=0.0, atol=3e-16)
        np.testing.assert_allclose(after[:, 2], before @ normal, rtol=0.0, atol=1e-15)


def test_a_normal_behind_the_foot_is_refused() -> None:
    with pytest.raises(ShapeError, match="behind the foot"):
        tilt_from_normal("AB", np.array([0.0, 0.0, -1.0]))
