"""The commands of the pages about registering, tool and blank answer as printed."""

from __future__ import annotations

from pathlib import Path

import pytest
from page_answers import check_answers

from robotrue.app.operations.transfer import Transferred
from robotrue.app.operations.validate import Validated
from robotrue.store.model_file import read_model

PAGES = (
    "three-points-and-rounds",
    "tool-point-from-the-table",
    "from-cam-to-program",
    "test-with-slots",
    "join-joints-and-points",
    "work-beside-other-software",
    "monuments-and-repeats",
    "warmth-over-a-shift",
    "arm-on-a-rail",
    "register-a-part",
)


@pytest.mark.parametrize("page", PAGES)
def test_the_answers_of_a_page_are_current(page: str) -> None:
    check_answers(page)


def test_the_paper_s_transfer_between_regions(tmp_path: Path) -> None:
    """``robotrue transfer --method deng2022`` on the paper's design as files. SIMULATED, S2A 1."""
    results = check_answers("transfer-between-regions", tmp_path)
    (transferred,) = (each for each in results if isinstance(each, Transferred))
    document = transferred.document()
    assert [part["angle_deg"] for part in document["sub_spaces"]] == pytest.approx(
        [10.0, 25.0, 40.0, 55.0, 70.0]
    )
    assert [part["poses"] for part in document["sub_spaces"]] == [16] * 5
    assert max(part["largest_pair_distance_m"] for part in document["sub_spaces"]) < 1e-6
    table = {row["name"]: row["mean"] for row in document["selection"]["table"]}
    assert list(table) == ["transfer", "source-only", "deng2022", "target-only"]
    assert table["transfer"] < table["deng2022"] < table["source-only"]
    assert document["guard"]["winner"] == "deng2022"
    assert "transfer wins the contest, 0.1" in document["doubts"][0]
    (validated,) = (each for each in results if isinstance(each, Validated))
    checked = validated.document()
    assert checked["mean_mm"] <= 0.14
    assert 0.93 <= checked["coverage_95"] <= 0.97
    folder = tmp_path / "paper"
    assert "deng2022 is used" in (folder / "west.html").read_text()
    seen = read_model(folder / "west.robotrue").model.training_summary()
    assert seen["readings"]["shrink_to"] == "rotation"
