"""The estimator: right in closed form, the same however it is cut, marked where it cannot know."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sensing_cases import ARM, cutting, forces, models, part, still

from robotrue.online.estimates import Doubt
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_models import PoseResponse
from robotrue.simulation.milling_arm import pass_joints

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
    for name, values in whole.state().items():  # the filters too, while they settle
        np.testing.assert_array_equal(values, pieces.state()[name], err_msg=name)


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


def test_cuts_after_settling_give_the_same_bits():
    block = forces(cutting(4.4))
    sensing = [Sensing(models()), Sensing(models())]
    for one in sensing:
        one.joints(still(5.0))
    found = estimated(sensing[0], block), estimated(sensing[1], block, range(7, 22_000, 257))
    assert np.isfinite(found[0]["error"][-2000:]).all()
    same(*found)


def test_modes_of_the_pose_give_the_static_deflection_there():
    """Measured modes know another pose by its stiffness, computed ones by themselves."""
    there = pass_joints(np.array([0.0]))[0]
    force = np.array([-30.0, 5.0, 12.0])
    noise = 1e-6 * np.random.default_rng(1).normal(size=(25000, 3))
    found = []
    for response in (models().response, PoseResponse(arm=ARM.arm, tool=ARM.tool)):
        sensing = Sensing(models(response=response))
        sensing.joints(still(joints=there))
        found.append(estimated(sensing, forces(force + noise)))
        assert found[-1]["doubt"][-1] == 0
    np.testing.assert_allclose(found[0]["error"][-1], found[1]["error"][-1], rtol=1e-5)
    at_home = models().response.oscillators.static @ force
    assert np.abs(found[0]["error"][-1] - at_home).max() > 1e-6


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
