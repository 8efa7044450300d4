"""``calibrate --table``: points on a rotary table, and programs whose targets are on it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from robotrue.simulation import table_practice


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("table")
    table_practice.main([str(folder)])
    return folder


@pytest.fixture(scope="module")
def table(folder: Path) -> tuple[str, ...]:
    fit = ("calibrate", folder / "cell.toml", folder / "measured.csv", "--method", "elastic")
    return (*map(str, fit), "--table", str(folder / "table.csv"))


def numbers(text: str) -> np.ndarray:
    """X, Y, Z of the LIN moves."""
    found = re.findall(r"LIN {X ([-\d.]+), Y ([-\d.]+), Z ([-\d.]+)", text)
    return np.array(found, dtype=float)


def test_a_program_on_the_table_is_corrected_at_its_angle(
    cli, folder: Path, table: tuple[str, ...]
) -> None:
    alone = cli(*table[:-2], "-o", folder / "arm.robotrue")
    assert alone.code == 0
    both = cli(*table, "-o", folder / "both.robotrue", "--json").document
    assert both["simulated"] is True
    assert both["table"]["points"] == 4
    assert both["table"]["settings"] == 12
    assert both["table"]["held_out_after_m"] < 0.2 * both["table"]["held_out_before_m"]
    assert any(said.startswith("table E2: axis off by") for said in both["terms"])
    assert [step["step"] for step in both["lineage"]] == ["fit", "table"]
    moved = {}
    for name in ("arm", "both"):
        out = folder / f"{name}.src"
        done = cli("compensate", folder / f"{name}.robotrue", folder / "part.src", "-o", out)
        assert done.code == 0, done.err
        assert "3 of 4 targets compensated" in done.err
        moved[name] = numbers(out.read_text())
    apart = np.linalg.norm(moved["both"] - moved["arm"], axis=1)
    assert apart[0] < 2e-4  # where the frame is given
    assert (apart[1:] > 0.1).all()


@pytest.mark.parametrize("option", [("--split", "5"), ("--deviation",)])
def test_moves_between_targets_on_the_table_are_refused(
    cli, folder: Path, table: tuple[str, ...], option: tuple[str, ...]
) -> None:
    assert cli(*table, "-o", folder / "s.robotrue").code == 0
    out = folder / "split.src"
    refused = cli("compensate", folder / "s.robotrue", folder / "part.src", "-o", out, *option)
    assert refused.code == 1
    assert f"{option[0]}: targets are on a rotary table whose errors" in refused.err
    assert not out.exists()


def test_what_a_table_file_may_say(cli, folder: Path, table: tuple[str, ...]) -> None:
    rows = (folder / "table.csv").read_text()
    odd = folder / "odd.csv"
    fit = (*table[:-1], odd, "-o", folder / "odd.robotrue")
    odd.write_text(rows.replace("e2_deg", "e3_deg"))
    assert "E3 in deg, and the cell does not describe it" in cli(*fit).err
    odd.write_text(rows.replace("e2_deg", "angle"))
    refused = cli(*fit)
    assert "unknown column 'angle'" in refused.err
    marks, header, *lines = rows.splitlines()
    near = [line for line in lines if abs(float(line.split(",")[1])) < 60.5]
    odd.write_text("\n".join([marks, header, *near]))
    assert cli(*fit).code == 0
    nearer = [line for line in near if float(line.split(",")[1]) < 45.0]
    odd.write_text("\n".join([marks, header, *nearer]))
    refused = cli(*fit)
    assert refused.code == 1
    assert "4 angles of E2 over 90.0 deg; at least 5 over 60 deg are needed" in refused.err


def test_a_function_for_a_frame_on_the_table_is_refused(
    cli, folder: Path, table: tuple[str, ...]
) -> None:
    assert cli(*table, "-o", folder / "w.robotrue").code == 0
    wrap = ("wrap", folder / "w.robotrue", "-o", folder / "rt_fix.src", "--box-mm",
            "150,250,-50,50,150,250", "--attitude-deg", "0,180,0", "--turn-deg", "2,2,2",
            "--start", "0,-90,90,0,30,0")  # fmt: skip
    refused = cli(*wrap, "--base", "1")
    assert "the work frame is on a rotary table" in refused.err
