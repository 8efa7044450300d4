"""Writes the archives of version 0.1.0: run once with that version, never again.

    python tests/archives/make_0_1_0.py

For each method one model file with its cell, and the predictions it made when it was written.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from archived_arm import PAYLOAD, measured, nominal, postures

from robotrue.calibration.methods import FitSettings, fit
from robotrue.calibration.model import Query
from robotrue.cell.cell import Cell
from robotrue.robot.statics import Load
from robotrue.store.model_file import write_model

FOLDER = Path(__file__).parent / "0.1.0"
METHODS = {"rigid-flexible": "elastic", "learned": "gp"}
WRENCH = np.array([[50.0, 300.0, -150.0, 5.0, -10.0, 2.0]])


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    robot, rows = nominal(), measured()
    cell = Cell(robot=robot, payload=PAYLOAD, source="archived.toml", digest="0" * 64)
    for name, method in METHODS.items():
        model = fit(robot, rows, method=method, settings=FitSettings(payload=PAYLOAD))
        write_model(FOLDER / f"{name}.rtm", model, cell)
        joints = postures(5, seed=12)
        approach = np.where(joints > 0.0, 1.0, -1.0)
        load = Load(mass=PAYLOAD.mass, com=PAYLOAD.com, wrench=WRENCH)
        found = model.predict(Query(joints=joints, load=load, approach=approach))
        record = {
            "kind": model.to_archive().kind,
            "joints_rad": joints.tolist(),
            "approach": approach.tolist(),
            "error_m": found.error.tolist(),
            "covariance_m2": found.covariance.tolist(),
        }
        (FOLDER / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
