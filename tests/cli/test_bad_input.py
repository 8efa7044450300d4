"""Bad input through the commands: a clear refusal, the original untouched, nothing half-written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shop

from robotrue.core.archive import read_archive, write_archive


def refused(cli, work: Path, name: str = "cal.csv", cell: str = "cell.toml") -> str:
    """Calibrates from a file; returns the message, after checking what every refusal keeps."""
    before = {p.name: p.read_bytes() for p in work.iterdir()}
    got = cli("calibrate", work / cell, work / name, "-o", work / "new.rtm", "--method", "elastic")
    assert got.code == 1, got.err
    assert got.out == ""
    assert {p.name: p.read_bytes() for p in work.iterdir()} == before
    message = got.err.splitlines()[-1]
    assert message.startswith("robotrue: ")
    assert "Traceback" not in got.err
    assert " Try: " in message
    return message


def changed(work: Path, change) -> None:
    table = pd.read_csv(work / "cal.csv")
    change(table)
    table.to_csv(work / "cal.csv", index=False)


def test_cut_off_in_the_middle_of_a_row(cli, work: Path) -> None:
    data = (work / "cal.csv").read_bytes()
    (work / "cal.csv").write_bytes(data[: data.rindex(b",", 0, len(data) - 40)])
    assert f"{work / 'cal.csv'}:61: " in refused(cli, work)


def test_another_encoding(cli, work: Path) -> None:
    lines = (work / "cal.csv").read_bytes().split(b"\n")
    lines[10] = lines[10].replace(b".", b"\xb7", 1)
    (work / "cal.csv").write_bytes(b"\n".join(lines))
    message = refused(cli, work)
    assert "cal.csv:11: byte 0xb7 is not UTF-8" in message


def test_not_a_number(cli, work: Path) -> None:
    lines = (work / "cal.csv").read_text().split("\n")
    lines[4] = "nan," + lines[4].split(",", 1)[1]
    (work / "cal.csv").write_text("\n".join(lines))
    message = refused(cli, work)
    assert "cal.csv:5" in message
    assert "j1_deg" in message


def test_a_misspelt_column(cli, work: Path) -> None:
    changed(work, lambda t: t.insert(9, "fx_n", 0.0) or t.insert(10, "Fyy_N", 0.0))
    assert "Fyy_N" in refused(cli, work)


def test_metres_where_millimetres_are_stated(cli, work: Path) -> None:
    changed(work, lambda t: t.__setitem__(["x_mm", "y_mm", "z_mm"], t.iloc[:, 6:9] * 1e-3))
    assert "metres were read as millimetres" in refused(cli, work)


def test_millimetres_where_metres_are_stated(cli, work: Path) -> None:
    (work / "map.toml").write_text(
        'joints = ["j1_deg","j2_deg","j3_deg","j4_deg","j5_deg","j6_deg"]\n'
        'position = ["x_mm","y_mm","z_mm"]\nposition_unit = "m"\n'
    )
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "new.rtm",
              "--mapping", work / "map.toml")  # fmt: skip
    assert got.code == 1
    assert "times those of the commanded poses: millimetres were read as metres" in got.err


def test_radians_where_degrees_are_stated(cli, work: Path) -> None:
    changed(work, lambda t: t.__setitem__(list(t)[:6], np.deg2rad(t.iloc[:, :6])))
    assert "radians were read as degrees" in refused(cli, work)


def test_degrees_where_radians_are_stated(cli, work: Path) -> None:
    (work / "map.toml").write_text(
        'joints = ["j1_deg","j2_deg","j3_deg","j4_deg","j5_deg","j6_deg"]\n'
        'position = ["x_mm","y_mm","z_mm"]\njoints_unit = "rad"\n'
    )
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "new.rtm",
              "--mapping", work / "map.toml")  # fmt: skip
    assert got.code == 1
    assert "degrees were read as radians" in got.err


def test_mirrored_axis(cli, work: Path) -> None:
    changed(work, lambda t: t.__setitem__("y_mm", -t["y_mm"]))
    message = refused(cli, work)
    assert "mirrored or exchanged axes" in message
    assert "x, -y, z" in message


def test_exchanged_axes(cli, work: Path) -> None:
    changed(
        work, lambda t: t.__setitem__(["x_mm", "y_mm", "z_mm"], t.iloc[:, [7, 8, 6]].to_numpy())
    )
    message = refused(cli, work)
    assert "not in the robot base" in message
    assert "z, x, y" in message


def test_tracker_upside_down(cli, work: Path) -> None:
    changed(work, lambda t: t.__setitem__(["y_mm", "z_mm"], -t[["y_mm", "z_mm"]]))
    message = refused(cli, work)
    assert "upside down" in message
    assert 'frame = "unknown"' in message


def test_the_same_upside_down_tracker_is_found_when_its_frame_is_unknown(cli, work: Path) -> None:
    changed(work, lambda t: t.__setitem__(["y_mm", "z_mm"], -t[["y_mm", "z_mm"]]))
    cell = (work / "cell.toml").read_text().replace('frame = "base"', 'frame = "unknown"')
    (work / "cell.toml").write_text(cell)
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "new.rtm",
              "--method", "elastic", "--json")  # fmt: skip
    assert got.code == 0
    assert got.document["rms_m"] < 5e-5


def test_another_robot(cli, work: Path) -> None:
    cell = (work / "cell.toml").read_text().replace("KUKA KR160 R1570", "KUKA KR300 R2500")
    (work / "cell.toml").write_text(cell)
    assert "not the measured robot" in refused(cli, work)


def test_another_number_of_joints(cli, work: Path) -> None:
    changed(work, lambda t: t.insert(6, "j7_deg", 0.0))
    assert "7 joints in the measurements, 6 in KUKA KR160 R1570" in refused(cli, work)


def test_fewer_poses_than_parameters(cli, work: Path) -> None:
    table = pd.read_csv(work / "cal.csv").iloc[:8]
    table.to_csv(work / "cal.csv", index=False)
    message = refused(cli, work)
    assert f"{work / 'cal.csv'}: 8 poses give 24 usable numbers" in message
    assert "measure at least" in message


def test_the_same_pose_again_and_again(cli, work: Path) -> None:
    table = pd.read_csv(work / "cal.csv").iloc[[0] * 60]
    table.to_csv(work / "cal.csv", index=False)
    refused(cli, work)


def test_a_repeated_row_is_noted_with_its_line(cli, work: Path) -> None:
    lines = (work / "cal.csv").read_text().rstrip("\n").split("\n")
    (work / "cal.csv").write_text("\n".join([*lines, lines[7]]) + "\n")
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "new.rtm",
              "--method", "elastic")  # fmt: skip
    assert got.code == 0
    assert "repeat an earlier one to the last digit (lines 62" in got.err


def test_a_point_out_of_reach_is_named(cli, work: Path) -> None:
    changed(work, lambda t: t.loc.__setitem__((20, "x_mm"), 9000.0))
    message = refused(cli, work)
    assert "cal.csv:22: a point 9" in message
    assert "the arm reaches" in message


def test_two_tracker_stations_without_a_station_column(cli, work: Path) -> None:
    cell = (work / "cell.toml").read_text().replace('frame = "base"', 'frame = "unknown"')
    (work / "cell.toml").write_text(cell)
    table = pd.read_csv(work / "cal.csv")
    table.iloc[:30].to_csv(work / "a.csv", index=False)
    table[["x_mm", "y_mm"]] = np.c_[-table["y_mm"], table["x_mm"] + 2500.0]
    table.iloc[30:].to_csv(work / "b.csv", index=False)
    files = ["calibrate", work / "cell.toml", work / "a.csv", work / "b.csv", "-o", work / "n.rtm",
             "--method", "elastic"]  # fmt: skip
    got = cli(*files)
    assert got.code == 1
    assert "number the tracker set-ups in a station column" in got.err
    for number, name in enumerate(("a.csv", "b.csv")):
        part = pd.read_csv(work / name)
        part["station"] = number
        part.to_csv(work / name, index=False)
    assert cli(*files).code == 0


def test_an_unknown_cell_key(cli, work: Path) -> None:
    (work / "cell.toml").write_text(shop.CELL.replace("mass_kg = 50", "mas_kg = 50"))
    message = refused(cli, work)
    assert "cell.toml:8: " in message
    assert "mas_kg" in message


def test_a_preset_nobody_knows(cli, work: Path) -> None:
    (work / "cell.toml").write_text(shop.CELL.replace("KR160", "KR161"))
    assert "KUKA KR161 R1570" in refused(cli, work)


def test_a_method_nobody_knows(cli, work: Path) -> None:
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "n.rtm",
              "--method", "magic")  # fmt: skip
    assert got.code == 1
    assert "method 'magic', expected auto, nominal" in got.err


def test_an_unknown_mapping_key(cli, work: Path) -> None:
    (work / "map.toml").write_text('joint = ["a"]\n')
    got = cli("calibrate", work / "cell.toml", work / "cal.csv", "-o", work / "n.rtm",
              "--mapping", work / "map.toml")  # fmt: skip
    assert got.code == 1
    assert "map.toml: unknown key 'joint' in a column mapping; known are" in got.err


def test_a_program_that_is_none(cli, work: Path) -> None:
    (work / "part.src").write_bytes(b"%PDF-1.7 \x00\x01\x02" * 50)
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src")
    assert got.code == 1
    assert "part.src:1: " in got.err
    assert not (work / "o.src").exists()


def test_a_program_cut_off(cli, work: Path) -> None:
    text = shop.PROGRAM[: shop.PROGRAM.index("Z 850.0")]
    (work / "part.src").write_text(text)
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src")
    assert got.code == 1
    assert "part.src:9: " in got.err
    assert not (work / "o.src").exists()


def test_a_target_out_of_reach_is_flagged_and_kept(cli, work: Path) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json",
              "--allow-steps")  # fmt: skip
    assert got.code == 0
    assert got.document["status"]["unchanged_unreachable"] == 1
    kept = (work / "part.src").read_bytes().split(b"\n")[7]
    assert (work / "o.src").read_bytes().split(b"\n")[7] == kept


def test_a_damaged_model(cli, work: Path) -> None:
    data = bytearray((work / "model.rtm").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (work / "model.rtm").write_bytes(data)
    for command in (("validate", work / "test.csv"), ("inspect",)):
        got = cli(command[0], work / "model.rtm", *command[1:])
        assert got.code == 1
        assert "model.rtm: " in got.err
        assert "damaged" in got.err
        assert "Traceback" not in got.err


def test_a_model_cut_off(cli, work: Path) -> None:
    (work / "model.rtm").write_bytes((work / "model.rtm").read_bytes()[:2000])
    got = cli("inspect", work / "model.rtm")
    assert got.code == 1
    assert "model.rtm: not a robotrue model file, or damaged" in got.err


def test_a_model_from_the_future(cli, work: Path) -> None:
    from dataclasses import replace

    write_archive(work / "model.rtm", replace(read_archive(work / "model.rtm"), schema=9))
    got = cli("validate", work / "model.rtm", work / "test.csv")
    assert got.code == 1
    assert "schema 9" in got.err
    assert "Try: update robotrue." in got.err


def test_a_model_of_an_unknown_kind(cli, work: Path) -> None:
    from dataclasses import replace

    write_archive(
        work / "model.rtm", replace(read_archive(work / "model.rtm"), kind="error-model/oracle")
    )
    got = cli("validate", work / "model.rtm", work / "test.csv")
    assert got.code == 1
    assert "'error-model/oracle'" in got.err


def test_files_in_the_wrong_places(cli, work: Path) -> None:
    swapped = cli("validate", work / "cell.toml", work / "test.csv")
    assert swapped.code == 1
    assert "cell.toml: not a model file. Try: a model file is what" in swapped.err
    assert "a zip file" in refused(cli, work, "model.rtm")
    got = cli("compensate", work / "cal.csv", work / "part.src", "-o", work / "o.src")
    assert got.code == 1
    assert "cal.csv:1: neither a model file nor a cell" in got.err


def test_a_model_of_another_robot(cli, work: Path) -> None:
    """Validation on rows of a robot of another size."""
    table = pd.read_csv(work / "test.csv")
    table[["x_mm", "y_mm", "z_mm"]] *= 1.4
    table.to_csv(work / "test.csv", index=False)
    got = cli("validate", work / "model.rtm", work / "test.csv")
    assert got.code == 1
    assert "not the measured robot" in got.err


OUTPUTS = [
    ("calibrate", "cell.toml", "cal.csv", "-o", "{}"),
    ("predict", "model.rtm", "test.csv", "-o", "{}"),
    ("compensate", "model.rtm", "part.src", "--allow-steps", "-o", "{}"),
]


@pytest.mark.parametrize("command", OUTPUTS)
def test_the_output_is_never_an_input(cli, work: Path, command: tuple[str, ...]) -> None:
    for name in command[1:3]:
        before = (work / name).read_bytes()
        got = cli(*(work / (name if a == "{}" else a) if "." in a or a == "{}" else a
                    for a in command))  # fmt: skip
        assert got.code == 1
        misnamed = f"{work / name}: the name ends in {Path(name).suffix}, as " in got.err
        assert misnamed or f"{work / name}: the output is {name}, which is an input" in got.err
        assert (work / name).read_bytes() == before


@pytest.mark.parametrize("command", OUTPUTS)
def test_no_such_folder(cli, work: Path, command: tuple[str, ...]) -> None:
    out = work / "nowhere" / "out.x"
    got = cli(*(out if a == "{}" else work / a if "." in a else a for a in command))
    assert got.code == 1
    assert f"{out}: cannot write: the folder {out.parent} does not exist." in got.err
    assert f"Try: mkdir -p {out.parent}" in got.err


@pytest.mark.parametrize("command", OUTPUTS)
def test_a_full_disk(
    cli, work: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    out = work / "out.x"
    out.write_text("the old one")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    before = sorted(p.name for p in work.iterdir())
    extra = ("--method", "elastic") if command[0] == "calibrate" else ()
    got = cli(*(out if a == "{}" else work / a if "." in a else a for a in command), *extra)
    assert got.code == 1
    assert f"{out}: cannot write: No space left on device." in got.err
    assert out.read_text() == "the old one"
    assert sorted(p.name for p in work.iterdir()) == before


KILLED = """
import os, sys, time
def hang(_):
    print('writing', flush=True)
    time.sleep(60)
os.fsync = hang
from robotrue.cli.main import run
run()
"""


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
def test_killed_while_writing(work: Path) -> None:
    out = work / "o.src"
    process = subprocess.Popen(  # noqa: S603 - this interpreter
        [sys.executable, "-c", KILLED, "compensate", work / "cell.toml", work / "part.src",
         "-o", out], stdout=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == b"writing\n"  # all bytes are in the neighbour file
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=10)
    process.stdout.close()
    assert not out.exists()
    assert (work / "part.src").read_bytes() == shop.PROGRAM.encode("latin-1")


def test_interrupted_by_the_user(cli, work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", stop)
    before = sorted(p.name for p in work.iterdir())
    got = cli("compensate", work / "cell.toml", work / "part.src", "-o", work / "o.src")
    assert got.code == 1
    assert got.err.splitlines()[-1].startswith("robotrue: stopped")
    assert sorted(p.name for p in work.iterdir()) == before
