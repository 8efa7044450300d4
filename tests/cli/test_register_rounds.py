"""``robotrue register-rounds`` and the methods of ``register``: three points, three faces."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import touched

from robotrue.cell.config import read_cell
from robotrue.core.poses import apply

CORNER = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 0.3, 0.0]])
KLM = ("K", "L", "M")
FRAME = "1095,-195,503,9,-5,3"
FACES = np.array(
    [
        [0.02, 0.02, 0],
        [0.3, 0.02, 0],
        [0.02, 0.15, 0],
        [0.05, 0, 0.2],
        [0.35, 0, 0.1],
        [0, 0.1, 0.1],
    ]
)
NORMALS = np.array([[0, 0, -1]] * 3 + [[0, -1, 0]] * 2 + [[-1, 0, 0]], dtype=float)


@pytest.fixture
def rounds(work: Path) -> Callable[..., Path]:
    """Writes a round; what is shifted is in m."""

    def write(number: int, shift: object = 0.0, **options: object) -> Path:
        position = touched.in_base(CORNER, seed=number) + np.asarray(shift)
        return touched.write(
            work / f"round{number}.csv", CORNER, names=KLM, position=position, **options
        )

    return write


def test_the_state_between_rounds_is_the_files_of_touches(cli, work: Path, rounds) -> None:
    begin = (work / "cell.toml", rounds(1))
    rest = ("-o", work / "part.toml", "--frame", FRAME, "--frame-format", "krl", "--json")
    first = cli("register-rounds", *begin, *rest)
    assert first.code == 0, first.err
    assert first.document["rounds_verdict"] == "run again"
    assert first.document["verdict"] == "NO-GO"
    assert "run and probe again" in first.document["reasons"][0]
    assert "$BASE=" in first.document["frames"][0]["text"]
    ran = read_cell(work / "part.toml").part.frame().T_base_part
    second = cli("register-rounds", *begin, rounds(2), *rest).document
    assert (second["rounds_verdict"], second["verdict"]) == ("settled", "GO")
    np.testing.assert_allclose(second["rounds"][1]["run_xyz_mm"], ran[:3, 3] * 1e3)
    assert second["rounds"][0]["worst_mm"] > 5.0
    assert second["floor_mm"] < 0.3
    end = read_cell(work / "part.toml").part.frame()
    off = apply(end.T_base_part, CORNER) - apply(touched.T_BASE_PART, CORNER)
    assert np.linalg.norm(off, axis=1).max() < 0.3e-3
    third = cli("register-rounds", *begin, work / "round2.csv", rounds(3), *rest[:-1])
    assert "oscillation" in third.out
    assert "floor" in third.out


def test_a_table_that_moved_between_rounds_is_told(cli, work: Path, rounds) -> None:
    files = (rounds(1), rounds(2), rounds(3, [0.002, 0.0, 0.0]))
    got = cli(
        "register-rounds", work / "cell.toml", *files, "-o", work / "o.toml", "--frame", FRAME
    )
    assert got.code == 0
    assert "before round 3 the part moved by 2.0" in got.out + got.err
    assert "the rounds before are left out" in got.out + got.err


def test_a_part_that_creeps_from_round_to_round_is_not_settled(cli, work: Path, rounds) -> None:
    files = tuple(rounds(k, [1.5e-4 * (k - 1), 0.0, 0.0]) for k in range(1, 5))
    begin = ("register-rounds", work / "cell.toml")
    rest = ("-o", work / "o.toml", "--frame", FRAME, "--touch-sigma-mm", "0.1")
    document = cli(*begin, *files, *rest, "--json").document
    assert (document["rounds_verdict"], document["verdict"]) == ("not settled", "NO-GO")
    assert "Round 4 still moved the frame by 0." in document["reasons"][0]
    assert "the part is loose" in document["reasons"][0]
    still = tuple(rounds(k) for k in range(1, 5))
    assert cli(*begin, *still, *rest, "--json").document["rounds_verdict"] == "settled"


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"names": ("K", "L", "N")}, "points K, L, N, the first round has K, L, M."),
        ({"points": CORNER[:2]}, "points K, L, the first round has K, L, M."),
        ({"points": CORNER + np.eye(3) * 1e-3}, "nominal point of K is 1.000 mm from that"),
        ({"position": touched.in_base(CORNER) * 1e-3}, "the touched points are in metres"),
        ({"position": touched.in_base(CORNER * 0.98)}, "touches contradict each other by more"),
        (
            {"normal": np.tile([0.0, 0.0, 1.0], (3, 1))},
            "K has a normal; rounds take feature",
        ),
    ],
)
def test_a_round_that_is_not_of_this_part_is_refused(
    cli, work: Path, rounds, second: dict[str, object], message: str
) -> None:
    points = second.pop("points", CORNER)
    options = {"names": KLM, "position": touched.in_base(points, seed=2)} | second
    path = touched.write(work / "second.csv", points, **options)
    got = cli("register-rounds", work / "cell.toml", rounds(1), path, "-o", work / "o.toml",
              "--frame", FRAME, "--json")  # fmt: skip
    assert got.code == 1
    assert message in got.fault["message"]
    assert "second.csv" in str(got.fault)
    assert not (work / "o.toml").exists()


def test_exchanged_points_and_a_missing_start_are_refused(cli, work: Path, rounds) -> None:
    same = CORNER.copy()
    same[2, 1] = 0.4
    position = touched.in_base(same)[[0, 2, 1]]
    path = touched.write(work / "p.csv", same, names=KLM, position=position)
    got = cli("register-rounds", work / "cell.toml", path, "-o", work / "o.toml", "--frame", FRAME,
              "--json")  # fmt: skip
    assert re.search(r"turns the part by 1[78]\d deg about K", got.fault["message"])
    got = cli("register-rounds", work / "cell.toml", rounds(1), "-o", work / "o.toml", "--json")
    assert "the rough place of the part in the base is not known" in got.fault["message"]


def test_register_takes_the_three_points_of_the_paper(cli, work: Path, rounds) -> None:
    got = cli("register", work / "cell.toml", rounds(1), "-o", work / "o.toml", "--method",
              "feng2018", "--json")  # fmt: skip
    assert got.code == 0, got.err
    document = got.document
    assert document["residual_mm"]["K"] == pytest.approx(0.0, abs=1e-9)
    even = cli("register", work / "cell.toml", work / "round1.csv", "-o", work / "o.toml", "--json")
    assert even.document["misfit"] == pytest.approx(document["misfit"])
    got = cli("register", work / "cell.toml", work / "round1.csv", "-o", work / "o.toml",
              "--method", "feng2018", "--fit", "joint", "--json")  # fmt: skip
    assert "method feng2018 makes the frame alone" in got.fault["message"]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([0, 1], "2 points (K, L), a frame needs 3 or more"),
        ([1, 0, 2], "the right angle is at L"),
    ],
)
def test_three_points_that_are_not_those_of_the_paper(
    cli, work: Path, rows: list[int], message: str
) -> None:
    path = touched.write(
        work / "p.csv",
        CORNER[rows],
        names=KLM,
        position=touched.in_base(CORNER)[rows],
    )
    got = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--method", "feng2018",
              "--json")  # fmt: skip
    fault = got.fault["message"] + str(got.fault.get("hint"))
    assert message in fault


def test_register_lays_the_part_on_three_faces(cli, work: Path) -> None:
    order = np.random.default_rng(4).permutation(6)
    options = {"names": ("a", "b", "c", "d", "e", "f"), "normal": NORMALS[order]}
    position = touched.in_base(FACES[order], noise=0.0)
    path = touched.write(work / "p.csv", FACES[order], position=position, **options)
    got = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--method",
              "three-two-one", "--json")  # fmt: skip
    assert got.code == 0, got.err
    np.testing.assert_allclose(got.document["xyz_mm"], [1100.0, -200.0, 500.0], atol=1e-5)
    assert any("The frame has no redundant touch" in doubt for doubt in got.document["doubts"])
    short = [0, 1, 3, 4, 5, 5]
    path = touched.write(
        work / "p.csv", FACES[short], position=touched.in_base(FACES[short]), normal=NORMALS[short]
    )
    got = cli("register", work / "cell.toml", path, "-o", work / "o.toml", "--method",
              "three-two-one", "--json")  # fmt: skip
    assert "are 2 and 2 and 2 to a face, three-two-one needs 3, 2 and 1" in got.fault["message"]
