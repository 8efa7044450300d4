"""``robotrue compensate --deviation`` and ``--split``."""

from __future__ import annotations

from pathlib import Path

import pytest

PROGRAM = """&ACCESS RVP
DEF part()
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
LIN {X 1200.0,Y 200.0,Z 900.0,A 0,B 120,C 0} C_DIS
LIN {X 1200.0,Y -200.0,Z 900.0,A 0,B 120,C 0} C_DIS
CIRC {X 1250.0,Y -150.0,Z 900.0,A 0,B 120,C 0},{X 1200.0,Y -100.0,Z 900.0,A 0,B 120,C 0} C_DIS
LIN {X 1200.0,Y -101.0,Z 900.0,A 0,B 120,C 0}
DRILL()
LIN {X 1150.0,Y -200.0,Z 850.0,A 0,B 120,C 0}
END
DEF DRILL()
END
"""


@pytest.fixture
def part(work: Path) -> Path:
    path = work / "long.src"
    path.write_text(PROGRAM, encoding="ascii")
    return path


def test_neither_option_changes_no_byte(cli, work: Path, part: Path) -> None:
    plain, looked = work / "plain.src", work / "looked.src"
    cli("compensate", work / "model.rtm", part, "-o", plain)
    got = cli("compensate", work / "model.rtm", part, "-o", looked, "--deviation", "--json")
    assert got.code == 0
    assert looked.read_bytes() == plain.read_bytes()
    between = got.document["between_targets"]
    assert (between["lines"], between["arcs"], between["not_known"]) == (4, 1, 2)
    worst = between["worst"]
    assert worst[0]["line"] == 7
    assert worst[0]["kind"] == "line"
    assert worst[0]["length_mm"] == pytest.approx(400.0)
    assert worst[0]["kept_um"] == pytest.approx(between["kept_um"]["max"])
    assert worst[0]["split_um"] == pytest.approx(worst[0]["kept_um"] / 4.0, rel=0.2)
    assert [each["kind"] for each in worst] == ["line", "arc", "line"]
    assert "between the targets of 2 lines and 1 arcs, not split:" in got.err


def test_a_tolerance_that_nothing_exceeds_changes_no_byte(cli, work: Path, part: Path) -> None:
    plain, split = work / "plain.src", work / "split.src"
    cli("compensate", work / "model.rtm", part, "-o", plain)
    got = cli("compensate", work / "model.rtm", part, "-o", split, "--split", "1000", "--json")
    assert split.read_bytes() == plain.read_bytes()
    assert got.document["between_targets"]["inserted_targets"] == 0


def test_splitting_reaches_the_tolerance(cli, work: Path, part: Path) -> None:
    out = work / "split.src"
    got = cli("compensate", work / "model.rtm", part, "-o", out, "--split", "2", "--json")
    assert got.code == 0
    between = got.document["between_targets"]
    assert between["kept_um"]["max"] > 2.0
    assert between["split_um"]["max"] <= 2.001
    added = out.read_text().count("\n") - PROGRAM.count("\n")
    parts = {each["line"]: each["parts"] for each in between["worst"]}
    assert added == sum(parts.values()) - len(parts)
    assert between["split_moves"] == sum(number > 1 for number in parts.values())
    assert got.document["targets"] == 7 + between["inserted_targets"]
    left = {tuple(each["lines"]): each["reason"] for each in between["left_whole"]}
    assert left == {
        (11,): "its start is uncertain",
        (6,): "it starts or ends at a target that is not compensated, or in another frame",
    }
    assert "targets inserted; then" in got.err
    # The program that was written knows what it was made from.
    again = cli("compensate", work / "cell.toml", out, "-o", work / "again.src")
    assert again.code == 1
    assert "the program is compensated already" in again.err
    assert "Try: compensate long.src." in again.err


def test_force_that_turns_is_carried_into_the_parts(cli, work: Path, part: Path) -> None:
    force = work / "force.toml"
    force.write_text(
        '[[force]]\nname = "cut"\naxes = "path"\nforce_N = [-300, 0, 0]\nmoves = ["line", "arc"]\n',
        encoding="ascii",
    )
    out = work / "split.src"
    got = cli("compensate", work / "model.rtm", part, "-o", out, "--force", force,
              "--split", "3", "--json")  # fmt: skip
    assert got.code == 0, got.err
    between = got.document["between_targets"]
    assert between["split_um"]["max"] <= 3.001
    arc = next(each for each in between["worst"] if each["kind"] == "arc")
    assert arc["parts"] > 2


def test_too_many_targets_are_refused(cli, work: Path, part: Path) -> None:
    out = work / "split.src"
    got = cli("compensate", work / "model.rtm", part, "-o", out, "--split", "0.01",
              "--split-limit", "10")  # fmt: skip
    assert got.code == 1
    assert "to keep every move within 0.01 um, about " in got.err
    assert "at most 10 are allowed. Try: a larger tolerance, or --split-limit." in got.err
    assert not out.exists()


def test_what_cannot_be_asked(cli, work: Path, part: Path) -> None:
    out = work / "split.src"
    got = cli("compensate", work / "cell.toml", part, "-o", out, "--split", "2")
    assert got.code == 1
    assert "--split asks a calibrated model what the arm does between targets" in got.err
    got = cli("compensate", work / "model.rtm", part, "-o", out, "--split", "-2")
    assert "the tolerance of splitting is -2 um, expected above 0." in got.err
    got = cli("compensate", work / "model.rtm", part, "-o", out, "--deviation", "--free-spin")
    assert "--deviation and --free-spin are both given" in got.err
    assert not out.exists()
