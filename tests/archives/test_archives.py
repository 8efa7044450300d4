"""Model files of every released version open and predict what they predicted then."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from archived_arm import PAYLOAD
from make_0_1_0 import WRENCH

from robotrue.calibration.model import Query
from robotrue.robot.statics import Load
from robotrue.store.model_file import read_model

RECORDS = sorted(Path(__file__).parent.glob("*/*.json"))


def test_every_kind_is_there() -> None:
    kinds = {json.loads(path.read_text())["kind"] for path in RECORDS}
    assert kinds == {"error-model/rigid-flexible", "error-model/learned"}


@pytest.mark.parametrize("record", RECORDS, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_an_old_archive_opens_and_predicts_the_same(record: Path) -> None:
    then = json.loads(record.read_text())
    stored = read_model(record.with_suffix(".rtm"))
    assert stored.archive.kind == then["kind"]
    load = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=WRENCH)
    now = stored.model.predict(
        Query(joints=np.array(then["joints_rad"]), load=load, approach=np.array(then["approach"]))
    )
    np.testing.assert_allclose(now.error, then["error_m"], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(now.covariance, then["covariance_m2"], rtol=0.0, atol=1e-12**1.5)
    assert np.linalg.norm(now.error, axis=1).min() > 1e-5
    assert stored.cell.payload.mass[0] == 40.0
    assert stored.cell.source == "archived.toml"


@pytest.mark.parametrize(
    "path", sorted(Path(__file__).parent.glob("*/*.rtm")), ids=lambda p: p.stem
)
def test_archives_are_small(path: Path) -> None:
    assert path.stat().st_size < 100_000
