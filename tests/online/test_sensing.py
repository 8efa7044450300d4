"""The estimator: right in closed form, the same however it is cut, marked where it cannot know."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sensing_cases import cutting, forces, models, part, still

from robotrue.online.estimates import Doubt
from robotrue.online.sensing import Sensing

FIELDS = ("host_time", "error", "sd", "static", "wrench", "joints", "sequence", "doubt")


def estimated(sensing, block, cuts=()):
    edges = [0, *cuts, len(block)]
    parts = [sensing.force(part(block, slice(a, b))) for a, b in pairwise(edges)]
    return {name: np.concatenate([getattr(p, name) for p in parts]) for name in FIELDS}


def same(one, two):
    for name in FIELDS:
        np.testing.assert_array_equal(one[name], two[name], err_msg=name)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 1999), max_size=8, unique=True), st.integers(1, 600))
def test_any_cut_gives_the_same_bits(cuts, at):
    block, joints = forces(cutting(0.4)), still(1.0)
    whole, pieces = Sensing(models()), Sensing(models())
    whole.joints(joints)
    pieces.joints(part(joints, slice(0, at % len(joints) + 1)))
    if at % len(joints) + 1 < len(joints):
        pieces.joints(part(joints, slice(at % len(joints) + 1, None)))
    same(estimated(whole, block), estimated(pieces, block, sorted(cuts)))


def test_standing_force_gives_the_static_deflection():
    sensing = Sensing(models())
    sensing.joints(still())
    rng = np.random.default_rng(1)
    force = np.array([-30.0, 5.0, 12.0])
    block = forces(force + 1e-6 * rng.normal(size=(25000, 3)))
    found = estimated(sensing, block)
    expected = models().response.oscillators.static @ force
    assert found["doubt"][-1] == 0
    np.testing.assert_allclose(found["error"][-1], expected, rtol=1e-5)
    np.testing.assert_allclose(found["static"][-1], expected, rtol=1e-5)


def test_restored_goes_on_bit_for_bit():
    block, joints = forces(cutting(1.0)), still(2.0)
    one = Sensing(models())
    one.joints(joints)
    before = estimated(one, part(block, slice(0, 1234)))
    two = Sensing(models())
    two.restore(one.state())
    same(
        estimated(one, part(block, slice(1234, None))),
        estimated(two, part(block, slice(1234, None))),
    )
    assert (before["doubt"] == Doubt.SETTLING).all()


def test_no_joints_no_estimate():
    sensing = Sensing(models())
    found = sensing.force(forces(cutting(0.1)))
    assert (found.doubt & Doubt.NO_JOINTS).all()
    assert np.isnan(found.error).all()
