"""``blank-check``, and roughing and finishing passes of ``program``, on the files of the pages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.cell.config import read_cell
from robotrue.program.formats import read_program
from robotrue.program.program import FrameTable, Motion
from robotrue_reproductions.feng2018.example_files import FILES, write_example


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("example")
    write_example(folder)
    assert sorted(p.name for p in folder.iterdir()) == sorted(FILES)
    return folder


@pytest.fixture
def placed(cli, example: Path) -> Path:
    cell = example / "placed.toml"
    if not cell.exists():
        got = cli("register", example / "cell.toml", example / "table.csv", "-o", cell,
                  "--fit", "frame")  # fmt: skip
        assert got.code == 0, got.err
    return cell


def test_the_blank_that_the_saw_cut_short(cli, example: Path, placed: Path, tmp_path: Path) -> None:
    asked = ("blank-check", placed, example / "blank.csv", "--mesh", example / "part.stl")
    shifted = tmp_path / "shifted.toml"
    got = cli(*asked, "--leave-mm", 5, "-o", shifted, "--json")
    assert got.code == 0, got.err
    document = got.document
    assert (document["verdict"], document["least_at"]) == ("fits", "back")
    left = {face["name"]: face["left_mm"] for face in document["faces"]}
    assert left["front"] - left["back"] == pytest.approx(6.0, abs=4.0)
    assert document["least_after_mm"] == pytest.approx(
        0.5 * (left["front"] + left["back"]), abs=0.1
    )
    before, after = (read_cell(path).part.frame().T_base_part for path in (placed, shifted))
    step = before[:3, :3].T @ (after - before)[:3, 3] * 1e3
    np.testing.assert_allclose(step, document["shift_mm"], atol=1e-6)
    assert cli(*asked, "--leave-mm", 18, "--json").document["verdict"] == "does not fit"
    shown = cli(*asked)
    assert "shift that balances it" in shown.out


def test_a_blank_that_cannot_be_checked(cli, example: Path, placed: Path, tmp_path: Path) -> None:
    mesh = ("--mesh", example / "part.stl", "--json")
    got = cli("blank-check", placed, example / "table.csv", *mesh)
    assert "A has no normal" in got.fault["message"]
    got = cli("blank-check", example / "cell.toml", example / "blank.csv", *mesh[:2], "-o",
              tmp_path / "o.toml", "--json")  # fmt: skip
    assert "the cell has none" in got.fault["message"]
    got = cli("blank-check", placed, example / "blank.csv", *mesh, "--mesh-unit", "ft")
    assert "--mesh-unit 'ft'" in got.fault["message"]


def test_roughing_from_two_sides_and_finishing_from_a_third(
    cli, example: Path, placed: Path, tmp_path: Path
) -> None:
    sides = [example / f"{name}.apt" for name in ("front", "back", "top")]
    words = ("--mesh", example / "part.stl", "--pass", "rough", "--pass", "rough", "--pass",
             "finish", "--stock-mm", 2, "--json")  # fmt: skip
    got = cli("program", placed, *sides, "-o", tmp_path / "job.src", *words, "--report",
              tmp_path / "job.html")  # fmt: skip
    assert got.code == 0, got.err
    front, back, top = got.document["sides"]
    assert [s["pass"] for s in (front, back, top)] == ["rough", "rough", "finish"]
    assert [s["stock_mm"] for s in (front, back, top)] == [2.0, 2.0, 0.0]
    for side in (front, back, top):
        np.testing.assert_allclose(
            sorted(side["contour"]["size_mm"]),
            [160.0, 220.0] if side is top else [220.0, 220.0],
            rtol=0.01,
        )
        assert len(side["contour"]["cuts_mm"]) > 50
    page = (tmp_path / "job.html").read_text()
    assert "Largest contour of each side" in page
    assert "front, rough" in page
    plain = cli("program", placed, sides[0], "-o", tmp_path / "front.src", *words[:2])
    assert plain.code == 0, plain.err
    rough, whole = (
        read_program(tmp_path / name, FrameTable()) for name in ("job.src", "front.src")
    )
    depth = [p.position[p.motion == Motion.LIN][3, 1] for p in (rough, whole)]
    assert depth[1] - depth[0] == pytest.approx(2e-3, abs=1e-6)  # the front is cut towards +y


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--pass", "fine", "--pass", "rough"), "--pass 'fine' for 2 tool paths."),
        (("--pass", "rough"), "--pass is given 1 times for 2 tool paths."),
        (("--pass", "finish", "--pass", "rough"), "back.apt is roughed after front.apt is finish"),
        (("--stock-mm", "-1"), "--stock-mm is -1 mm, expected 0 to 100."),
    ],
)
def test_passes_that_cannot_be(
    cli, example: Path, placed: Path, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    sides = [example / f"{name}.apt" for name in ("front", "back")]
    got = cli("program", placed, *sides, "-o", tmp_path / "job.src", *words, "--json")
    assert got.code == 1
    assert message in got.fault["message"]
