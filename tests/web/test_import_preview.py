"""The preview of an import reads a list of points and a joint list that were dropped together."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import shop

from robotrue.app.workbench.file_imports import import_measurements, preview_file
from robotrue.core.units import DEG, MM
from robotrue.robot.configuration import controller_axes
from robotrue.store import cells
from robotrue.store.measurements import rows_of
from robotrue.store.workspace import Workspace

POSES = 8


def write_pair(folder: Path) -> tuple[list[Path], np.ndarray]:
    """A KRL joint list and the points of a tracker; joints (n, 6) rad."""
    joints = shop.postures(POSES, 3)
    axes = controller_axes(shop.nominal(), joints) / DEG
    words = [",".join(f"A{k} {v:.6f}" for k, v in enumerate(row, 1)) for row in axes]
    lines = (f"DECL E6AXIS P{i}={{{word}}}\n" for i, word in enumerate(words))
    points = shop.points(joints, noise_seed=3) / MM
    (folder / "poses.dat").write_text("".join(lines))
    rows = (f"P{i};{x:.4f};{y:.4f};{z:.4f}\n" for i, (x, y, z) in enumerate(points))
    (folder / "points.txt").write_text("// export\nName;X;Y;Z\n" + "".join(reversed(list(rows))))
    return [folder / "poses.dat", folder / "points.txt"], joints


def test_two_files_that_were_dropped_together(tmp_path: Path) -> None:
    files, joints = write_pair(tmp_path)
    (tmp_path / "cell.toml").write_text(shop.CELL)
    with Workspace.create(tmp_path / "workspace") as workspace:
        cell = cells.add(workspace, tmp_path / "cell.toml")
        first = json.loads(preview_file(workspace, files, cell.id, None))
        assert first["joint_list"] == {"by": "order"}
        assert first["guess"]["joints"] == [f"A{k}" for k in range(1, 7)]
        assert first["guess"]["axes"] == "controller"
        assert first["fault"]["kind"] == "ImplausibleDataError"  # the order is another one
        stated = {"by": "name", "joint_column": "name (joint list)", "point_column": "Name"}
        mapping = {**first["guess"], "joint_list": stated}
        joined = json.loads(preview_file(workspace, files, cell.id, mapping))
        assert (joined["fault"], joined["poses"]) == (None, POSES)
        assert joined["remarks"] == [f"{POSES} rows joined by name"]
        record = import_measurements(workspace, files, "run", cell.id, mapping)
        np.testing.assert_allclose(rows_of(workspace, record).joints, joints[::-1], atol=1e-7)
