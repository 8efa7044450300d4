import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from robotrue.cli.main import app

BEFORE = """&ACCESS RVP
DEF part( )
$BASE = {X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL = {X 0,Y 0,Z 300,A 0,B 0,C 0}
PTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}
LIN {X 1100.0,Y 0.0,Z 900.0,A 0.0,B 90.0,C 0.0}
LIN {X 1150.0,Y 10.0,Z 900.0,A 0.0,B 90.0,C 0.0}
END
"""


@pytest.fixture
def programs(tmp_path: Path) -> tuple[Path, Path]:
    first, second = tmp_path / "part.src", tmp_path / "part_comp.src"
    first.write_text(BEFORE)
    second.write_text(BEFORE.replace("X 1150.0,Y 10.0", "X 1150.3,Y 9.6"))
    return first, second


def test_every_target_as_csv_and_the_sizes_as_json(programs, tmp_path):
    out = tmp_path / "shift.csv"
    first, second = map(str, programs)
    done = CliRunner().invoke(app, ["diff", first, second, "-o", str(out), "--json"])
    assert done.exit_code == 0, done.output
    (found,) = json.loads(done.stdout)["files"]
    assert (found["targets"], found["same"], found["moved"]) == (3, 2, 1)
    assert found["shift_um"]["max"] == pytest.approx(500.0, abs=0.01)
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["status"] for row in rows] == ["same", "same", "moved"]
    assert float(rows[2]["shift_x_um"]) == pytest.approx(300.0, abs=0.01)
    assert rows[2]["line"] == "7"


def test_another_program_is_refused_and_nothing_written(programs, tmp_path):
    other = tmp_path / "other.src"
    other.write_text(BEFORE.replace("LIN {X 1100.0,Y 0.0,Z 900.0,A 0.0,B 90.0,C 0.0}\n", ""))
    out = tmp_path / "shift.csv"
    done = CliRunner().invoke(app, ["diff", str(programs[0]), str(other), "-o", str(out)])
    assert done.exit_code == 1
    assert not out.exists()
