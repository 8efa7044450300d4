"""The count of packets: what is told of each, whatever happens to them on the way."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Flag
from robotrue.online.sequence import SequenceState, advance


def _told(counts, state=None, times=None):
    state = SequenceState() if state is None else state
    told = []
    for i, count in enumerate(counts):
        state, flags = advance(state, count, i * 1e-3 if times is None else times[i])
        told.append(flags)
    return state, told


def test_a_restarted_controller_costs_one_packet():
    state, told = _told([5000, 5001, 1, 2, 3])
    assert told == [0, 0, Flag.CLOCK_JUMP, 0, 0]
    assert (state.jumps, state.lost) == (1, 0)


def test_one_damaged_count_marks_itself_and_the_next():
    _, told = _told([10, 11, 12 + 2**20, 13, 14])
    assert told == [0, 0, Flag.CLOCK_JUMP, Flag.CLOCK_JUMP, 0]


def test_the_hosts_clock_went_back():
    _, told = _told([1, 2, 3], times=[10.0, 9.0, 9.1])
    assert told == [0, Flag.CLOCK_JUMP, 0]


def test_late_by_the_clock_and_by_the_controllers_count():
    state = SequenceState(late_after=0.006)
    state, _ = advance(state, 1, 0.0)
    state, flags = advance(state, 2, 0.004)
    assert flags == Flag.NONE
    state, flags = advance(state, 3, 0.0101)
    assert flags == Flag.LATE
    state, flags = advance(state, 4, 0.014, late_count=1)
    assert flags == Flag.LATE
    state, flags = advance(state, 5, 0.018, late_count=1)
    assert flags == Flag.NONE
    assert state.late == 2


@given(st.lists(st.sampled_from(["keep", "lose", "twice", "swap"]), min_size=1, max_size=80))
def test_the_balance_of_a_bad_link(fates):
    """Packets sent = packets that came once + packets lost, and every copy is told."""
    sent = list(range(1, len(fates) + 1))
    arrived = [0]
    for number, fate in zip(sent, fates, strict=True):
        if fate == "swap" and len(arrived) > 1:
            arrived.insert(len(arrived) - 1, number)
        elif fate != "lose":
            arrived += [number] * (2 if fate == "twice" else 1)
    arrived.append(len(fates) + 1)
    state, told = _told(arrived)
    fresh = sum(not f & Flag.INVALID for f in told)
    assert fresh + state.repeated + state.reordered == len(arrived)
    assert state.total == len(fates) + 1
    assert state.jumps == 0


def test_settings_that_cannot_be():
    with pytest.raises(ConfigurationError, match="step 0"):
        SequenceState(step=0)
