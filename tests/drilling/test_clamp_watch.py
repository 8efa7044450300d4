"""A clamp is taken once, at rest, from the mean; what does not rest is told."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.clamp_watch import ClampSettings, ClampWatch, FootSample, Seen
from robotrue.errors import ConfigurationError

RATE = 128.0
"""1/s; times and the quarter of a second of rest are exact."""
REST = 32


def sample(k: float, force: float, reading_mm: float = 1.0, a_deg: float = 0.0) -> FootSample:
    return FootSample(
        time=k / RATE, readings=np.array([reading_mm, 2.0, 3.0]) * MM, force=force,
        height=5 * MM, axes=np.array([a_deg, 0.0]) * DEG,
    )  # fmt: skip


def seen(watch: ClampWatch, samples: list[FootSample]) -> list[Seen]:
    return [event for s in samples if (event := watch.push(s).seen) is not Seen.NOTHING]


def test_one_clamp_is_taken_once_after_its_rest() -> None:
    watch = ClampWatch(ClampSettings(quiet=0.25), approach="down")
    assert seen(watch, [sample(0, 10.0), sample(1, 500.0)]) == [Seen.BEGUN]
    settling = [sample(2 + k, 500.0, 1.0 + 0.5 * np.exp(-k / 15)) for k in range(40)]
    assert seen(watch, settling) == []
    rest = [watch.push(sample(42 + k, 500.0 + k % 2, 1.0 + 1e-3 * (k % 2))) for k in range(60)]
    taken = [event for event in rest if event.seen is Seen.TAKEN]
    assert len(taken) == 1
    clamps = taken[0].clamps
    assert clamps is not None
    assert clamps.readings[0, 0] == pytest.approx(1.0005 * MM, abs=1e-3 * MM)
    assert clamps.force[0] == pytest.approx(500.5, abs=0.3)
    assert clamps.approach == ("down",)
    assert seen(watch, [sample(103, 30.0), sample(104, 10.0), sample(105, 60.0)]) == [
        Seen.ENDED, Seen.BEGUN,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("noisy", "said"),
    [
        (lambda k: sample(k, 500.0 + 20.0 * (k % 2)), "the clamp force moves by 20.0 N"),
        (lambda k: sample(k, 500.0, 1.0 + 0.05 * (k % 2)), "sensor 1 moves by 0.0500 mm"),
        (lambda k: sample(k, 500.0, a_deg=1e-3 * k), r"the axes A and B turn by 0.0320 deg"),
    ],
)
def test_what_does_not_rest_is_told_once(noisy, said: str) -> None:
    watch = ClampWatch(ClampSettings(quiet=0.25, patience=1.0))
    events = [watch.push(noisy(k)) for k in range(300)]
    restless = [event for event in events if event.seen is Seen.RESTLESS]
    assert [event.said for event in restless] == [said]
    assert restless[0].clamps is None
    assert not any(event.seen is Seen.TAKEN for event in events)


def test_a_gap_a_bad_sample_and_an_old_one_begin_the_rest_anew() -> None:
    def taken_at(disturb) -> float:
        watch = ClampWatch(ClampSettings(quiet=0.25))
        for k in range(200):
            if disturb(watch, k):
                continue
            if watch.push(sample(k, 500.0)).seen is Seen.TAKEN:
                return k
        raise AssertionError

    assert taken_at(lambda watch, k: False) == REST
    assert taken_at(lambda watch, k: 10 <= k < 30) == 30 + REST  # 156 ms are missing
    assert taken_at(lambda watch, k: watch.broken() if k == 15 else None) == 15 + REST

    def old(watch: ClampWatch, k: int) -> None:
        if k == 15:
            assert watch.push(sample(3, 0.0)).seen is Seen.NOTHING

    assert taken_at(old) == REST


def test_few_samples_are_no_rest() -> None:
    watch = ClampWatch(ClampSettings(gap=1.0, patience=2.0))
    events = [watch.push(sample(10 * k, 500.0)) for k in range(30)]  # ten a second
    said = [event.said for event in events if event.seen is Seen.RESTLESS]
    assert said == ["only 4 good samples in 0.2 s"]


@pytest.mark.parametrize("wrong", [
    {"force_off": 60.0}, {"quiet": 0.0}, {"patience": 0.1}, {"reading_moves": -1 * UM},
])  # fmt: skip
def test_settings_that_cannot_be(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigurationError, match="expected"):
        ClampSettings(**wrong)
