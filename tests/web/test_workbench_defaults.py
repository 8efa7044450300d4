"""What the workbench does where nobody states a value: the same as the command line."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_plan_page import done
from test_touching import begun
from touch_shop import CELL as TOUCH_CELL
from web_shop import Client, Shop, fill, write_files

from robotrue.cell.config import parse_cell
from robotrue.core.units import DEG
from robotrue.robot.forward import forward
from robotrue.robot.model import parameter_slice
from robotrue.store import items, models
from robotrue.store.model_file import read_model, write_model
from robotrue.store.nouns import DOCUMENT
from robotrue.store.registrations import session_in


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Shop:
    """A shop of this file's own."""
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    return fill(tmp_path_factory.mktemp("defaults") / "shop", files)


def test_a_correction_beyond_ten_millimetres_is_not_written(own: Shop, tmp_path: Path) -> None:
    """Fails when the cap of the workbench is another one than that of the command line."""
    stored = read_model(own.folder / "model.rtm")
    errors = np.array(stored.model.errors)
    errors[parameter_slice(6, "d")][0] += 0.015  # the arm is 15 mm higher than its drawing
    far = replace(stored.model, errors=errors)
    write_model(tmp_path / "far.rtm", far, stored.cell)
    model = models.add(own.workspace, tmp_path / "far.rtm", name="Far", data=[], cell=own.cell.ref)
    asked = {"program": own.program.id, "model": model.id, "allow_steps": True}
    usual, wide = done(own, "compensate", asked), done(own, "compensate", asked | WIDE)
    assert usual.result is not None, usual.error
    assert wide.result is not None, wide.error
    assert usual.result["compensated"] == 0
    assert wide.result["compensated"] == 3


WIDE = {"max_shift_mm": 20.0}


def test_poses_are_planned_from_one_side(own: Shop) -> None:
    """Fails when a plan without a stated approach enters its poses as it comes."""
    asked = {"cell": own.cell.id, "model": own.model.id, "poses": 5, "candidates": 60}
    for further, from_one_side in (({}, True), ({"approach": "as-it-comes"}, False)):
        made = done(own, "plan", asked | further)
        assert made.result is not None, made.error
        record = items.get(own.workspace, DOCUMENT, made.result["document"]["id"])
        (sheet,) = (a for a in record.attachments if a.name == "poses.csv")
        text = own.workspace.content(sheet.sha256).decode()
        rows = csv.DictReader(io.StringIO("".join(
            line for line in text.splitlines(keepends=True) if not line.startswith("#")
        )))  # fmt: skip
        signs = {v for row in rows for k, v in row.items() if "approach" in k}
        assert (signs == {"1"}) is from_one_side, signs


@pytest.mark.parametrize(
    ("word", "axis"), [("-x", (-1, 0, 0)), ("+x", (1, 0, 0)), ("-y", (0, -1, 0)), ("+z", (0, 0, 1))]
)
def test_the_tip_points_along_the_stated_axis(
    client: Client, filled: Shop, tmp_path: Path, word: str, axis: tuple[int, int, int]
) -> None:
    """Fails when postures are made for a tip that points elsewhere than the form says."""
    id = begun(client(), tmp_path, tip_axis=word)
    session = session_in(items.get(filled.workspace, DOCUMENT, id))
    robot = parse_cell(TOUCH_CELL.encode(), "cell.toml").robot.nominal()
    open_to = {"front": (0.0, -1.0, 0.0), "top": (0.0, 0.0, 1.0)}
    postures = [
        (np.array(q) * DEG, np.array(open_to[feature.name.split()[0]]))
        for feature in session.features
        for q in feature.postures_deg
    ]
    assert postures
    for q, outward in postures:  # the part stands in a base that is not turned
        tip = forward(robot, q[None])[0, :3, :3] @ axis
        assert tip @ -outward > np.cos(30.0 * DEG)
