"""The command from files to files: sensed, recorded, exported, gone on with, refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotrue.app.operations import sense_run, stream_records
from robotrue.app.operations.sense_run import SenseRunRequest
from robotrue.app.operations.stream_records import RecordExportRequest, RecordInfoRequest
from robotrue.cli.terminal import run_operation
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError
from robotrue.online.corrections import end_note, note_path
from robotrue.online.guard import GuardState
from robotrue.online.record import StreamRecord
from robotrue.online.record_frames import Kind
from robotrue.online.sense_settings import correction_limits

CELL = """schema = 1
[robot]
preset = "KUKA KR160 R1570"
stiffness_Nm_per_rad = [1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5]
"""
ROWS = 3000


@pytest.fixture
def options(tmp_path: Path) -> SenseRunRequest:
    (tmp_path / "cell.toml").write_text(CELL)
    time = np.arange(ROWS // 4) * 4e-3
    joints = np.array([-20.0, -95.0, 105.0, 5.0, 70.0, -8.0]) + np.sin(time)[:, None]
    names = ",".join(f"a{k}_deg" for k in range(1, 7))
    table = np.column_stack([time, joints])
    np.savetxt(tmp_path / "j.csv", table, "%.6f", ",", header=f"t_s,{names}", comments="")
    time = np.arange(ROWS) * 1e-3
    force = np.array([-30.0, 60.0, 20.0]) + np.random.default_rng(1).standard_normal((ROWS, 3))
    table = np.column_stack([time, force])
    np.savetxt(tmp_path / "f.csv", table, "%.6f", ",", header="t_s,fx_N,fy_N,fz_N", comments="")
    return SenseRunRequest(
        cell=tmp_path / "cell.toml",
        robot=f"replay://{tmp_path / 'j.csv'}",
        force=f"replay://{tmp_path / 'f.csv'}",
    )


def replace(request: SenseRunRequest, **changes: Any) -> SenseRunRequest:
    return SenseRunRequest.model_validate({**dict(request), **changes})


def run_sense(request: SenseRunRequest) -> None:
    run_operation(sense_run.run, request, as_json=True)


def run_export(record: Path, output: Path, *, stream: str) -> None:
    request = RecordExportRequest(folder=record, output=output, stream=stream)
    run_operation(stream_records.export_stream, request, as_json=True)


def run_info(record: Path) -> None:
    run_operation(stream_records.describe_record, RecordInfoRequest(folder=record), as_json=True)


def said(capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_sensed_recorded_exported_and_sensed_again(
    options: SenseRunRequest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, record = tmp_path / "out.csv", tmp_path / "rec"
    run_sense(replace(options, record=record, out=(f"csv:{out}",)))
    found = said(capsys)
    assert found["rows"] == {"joints": ROWS // 4, "force": ROWS}
    assert found["estimates"] == ROWS
    assert 0 < int(str(found["invalid"])) < ROWS // 2
    run_export(record, tmp_path / "e.csv", stream="estimates")
    assert said(capsys)["rows"] == ROWS
    assert (tmp_path / "e.csv").read_bytes() == out.read_bytes()
    for stream in ("joints", "force"):
        target = tmp_path / f"{stream}.csv"
        run_export(record, target, stream=stream)
    capsys.readouterr()
    again = replace(
        options,
        robot=f"replay://{tmp_path / 'joints.csv'}",
        force=f"replay://{tmp_path / 'force.csv'}",
        out=(f"csv:{tmp_path / 'again.csv'}",),
    )
    run_sense(again)
    assert (tmp_path / "again.csv").read_bytes() == out.read_bytes()
    capsys.readouterr()
    run_info(record)
    rows = said(capsys)["rows"]
    assert rows == {"joints": ROWS // 4, "force": ROWS, "estimates": ROWS}


def test_a_torn_record_and_a_short_file_are_gone_on_with(
    options: SenseRunRequest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, out = tmp_path / "rec", tmp_path / "out.csv"
    asked = replace(options, record=record, out=(f"csv:{out}",))
    run_sense(asked)
    wanted = out.read_bytes()
    (segment,) = StreamRecord(record).segments()
    frames = [f.number for f in StreamRecord(record).frames({Kind.FORCE})]
    segment.write_bytes(segment.read_bytes()[: segment.stat().st_size * 2 // 3])
    out.write_bytes(wanted[: len(wanted) // 3])
    assert len(frames) > 2
    with pytest.raises(ConfigurationError, match="there is a record already"):
        run_sense(asked)
    with pytest.raises(ModelMismatchError, match="made with another rate_hz"):
        run_sense(replace(asked, resume=True, rate_hz=999.0))
    capsys.readouterr()
    run_sense(replace(asked, resume=True))
    assert said(capsys)["rows"] == {"joints": ROWS // 4, "force": ROWS}
    assert out.read_bytes() == wanted
    taken = [f.content for f in StreamRecord(record).frames({Kind.ESTIMATES})]
    assert np.concatenate([b.sequence for b in taken]).tolist() == list(range(ROWS))


def test_what_cannot_be_is_said_before_anything_begins(
    options: SenseRunRequest, tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match="corrections without limits"):
        run_sense(replace(options, correct=True))
    with pytest.raises(ConfigurationError, match="only rsi:// and egm:// robots take them"):
        run_sense(replace(options, correct=True, limit_mm=0.1, rate_mm_per_s=1.0))
    with pytest.raises(ConfigurationError, match="limits of a correction without --correct"):
        run_sense(replace(options, limit_mm=0.1))
    with pytest.raises(ConfigurationError, match="limits of a correction without --correct"):
        run_sense(replace(options, recover=True))
    with pytest.raises(ConfigurationError, match="--resume without --record"):
        run_sense(replace(options, resume=True))
    with pytest.raises(ConfigurationError, match="samples per second are not stated"):
        run_sense(replace(options, force="rdt://192.0.2.1?scale=x.xml"))
    with pytest.raises(FormatError, match="no segment in this folder"):
        run_info(tmp_path)
    with pytest.raises(ConfigurationError, match="expected joints, force, estimates"):
        run_export(tmp_path, tmp_path / "x", stream="all")


def test_corrections_need_the_address_of_the_controller(options: SenseRunRequest) -> None:
    stated = replace(
        options, robot="rsi://127.0.0.1:0?mode=absolute", limit_mm=0.2, rate_mm_per_s=1.5
    )
    with pytest.raises(ConfigurationError, match=r"any sender could take its place.*--peer"):
        run_sense(replace(stated, correct=True))
    with pytest.raises(ConfigurationError, match=r"peer .10\.0\.0\.1:0., expected the address"):
        run_sense(replace(stated, correct=True, peer="10.0.0.1:0"))
    for given in ({"trust_restart": True}, {"confirm_zero": True}):
        with pytest.raises(ConfigurationError, match="limits of a correction without --correct"):
            run_sense(replace(options, **given))


def test_a_robot_that_may_hold_a_correction_is_not_corrected_before_the_operator_confirms(
    options: SenseRunRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    stated = replace(
        options,
        robot="rsi://127.0.0.1:0?mode=absolute",
        limit_mm=0.2,
        rate_mm_per_s=1.5,
        correct=True,
        peer="127.0.0.1",
        seconds=0.2,
    )
    run_sense(stated)
    assert not note_path("127.0.0.1").exists(), "no robot came: nothing is held"
    assert end_note("127.0.0.1", GuardState(shift=(150_000, 0, 0), spread=(2000, 0)))
    with pytest.raises(ConfigurationError, match=r"may still apply up to 0\.152 mm since"):
        run_sense(stated)
    run_sense(replace(stated, confirm_zero=True))
    assert not note_path("127.0.0.1").exists()
    note_path("127.0.0.1").write_text("{")
    with pytest.raises(ConfigurationError, match="may still apply an unknown correction"):
        run_sense(stated)


def test_a_fault_ends_corrections_unless_they_may_recover() -> None:
    robot = "rsi://0.0.0.0:1?cycle=12ms"
    stated = {"limit_mm": 0.2, "rate_mm_per_s": 1.5, "watchdog_ms": 100.0}
    limits = correction_limits(robot, **stated, recover=False)
    assert (limits.shift, limits.shift_rate, limits.cycle) == pytest.approx((2e-4, 1.5e-3, 12e-3))
    assert limits.latch
    assert not correction_limits(robot, **stated, recover=True).latch
