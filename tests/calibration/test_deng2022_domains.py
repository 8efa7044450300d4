from __future__ import annotations

import numpy as np
import pytest

from robotrue.calibration.deng2022.domains import (
    check_overlap,
    divide_target,
    mapped_pairs,
    members,
    overlap_members,
    turned_features,
)
from robotrue.calibration.deng2022.readings import RULES
from robotrue.core.regions import CylinderRegion, corners, points_at
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.planning.hierarchical_plan import (
    hierarchical_sample,
    target_counts,
    target_images,
)

LIMITS = {"radius": (0.8, 1.4), "height": (0.7, 1.2)}
SOURCE = CylinderRegion(angle=(-40 * DEG, -30 * DEG), **LIMITS)
TARGET = CylinderRegion(angle=(-30 * DEG, 40 * DEG), **LIMITS)
STEPS = (
    np.arange(-15, 16, 15) * DEG,
    np.arange(-10, 11, 5) * DEG,
    np.arange(-10.0, 10.1, 2.5) * DEG,
)


@pytest.fixture
def source():
    rng = np.random.default_rng(1)
    place, turn = hierarchical_sample(SOURCE, (3, 7, 6), STEPS, rng)
    return np.column_stack([points_at(SOURCE, place), turn])


def test_sub_spaces_have_the_sources_width_and_fill_the_target():
    domains = divide_target(SOURCE, TARGET, 5)
    angles = np.array([s.angle for s in domains.sub_spaces]) / DEG
    np.testing.assert_allclose(angles, [(-30, -20), (-15, -5), (0, 10), (15, 25), (30, 40)])
    np.testing.assert_allclose(domains.angles / DEG, [10, 25, 40, 55, 70])
    assert domains.overlap == pytest.approx(-5 * DEG)
    assert divide_target(SOURCE, TARGET, 9).overlap > 0.0
    middle = divide_target(SOURCE, TARGET, 1).sub_spaces[0].angle
    np.testing.assert_allclose(np.array(middle) / DEG, [0, 10])


def test_domains_that_do_not_map_are_refused():
    low = CylinderRegion(angle=TARGET.angle, radius=(0.8, 1.4), height=(0.6, 1.1))
    with pytest.raises(ConfigurationError, match="only turns"):
        divide_target(SOURCE, low, 5)
    with pytest.raises(ConfigurationError, match="spans 10 deg, the target only 5 deg"):
        divide_target(SOURCE, CylinderRegion(angle=(0.0, 5 * DEG), **LIMITS), 1)


def test_positions_are_complete_and_attitudes_drawn_without_repeats(source):
    assert source.shape == (126, 6)
    assert len(np.unique(source[:, :3].round(9), axis=0)) == 126
    assert len(np.unique(source[:, 3:].round(9), axis=0)) == 126  # of 3 x 5 x 9 = 135
    assert set((source[:, 3] / DEG).round(6)) == {-15.0, 0.0, 15.0}
    many, turns = hierarchical_sample(TARGET, (9, 7, 6), STEPS, np.random.default_rng(1))
    counts = np.unique(turns.round(9), axis=0, return_counts=True)[1]
    assert (counts.min(), counts.max(), len(many)) == (2, 3, 378)


def test_farther_sub_spaces_get_more_poses_only_when_asked_for():
    domains = divide_target(SOURCE, TARGET, 5)
    assert target_counts(domains, 80).tolist() == [16] * 5
    more = target_counts(domains, 80, further=1.0)
    assert more.sum() == 80
    assert (np.diff(more) >= 0).all()
    assert more[-1] == pytest.approx(2 * more[0], abs=1)
    with pytest.raises(ConfigurationError, match="4 target poses for 5 sub-spaces"):
        target_counts(domains, 4)


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_picks_different_source_poses_and_maps_back_to_them(source, rule):
    domains = divide_target(SOURCE, TARGET, 5)
    rng = np.random.default_rng(4)
    images = target_images(domains, source, target_counts(domains, 80), rng, rule=rule)
    assert [len(set(rows)) for rows in images] == [16] * 5
    target = np.concatenate(
        [
            turned_features(source[rows], angle, "turning")
            for rows, angle in zip(images, domains.angles, strict=True)
        ]
    )
    for j, rows in enumerate(images):
        pairs = mapped_pairs(domains, j, source, target, "turning", exact=True)
        np.testing.assert_array_equal(pairs.source, rows)
        np.testing.assert_array_equal(pairs.target, np.arange(16 * j, 16 * j + 16))
        assert pairs.distance.max() < 1e-9


def test_rule_3_takes_corners_extremes_and_the_boundary(source):
    domains = divide_target(SOURCE, TARGET, 5)
    errors = np.random.default_rng(6).normal(size=(126, 3))
    counts = np.full(5, 14)
    for rule in ("corners", "boundary"):
        rng = np.random.default_rng(4)
        rows = set(target_images(domains, source, counts, rng, rule=rule, errors=errors)[0])
        assert rows >= {*errors.argmin(axis=0), *errors.argmax(axis=0)}
        for corner in corners(SOURCE):
            assert np.linalg.norm(source[sorted(rows), :3] - corner, axis=1).min() < 1e-9
    rng = np.random.default_rng(4)
    rows = target_images(domains, source, np.full(5, 60), rng, rule="boundary")[0]
    radius, height = np.hypot(source[rows, 0], source[rows, 1]), source[rows, 2]
    angle = np.arctan2(source[rows, 1], source[rows, 0])
    values = np.column_stack([angle, radius, height])
    assert (np.abs(values[:, :, None] - SOURCE.limits).min(axis=(1, 2)) < 1e-9).all()


def test_poses_that_are_no_image_are_paired_or_refused(source):
    domains = divide_target(SOURCE, TARGET, 5)
    target = turned_features(source[:4], 10 * DEG, "turning")
    target[:, 2] += 0.004
    pairs = mapped_pairs(domains, 0, source, target, "turning")
    np.testing.assert_array_equal(pairs.source, [0, 1, 2, 3])
    np.testing.assert_allclose(pairs.distance, 0.004, rtol=1e-9)
    with pytest.raises(ObservabilityError, match="4 mm from the image of any source pose"):
        mapped_pairs(domains, 0, source, target, "turning", exact=True)
    with pytest.raises(ObservabilityError, match="no target pose in sub-space 3, angles 0 to 10"):
        mapped_pairs(domains, 2, source, target, "turning")


def test_rule_4_no_overlap_with_attitudes_and_three_shared_data_without(source):
    apart, lapped = divide_target(SOURCE, TARGET, 5), divide_target(SOURCE, TARGET, 9)
    everywhere = np.concatenate([turned_features(source, a, "turning") for a in lapped.angles])
    check_overlap(apart, everywhere)
    with pytest.raises(
        ConfigurationError, match=r"overlap by 2\.5 deg although the attitudes vary"
    ):
        check_overlap(lapped, everywhere)
    still = everywhere.copy()
    still[:, 3:] = 0.0
    check_overlap(lapped, still)
    with pytest.raises(ConfigurationError, match="must share 3 data or more"):
        check_overlap(apart, still)
    assert members(lapped, still[:, :3]).sum(axis=0).max() == 2
    assert overlap_members(lapped, still[:, :3]).any()
    assert not overlap_members(apart, still[:, :3]).any()
