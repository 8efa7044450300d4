"""The shift between two clocks from a simulated jog; refused where the jog does not show it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from jog_cases import Jog, jog

from robotrue.app.operations.sense_align import SenseAlignRequest, run
from robotrue.cli.terminal import run_operation
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.online.clock_alignment import ClockAlignment, align_streams, read_clock


def aligned(case: Jog, **options: float) -> ClockAlignment:
    return align_streams(case.joint_time, case.joints, case.force_time, case.wrench, **options)


def test_offset_is_found_within_its_deviation() -> None:
    errors, ratios = [], []
    for seed in range(4):
        case = jog(seed, offset=0.137 - 0.1 * seed)
        found = aligned(case)
        errors.append(found.offset - case.offset)
        ratios.append(errors[-1] / found.offset_sd)
        assert found.drift == 0.0
        assert found.explained > 0.99
    assert np.abs(errors).max() < 0.4e-3
    assert np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_drift_is_found_from_two_jogs() -> None:
    case = jog(1, late=16.0, drift=300e-6, length=7.0)
    found = aligned(case)
    assert abs(found.drift - case.drift) < 3.0 * found.drift_sd
    assert found.drift_sd < 60e-6
    true = case.offset + case.drift * (found.at + case.offset - 0.5 * 23.0)
    assert abs(found.offset - true) < 0.5e-3


def test_too_little_is_refused() -> None:
    still = jog(1, size=0.0)
    with pytest.raises(ObservabilityError, match="no joint turns by 1 deg or more"):
        aligned(still)
    with pytest.raises(ObservabilityError, match="the jog shows the shift to"):
        aligned(jog(1, size=0.05, noise=4.0), worst=1e-3)
    short = jog(1, length=2.0)
    with pytest.raises(ImplausibleDataError, match="in common"):
        aligned(short)


def test_two_shifts_that_do_as_well_are_refused() -> None:
    case = jog(1, size=0.3)
    time = case.joint_time
    # the same swing every 0.8 s, whatever the offset
    joints = np.zeros((len(time), 6))
    joints[:, 4] = 0.3 * np.sin(2.0 * np.pi * time / 0.8)
    moving = 0.3 * np.sin(2.0 * np.pi * (case.force_time + 0.137) / 0.8)
    force = 100.0 * np.column_stack([np.sin(moving), 0.0 * moving, np.cos(moving)])
    force += 0.4 * np.random.default_rng(1).standard_normal(force.shape)
    with pytest.raises(ObservabilityError, match="explain the force equally well"):
        align_streams(time, joints, case.force_time, force)


def test_times_that_fall_and_values_that_are_none() -> None:
    case = jog(1)
    fallen = case.force_time.copy()
    fallen[100] = fallen[98]
    with pytest.raises(ImplausibleDataError, match="time of the force goes from"):
        align_streams(case.joint_time, case.joints, fallen, case.wrench)
    holes = case.wrench.copy()
    holes[5, 0] = np.nan
    with pytest.raises(ImplausibleDataError, match="expected ten or more finite"):
        align_streams(case.joint_time, case.joints, case.force_time, holes)


def test_files_to_clock_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = jog(2)
    joints, force, clock = (tmp_path / n for n in ("j.csv", "f.csv", "clock.json"))
    table = np.column_stack([case.joint_time + 1.0, np.rad2deg(case.joints)])
    names = ",".join(f"a{k}_deg" for k in range(1, 7))
    np.savetxt(joints, table, "%.9f", ",", header=f"t_s,{names}", comments="")
    table = np.column_stack([case.force_time + 1.0, case.wrench])
    names = "t_s,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm"
    np.savetxt(force, table, "%.9f", ",", header=names, comments="")
    request = SenseAlignRequest(joints=joints, force=force, output=clock, most_s=1.0)
    run_operation(run, request, as_json=True)
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads(clock.read_text())
    assert abs(said["offset_s"] - 0.137) < 0.5e-3
    shift, _ = read_clock(clock, live=False)
    assert shift.offset == said["offset_s"]
    with pytest.raises(ConfigurationError, match="the clocks of two recorders"):
        read_clock(clock, live=True)
