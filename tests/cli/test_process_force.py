"""``robotrue compensate --force``: rules, tables, the model of milling, what is said of them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

NUMBER = re.compile(rb"[-+]?\d+\.?\d*")
MILLING = """milling = { kind = "flat", mode = "down", diameter_mm = 10, teeth = 3, depth_mm = 4,
  width_mm = 2, feed_per_tooth_mm = 0.05, spindle_rpm = 9000, tangential_N_per_mm2 = 800,
  radial_N_per_mm2 = 240, axial_N_per_mm2 = 80, tangential_edge_N_per_mm = 10 }""".replace("\n", "")


def compensated(cli, work: Path, name: str, *options: object):
    got = cli(
        "compensate",
        work / "model.rtm",
        work / "part.src",
        "-o",
        work / name,
        "--json",
        "--allow-steps",
        *options,
    )
    assert got.code == 0, got.err
    return got


def places(path: Path) -> np.ndarray:
    """X, Y, Z of the straight moves, mm."""
    return np.array(
        [
            [float(v) for v in NUMBER.findall(row)[:3]]
            for row in path.read_bytes().split(b"\n")
            if row.startswith(b"LIN")
        ]
    )


def described(work: Path, text: str) -> Path:
    (work / "force.toml").write_text(text, encoding="utf-8")
    return work / "force.toml"


def test_base_axes_everywhere_are_the_wrench(cli, work: Path) -> None:
    compensated(cli, work, "a.src", "--wrench", "0,0,-500")
    force = described(work, "[[force]]\nforce_N = [0, 0, -500]\n")
    got = compensated(cli, work, "b.src", "--force", force)
    assert (work / "a.src").read_bytes() == (work / "b.src").read_bytes()
    assert got.document["force"] == [
        {"name": "force 1", "targets": 4, "lines": [6, 9], "force_N": {"min": 500.0, "max": 500.0}}
    ]
    assert "force 'force 1': 4 targets in lines 6 to 9, 500 N" in got.err


def test_a_force_holds_where_it_is_stated(cli, work: Path) -> None:
    compensated(cli, work, "free.src")
    force = described(work, '[[force]]\naxes = "path"\nforce_N = [400, 0, 0]\nlines = [[7, 7]]\n')
    compensated(cli, work, "held.src", "--force", force, "--cutter", "z")
    moved = places(work / "held.src") - places(work / "free.src")
    assert moved[1, 1] > 0.05  # fed towards -y and pushed that way: sent back towards +y, mm
    assert not moved[[0, 2, 3]].any()


def test_a_table(cli, work: Path) -> None:
    (work / "f.csv").write_text("line,fx_N,fy_N,fz_N\n6,0,0,0\n9,0,0,-500\n")
    compensated(cli, work, "free.src")
    got = compensated(cli, work, "held.src", "--force", work / "f.csv")
    moved = places(work / "held.src") - places(work / "free.src")
    assert moved[3, 2] > 0.2
    assert not moved[:3].any()
    assert got.document["force"][0]["force_N"] == {"min": 0.0, "max": 500.0}


def test_the_force_of_milling(cli, work: Path) -> None:
    force = described(work, f"[[force]]\nname = 'side'\n{MILLING}\nlines = [[7, 7]]\n")
    got = compensated(cli, work, "held.src", "--force", force, "--cutter", "z")
    from robotrue.dynamics.cutter import CutterEngagement, CuttingCoefficients, EndMill
    from robotrue.dynamics.milling_force import mean_force

    want = mean_force(
        EndMill(kind="flat", diameter=0.01, teeth=3),
        CutterEngagement(mode="down", depth=0.004, width=0.002, feed_per_tooth=5e-5, spindle=150.0),
        CuttingCoefficients(tangential=8e8, radial=2.4e8, axial=8e7, tangential_edge=1e4),
    )
    assert got.document["force"][0]["force_N"]["max"] == pytest.approx(np.linalg.norm(want))


def test_a_rigid_model_says_that_a_force_changes_nothing(cli, work: Path) -> None:
    force = described(work, "[[force]]\nforce_N = [0, 0, -500]\n")
    got = cli("compensate", work / "cell.toml", work / "part.src", "-o", work / "o.src",
              "--force", force)  # fmt: skip
    assert got.code == 0
    assert "has no compliance" in got.err


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("[[force]]\nforce_N = [1, 2]\n", (), "force.toml:2: force_N is [1, 2]"),
        ("[[force]]\nforce_N = [1, 2, 3]\n", ("--wrench", "1,2,3"), "both given"),
        ("[[force]]\nforce_N = [1, 2, 3]\nlines = [[1, 3]]\n", (), "no cutting target in lines"),
        ("[[force]]\nforce_N = [1, 2, 3]\nprogram = 'b.src'\n", (), "is for b.src"),
        ("[[force]]\nmilling = { teeth = 3 }\n", (), "force.toml:1: milling: no kind"),
        (f"[[force]]\n{MILLING.replace('flat', 'round')}\n", (), "cutter of kind 'round'"),
        (f"[[force]]\n{MILLING.replace('teeth = 3', 'teeth = 2.5')}\n", (), "whole number"),
        (f"[[force]]\n{MILLING.replace('teeth', 'tooth')}\n", (), "unknown key tooth"),
        (f"[[force]]\n{MILLING}\naxes = 'base'\n", (), "axes is 'base'"),
        ("[[force]]\nforce_N = [1, 2, 3]\naxes = 'path'\n", ("--cutter", "w"), "expected x, y, z"),
        ("[[force]]\nforce_N = [1, 2, 3]\nmoves = ['spline']\n", (), "holds nowhere"),
    ],
)
def test_bad_input(cli, work: Path, text: str, options, message: str) -> None:
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", work / "o.src", "--json",
              "--force", described(work, text), *options)  # fmt: skip
    assert got.code != 0
    assert message in got.fault["message"] or message in got.err
    assert not (work / "o.src").exists()


def test_the_description_is_not_written_over(cli, work: Path) -> None:
    force = described(work, "[[force]]\nforce_N = [0, 0, -500]\n")
    got = cli("compensate", work / "model.rtm", work / "part.src", "-o", force, "--force", force)
    assert got.code != 0
    assert force.read_text().startswith("[[force]]")


def test_the_difference_is_predicted_under_the_same_force(cli, work: Path) -> None:
    force = described(work, '[[force]]\naxes = "path"\nforce_N = [0, 500, 0]\n')
    compensated(cli, work, "held.src", "--force", force, "--cutter", "z")
    sizes = []
    for options in (("--force", force, "--cutter", "z"), ()):
        got = cli("diff", work / "part.src", work / "held.src", "--model", work / "model.rtm",
                  "--json", *options)  # fmt: skip
        assert got.code == 0, got.err
        sizes.append(got.document["files"][0]["predicted_error_after_um"]["max"])
    assert sizes[1] - sizes[0] > 100.0  # what the force bends
    got = cli("diff", work / "part.src", work / "held.src", "--json", "--force", force)
    assert got.code != 0
    assert "without --model" in got.fault["message"]
