"""``robotrue plan --method hierarchical``: the counts of the paper and one test for each rule."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from robotrue.app.demo_virtual import cell_toml
from robotrue.core.units import DEG
from robotrue.robot.forward import forward
from robotrue.simulation.presets import deng2022

AROUND = "radius_mm=800..1400,height_mm=700..1200"
REGIONS = ("--source-region", f"angle_deg=-40..-30,{AROUND}",
           "--target-region", f"angle_deg=-30..40,{AROUND}")  # fmt: skip
BRANCH = ("--tool-abc-deg", "0,150,0", "--posture-deg", "0,-90,90,0,60,0")


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    (folder / "cell.toml").write_text(cell_toml(deng2022(1).known))
    return folder


def plan(cli, folder, *more, regions=REGIONS):
    return cli("plan", folder / "cell.toml", "-o", folder / "plan.csv", "--method",
               "hierarchical", *regions, *BRANCH, *more, "--json")  # fmt: skip


def places(folder, name):
    """Angle in deg, radius and height in mm of the planned points, and the sets."""
    table = pd.read_csv(folder / name, comment="#")
    robot = deng2022(1).known.measured_robot
    joints = table[[f"j{k}_deg" for k in range(1, 7)]].to_numpy() * DEG
    x, y, z = forward(robot.nominal(), joints)[:, :3, 3].T
    return np.arctan2(y, x) / DEG, 1e3 * np.hypot(x, y), 1e3 * z, table["set"].to_numpy()


def test_the_counts_of_the_paper(cli, cell):
    got = plan(cli, cell)
    assert got.code == 0, got.err
    assert got.document["source_poses"] == 126
    assert got.document["target_poses"] == 80
    assert got.document["complete_poses"] == 756
    assert [part["poses"] for part in got.document["sub_spaces"]] == [16] * 5
    region = f"angle_deg=-20..20,{AROUND}"
    validation = plan(cli, cell, "--grid", "9,7,6", "--sub-spaces", 1, regions=(
        "--source-region", region, "--target-region", f"angle_deg=-25..25,{AROUND}"))  # fmt: skip
    assert validation.document["source_poses"] == 378


def test_rule_1_each_target_pose_is_a_source_pose_turned_about_joint_1(cli, cell):
    plan(cli, cell)
    angle, radius, height, _ = places(cell, "plan.csv")
    there, far, high, names = places(cell, "plan_target.csv")
    seen = {(round(a, 3), round(r, 2), round(h, 2)) for a, r, h in zip(angle, radius, height)}  # noqa: B905
    for name, turn in zip([f"sub-space {k}" for k in range(1, 6)], range(10, 71, 15), strict=True):
        for k in np.flatnonzero(names == name):
            assert (round(there[k] - turn, 3), round(far[k], 2), round(high[k], 2)) in seen


def test_rule_2_sub_spaces_further_away_get_more(cli, cell):
    parts = plan(cli, cell, "--further", 1.0).document["sub_spaces"]
    counts = [part["poses"] for part in parts]
    assert counts == sorted(counts)
    assert counts[-1] > 1.5 * counts[0]
    assert sum(counts) == 80


def test_rule_3_corners_come_first(cli, cell):
    plan(cli, cell, "--target-rule", "corners")
    angle, radius, height, names = places(cell, "plan_target.csv")
    for k, low in enumerate((-30, -15, 0, 15, 30)):
        here = names == f"sub-space {k + 1}"
        for a in (low, low + 10):
            for r in (800, 1400):
                for h in (700, 1200):
                    away = np.abs([angle[here] - a, radius[here] - r, height[here] - h])
                    assert away.max(axis=0).min() < 0.01


def test_rule_4_an_overlap_needs_a_fixed_attitude_and_shared_poses(cli, cell):
    varied = plan(cli, cell, "--sub-spaces", 9)
    assert varied.code == 1
    assert "although the attitudes vary; rule 4" in varied.err
    constant = ("--turns-deg", "0,0,0")
    apart = plan(cli, cell, *constant)
    assert "neighbours must share 3 data or more (rule 4)" in apart.err
    overlapping = plan(cli, cell, *constant, "--sub-spaces", 9, "--target-poses", 360)
    assert overlapping.code == 0, overlapping.err


def test_what_is_refused(cli, cell):
    assert "needs --source-region" in plan(cli, cell, regions=()).err
    wrong = plan(cli, cell, "--turns-deg", "-15..15/4,0,0")
    assert "--turns-deg '-15..15/4,0,0', expected LOW..HIGH/STEP" in wrong.err
    wide = tuple(word.replace("1400", "2400") for word in REGIONS)
    far = plan(cli, cell, regions=wide)
    assert far.code == 1
    assert "out of reach, the first at (" in far.err
