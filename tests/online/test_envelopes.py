"""Thinned for a screen: no peak lost, nothing invalid among the numbers, however it is cut."""

import itertools
import json

import numpy as np
import pytest
from estimate_cases import estimates

from robotrue.errors import ConfigurationError, ShapeError
from robotrue.online.estimates import Doubt, Envelopes, doubt_words, number_columns, numbers
from robotrue.online.live_page import estimates_frame


def _bins(cuts, doubt):
    thin = Envelopes(per_second=50, joints=6)
    found = []
    for start, end in itertools.pairwise(cuts):
        found += thin.add(estimates(start, end - start, doubt=doubt[start:end]))
    return found + thin.flush()


def test_every_cut_gives_the_same_bins_and_every_peak_is_in_one():
    rng = np.random.default_rng(5)
    doubt = np.where(rng.random(1000) < 0.05, int(Doubt.BAD_FORCE), 0)
    doubt[300:360] = int(Doubt.SETTLING)
    whole = _bins([0, 1000], doubt)
    cuts = [0, *sorted(rng.choice(np.arange(1, 1000), 300, replace=False)), 1000]
    parts = _bins(cuts, doubt)
    assert estimates_frame(whole) == estimates_frame(parts)
    assert sum(b.rows for b in whole) == 1000
    assert sum(b.invalid for b in whole) == np.count_nonzero(doubt)
    values = numbers(estimates(0, 1000, doubt=doubt), 6)
    assert np.nanmax([b.high[:3] for b in whole]) == np.nanmax(values[:, :3])
    assert np.nanmin([b.low[:3] for b in whole]) == np.nanmin(values[:, :3])
    empty = [b for b in whole if b.invalid == b.rows]
    assert empty
    assert all(np.isnan(b.high[:15]).all() and b.doubt == int(Doubt.SETTLING) for b in empty[:2])


def test_a_frame_says_null_where_nothing_is_known():
    bins = _bins([0, 20], np.full(20, int(Doubt.NO_JOINTS | Doubt.CLOCK)))
    frame = json.loads(estimates_frame(bins))
    first = frame["bins"][0]
    assert first["error_um"] == first["sd_um"] == [None] * 3
    assert first["low"] == [None] * 6
    assert first["static_um"] == [None] * 3
    assert first["invalid"] == first["rows"] > 0


def test_columns_are_as_many_as_their_names():
    assert numbers(estimates(0, 2), 6).shape == (2, len(number_columns(6)))
    assert np.isnan(numbers(estimates(0, 2, dof=0), 6)[:, 15:]).all()
    with pytest.raises(ShapeError, match="7 joints, expected 6"):
        numbers(estimates(0, 2, dof=7), 6)


def test_words_of_a_doubt():
    assert doubt_words(0) == "none"
    assert doubt_words(int(Doubt.BAD_FORCE | Doubt.EXTRAPOLATED)) == "bad_force+extrapolated"


@pytest.mark.parametrize("rate", [0.0, -1.0, 1000.0, float("nan")])
def test_rates_no_screen_can_show(rate):
    with pytest.raises(ConfigurationError, match="expected 1 to 100"):
        Envelopes(per_second=rate, joints=6)
