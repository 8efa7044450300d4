"""Hammer tests of a known structure give its response back, and bad hits are left out."""

from dataclasses import replace

import numpy as np
import pytest
from frf_cases import modal

from robotrue.dynamics.formats.dynamics_csv import read_hammer_csv
from robotrue.dynamics.frf_checks import check_response
from robotrue.dynamics.hammer import (
    combine_axes,
    evaluate_hits,
    evaluate_together,
    without_window,
)
from robotrue.dynamics.hits import HammerRecord, find_hits
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.errors import FormatError, ImplausibleDataError, ModelMismatchError, ShapeError

RATE = 2048.0
LIGHT = modal([9.0, 31.0, 120.0], [0.04, 0.03, 0.03], [[0.05, 0.02], [0.03, -0.04], [0.1, 0.1]],
              axes=("x", "y"))  # fmt: skip


def hits(truth=LIGHT, axis="x", *, count=4, every=4.0, noise=0.0, seed=0, double=(), drop=None):
    """What hammer and accelerometers record: exact linear response of half-sine pulses."""
    rng = np.random.default_rng(seed)
    n = int(RATE * (every * count + 0.5))
    pulse = np.sin(np.pi * np.arange(8) / 8) ** 2
    force = np.zeros(n)
    for k in range(count):
        at = int(RATE * (0.25 + every * k))
        strength = rng.uniform(800.0, 1500.0)
        force[at : at + 8] += strength * pulse
        if k in double:
            force[at + 60 : at + 68] += 0.2 * strength * pulse
    frequency = np.fft.rfftfreq(2 * n, 1.0 / RATE)
    column = truth.excitation_axes.index(axis)
    response = truth.response(frequency)[:, :, column] * -((2 * np.pi * frequency) ** 2)[:, None]
    motion = np.fft.irfft(response * np.fft.rfft(force, 2 * n)[:, None], 2 * n, axis=0)[:n]
    return HammerRecord(
        rate=RATE,
        force=force + 5.0 * noise * rng.normal(size=n),
        excitation_axis=axis,
        motion=motion + noise * rng.normal(size=motion.shape),
        response_axes=truth.response_axes,
        form="accelerance",
        source=f"hit_{axis}",
    )


def off(frf, truth):
    """Relative rms difference over the band."""
    low, high = frf.valid
    band = (frf.frequency >= low) & (frf.frequency <= high)
    want = truth.response(frf.frequency[band])
    part = np.linalg.norm(frf.response[band] - want, axis=(1, 2)) / np.linalg.norm(
        want, axis=(1, 2)
    )
    return float(np.sqrt((part**2).mean()))


def test_clean_hits_give_the_response_back():
    frf = combine_axes([evaluate_hits(hits(axis=a), duration=3.9) for a in "xy"])
    assert off(frf, LIGHT) < 2e-3
    assert frf.measured_as == "accelerance"
    assert frf.valid[0] == 4.0
    assert 100.0 < frf.valid[1] < 700.0
    check_response(frf)


def test_averaging_brings_the_noise_down():
    part = []
    for count in (2, 12):
        records = [hits(axis=a, count=count, noise=0.05) for a in "xy"]
        part.append(off(combine_axes(evaluate_together(records, duration=3.9, window=1.0)), LIGHT))
    assert part[1] < 0.6 * part[0]


def test_coherence_tells_signal_from_noise():
    clean = evaluate_hits(hits(count=6), duration=3.9)
    noisy = evaluate_hits(hits(count=6, noise=0.3), duration=3.9)
    inside = (clean.frequency > 6.0) & (clean.frequency < 200.0)
    assert clean.coherence[inside].min() > 0.99
    assert noisy.coherence[inside].mean() < 0.95
    assert noisy.valid[0] > clean.valid[0]


def test_one_hit_has_no_coherence():
    assert evaluate_hits(hits(count=1)).coherence is None


def test_double_hits_are_left_out():
    record = hits(count=5, double=(1, 3))
    good, bad = find_hits(record)
    assert len(good) == 3
    assert [why for _, why in bad] == ["double hit", "double hit"]
    frf = combine_axes([evaluate_hits(record, duration=3.9), evaluate_hits(hits(axis="y"),
                                                                       duration=3.9)])  # fmt: skip
    assert off(frf, LIGHT) < 2e-3
    with pytest.raises(ImplausibleDataError, match=r"no whole hit: .*double hit"):
        evaluate_hits(hits(count=2, double=(0, 1)))


def test_a_record_that_ends_after_its_last_hit_loses_that_hit_alone():
    whole = hits()
    end = round(RATE * (0.25 + 3 * 4.0 + 0.5))
    short = replace(whole, force=whole.force[:end], motion=whole.motion[:end])
    found = evaluate_hits(short)
    assert len(found.hits) == 3
    assert [why for _, why in found.left_out] == ["cut off"]
    assert found.duration > 3.0
    assert found.added_damping == 0.0


def test_exponential_window_is_taken_off_again():
    """Segments too short for 9 Hz and 4 %: with the window, then without what it added."""
    results = [evaluate_hits(hits(axis=a, every=1.5), duration=1.4, window=0.05) for a in "xy"]
    assert results[0].added_damping == pytest.approx(np.log(20.0) / 1.4, rel=1e-2)
    model = fit_modes(combine_axes(results))
    corrected = without_window(model, results[0].added_damping)
    for hz, damping in ((9.0, 0.04), (31.0, 0.03), (120.0, 0.03)):
        k = int(np.argmin(np.abs(model.frequency - hz)))
        assert corrected.frequency[k] == pytest.approx(hz, rel=3e-3)
        assert corrected.damping[k] == pytest.approx(damping, rel=0.05)
        assert model.damping[k] > corrected.damping[k]
    with pytest.raises(ImplausibleDataError, match="decays more slowly than the window"):
        without_window(model, 1e3)


def test_the_window_is_used_where_it_is_needed():
    """The displacement decides: 6 Hz and 1 % still ring when the acceleration is long gone."""
    slow = modal([6.0, 300.0], [0.01, 0.03], [[0.1], [0.3]], axes=("x",))
    assert evaluate_hits(hits(slow, every=2.0)).added_damping > 1.0
    assert evaluate_hits(hits(LIGHT)).added_damping == 0.0


def test_records_of_other_lengths_are_brought_to_one():
    """The closest hits decide the segments, the longest ringing the window."""
    slow = modal([6.0, 300.0], [0.01, 0.03], [[0.1, 0.0], [0.3, 0.2]], axes=("x", "y"))
    records = [hits(slow, "x", every=2.0), hits(LIGHT, "y", every=3.0)]
    results = evaluate_together(records)
    assert results[0].duration == results[1].duration < 2.1
    assert results[0].added_damping == results[1].added_damping > 1.0
    combine_axes(evaluate_together([hits(), hits(axis="y", every=3.5)]))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: replace(r, force=-r.force), "Its sign is flipped"),
        (lambda r: replace(r, force=0.01 * np.sin(np.arange(len(r.force)))), "no hit"),
        (lambda r: replace(r, force=np.minimum(r.force, 500.0)), "hammer stays at 500"),
        (lambda r: replace(r, motion=np.clip(r.motion, -0.2, 0.2)), "it is overloaded"),
        (lambda r: replace(r, motion=np.zeros_like(r.motion)), "sensor x is 0 on every sample"),
    ],
)
def test_sensors_refused(change, said):
    with pytest.raises(ImplausibleDataError, match=said) as caught:
        evaluate_hits(change(hits()))
    assert caught.value.hint


def test_a_flipped_sensor_is_found_by_physics():
    record = hits()
    with pytest.raises(ImplausibleDataError, match="Im is positive"):
        combine_axes([evaluate_hits(replace(record, motion=-record.motion))])


def test_records_that_do_not_belong_together():
    one = evaluate_hits(hits(), duration=3.9)
    with pytest.raises(ModelMismatchError, match="xx is measured twice"):
        combine_axes([one, one])
    with pytest.raises(ModelMismatchError, match="another sensor, spectrum or window"):
        combine_axes([one, evaluate_hits(hits(axis="y"), duration=2.0)])
    with pytest.raises(ShapeError, match="window of 2"):
        evaluate_hits(hits(), window=2.0)


def csv(tmp_path, head, columns):
    path = tmp_path / "hit.csv"
    body = "\n".join(",".join(f"{v:.9g}" for v in row) for row in columns.tolist())
    path.write_text(head + body + "\n", encoding="utf-8")
    return path


def test_records_from_csv(tmp_path):
    record = hits(count=1)
    t = np.arange(len(record.force)) / RATE
    table = np.column_stack([t, record.force, record.motion[:, ::-1] / 9.80665])
    again = read_hammer_csv(csv(tmp_path, "t_s,fx_N,ay_g,ax_g\n", table))
    np.testing.assert_allclose(again.motion, record.motion, rtol=1e-6, atol=1e-9)
    assert again.rate == pytest.approx(RATE)
    assert (again.excitation_axis, again.response_axes) == ("x", ("x", "y"))


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("t_s,ax_m_per_s2,ay_m_per_s2\n", "0 hammer columns"),
        ("t_s,fx_N,fy_N\n", "2 hammer columns"),
        ("t_s,fx_N,ax\n", "'ax' is not known or has no unit"),
        ("t_s,fx_N,ax_mV\n", "'ax_mV' is not known or has no unit"),
        ("time_s,fx_N,ax_g\n", "'time_s' is not known"),
    ],
)
def test_csv_refused(tmp_path, head, said):
    with pytest.raises(FormatError, match=said) as caught:
        read_hammer_csv(csv(tmp_path, head, np.arange(30.0).reshape(10, 3)))
    assert caught.value.line == 1
