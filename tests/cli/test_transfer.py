"""``robotrue transfer``: sources as files or models, the contest on stdout, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
import shop

from robotrue.app.transfer_request import TransferRequest
from robotrue.app.transfer_sources import known_sources, parse_source
from robotrue.errors import ConfigurationError
from robotrue.store.model_file import read_model


@pytest.fixture
def few(work):
    """Four target poses beside the shelf's files."""
    joints = shop.postures(4, seed=11)
    shop.write_csv(work / "few.csv", joints, shop.points(joints, noise_seed=12))
    return work


def test_a_model_as_source_wins_and_says_why(cli, few):
    got = cli("transfer", few / "cell.toml", few / "few.csv", "--source",
              f"march={few / 'model.rtm'},campaign", "-o", few / "new.rtm")  # fmt: skip
    assert got.code == 0, got.err
    table = got.out
    assert "candidates on 4 target poses, each held out in turn" in table
    assert [w for w in ("transfer", "source-only", "target-only") if w in table] == [
        "transfer",
        "source-only",
        "target-only",
    ]
    assert "pooled" in table  # the posterior of a model takes new poses as those of its campaign
    assert "  learned " not in table  # it asks for the poses of the source
    assert "is used: transfer has 0.0" in got.err
    verdict = read_model(few / "new.rtm").model.training_summary()["guard"]
    assert verdict["winner"] in ("transfer", "source-only")
    assert f"{verdict['winner']} is used" in got.err
    seen = cli("inspect", few / "new.rtm")
    assert seen.code == 0, seen.err


def test_without_target_poses_it_says_that_nothing_was_checked(cli, few):
    got = cli("transfer", few / "cell.toml", "--source", f"march={few / 'model.rtm'}", "-o",
              few / "new.rtm", "--report", few / "page.html", "--json")  # fmt: skip
    assert got.code == 0, got.err
    assert got.document["guard"]["checked"] is False
    assert got.document["doubts"][0].startswith("no target pose was measured: transfer is used")
    page = (few / "page.html").read_text()
    assert "transfer is used; it was not checked against the target." in page
    shown = cli("inspect", few / "new.rtm")
    assert "warning: no target pose was measured" in shown.err


def test_a_source_in_other_units_is_left_out_and_named(cli, few):
    table = pd.read_csv(few / "cal.csv")
    table[["x_mm", "y_mm", "z_mm"]] *= 1e-3
    table.to_csv(few / "wrong.csv", index=False)
    got = cli("transfer", few / "cell.toml", few / "few.csv", "--source",
              f"old={few / 'wrong.csv'}", "-o", few / "new.rtm", "--json")  # fmt: skip
    assert got.code == 0, got.err
    assert got.document["guard"]["winner"].startswith("target-only")
    (doubt,) = got.document["guard"]["doubts"]
    assert doubt.startswith("source old is left out: ")
    assert "metres were read as millimetres" in doubt
    alone = cli("transfer", few / "cell.toml", "--source", f"old={few / 'wrong.csv'}", "-o",
                few / "none.rtm")  # fmt: skip
    assert alone.code == 1
    assert "no source can be used and no target pose was measured: source old is left out" in (
        alone.err
    )
    assert not (few / "none.rtm").exists()


def test_curve_and_page(cli, few):
    joints = shop.postures(15, seed=21)
    shop.write_csv(few / "more.csv", joints, shop.points(joints, noise_seed=22))
    got = cli("transfer", few / "cell.toml", few / "more.csv", "--source",
              f"march={few / 'model.rtm'}", "-o", few / "new.rtm", "--curve", "--report",
              few / "page.html", "--json")  # fmt: skip
    assert got.code == 0, got.err
    curve = got.document["curve"]
    assert curve["counts"] == [0, 5]
    assert curve["held_out"] == 10
    assert curve["candidates"]["target-only"]["median_mm"][0] is None
    assert curve["candidates"]["transfer"]["median_mm"][1] < 0.1
    page = (few / "page.html").read_text()
    assert "Required number of target poses" in page
    assert "Source used for the target" in page
    assert page.count("<svg") == 1
    json.dumps(got.document)


@pytest.mark.parametrize(
    ("text", "name", "file", "relation"),
    [
        ("a=b.csv", "a", "b.csv", "campaign"),
        ("a=b.csv,unit", "a", "b.csv", "unit"),
        ("a=dir,1/b,2.csv,region", "a", "dir,1/b,2.csv", "region"),
        ("a=b,2.csv", "a", "b,2.csv", "campaign"),
    ],
)
def test_a_source_is_name_file_relation(text, name, file, relation):
    found = parse_source(text)
    assert (found.name, found.path, found.relation) == (name, Path(file), relation)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("b.csv", "source 'b.csv', expected NAME=FILE or NAME=FILE,relation."),
        ("=b.csv", "source '=b.csv', expected"),
        ("a=b.csv,cousin", "relation 'cousin' of source 'a', expected region, campaign, unit."),
    ],
)
def test_a_source_it_cannot_read(text, said):
    with pytest.raises(ConfigurationError, match=said):
        parse_source(text)


def test_the_output_is_never_a_source(cli, few):
    before = (few / "model.rtm").read_bytes()
    got = cli("transfer", few / "cell.toml", few / "few.csv", "--source",
              f"march={few / 'model.rtm'}", "-o", few / "model.rtm")  # fmt: skip
    assert got.code == 1
    assert "which is an input; it is not overwritten" in got.err
    assert (few / "model.rtm").read_bytes() == before


def test_a_fleet_is_the_models_of_a_folder_as_other_units(cli, few):
    folder = few / "fleet"
    folder.mkdir()
    for name in ("b.robotrue", "a.rtm", "notes.txt"):
        (folder / name).write_bytes((few / "model.rtm").read_bytes())
    request = TransferRequest(output=few / "new.rtm", fleet=(folder, few / "model.rtm"))
    found = known_sources(request, None)
    assert [(each.name, each.relation) for each in found] == [
        ("a", "unit"), ("b", "unit"), ("model", "unit")
    ]  # fmt: skip
    got = cli("transfer", few / "cell.toml", "--fleet", folder, "-o", few / "new.rtm", "--json")
    assert got.code == 0, got.err
    assert got.document["relation"] == "unit"
    assert [each["name"] for each in got.document["transfer_sources"]] == ["a", "b"]


def test_no_source_and_an_empty_fleet_are_refused(cli, few):
    got = cli("transfer", few / "cell.toml", few / "few.csv", "-o", few / "new.rtm")
    assert got.code == 1
    assert "no source is stated." in got.err
    (few / "empty").mkdir()
    got = cli("transfer", few / "cell.toml", few / "few.csv", "--fleet", few / "empty", "-o",
              few / "new.rtm")  # fmt: skip
    assert got.code == 1
    assert "the folder holds no model file (.robotrue, .rtm)" in got.err
    assert not (few / "new.rtm").exists()
