"""A small shop in a workspace: a cell, simulated measurements, a model that knows the arm."""

from __future__ import annotations

import base64
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shop

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.cell.config import read_cell
from robotrue.core.arrays import Array
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.robot.model import parameter_slice
from robotrue.store import cells, measurements, models, programs
from robotrue.store.model_file import write_model
from robotrue.store.nouns import CellRecord, MeasurementRecord, ModelRecord, ProgramRecord
from robotrue.store.workspace import Workspace

Client = Callable[..., Any]
"""Makes a client of the HTTP interface; what is given are settings of the server."""
POSES = 40
SEED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Shop:
    """Files of a cell, and what is in its workspace."""

    folder: Path
    workspace: Workspace
    cell: CellRecord
    measured: MeasurementRecord
    model: ModelRecord
    program: ProgramRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Served:
    """A server in a process of its own."""

    address: str
    process: subprocess.Popen[str]
    folder: Path


PART = shop.PROGRAM.replace("LIN {X 9800", "PTP {X 9800").replace("LIN {X 1150", "PTP {X 1150")
"""The target out of reach between joint moves: it leaves no step in a path."""


def write_files(folder: Path) -> None:
    """A cell, simulated measurements and a program."""
    (folder / "cell.toml").write_text(shop.CELL)
    joints = shop.postures(POSES, SEED)
    shop.write_csv(folder / "simulated.csv", joints, shop.points(joints, noise_seed=SEED))
    (folder / "part.src").write_text(PART)


def fill(folder: Path, files: Path) -> Shop:
    """A workspace with one of everything; its model knows the arm as it is."""
    workspace = Workspace.create(folder)
    cell = read_cell(files / "cell.toml")
    taken = cells.add(workspace, files / "cell.toml", name="Cell <3>")
    rows = read_measurements(files / "simulated.csv")
    measured = measurements.add(
        workspace, rows, name="Tracker", raw=[files / "simulated.csv"], cell=taken.ref
    )
    arm = shop.actual()
    sd = np.full(len(arm.errors), 1e-6)
    sd[parameter_slice(6, "compliance")] = 1e-9
    model = CalibratedModel(
        robot=cell.measured_robot,
        errors=arm.errors,
        covariance=np.diag(sd**2),
        repeatability=2e-5,
        white=0.0,
        summary={
            "method": "elastic",
            "rows": POSES,
            "sources": ["simulated.csv sha256:0"],
            "verdict": "determined",
            "doubts": [],
            "unseen": [],
        },
    )
    write_model(files / "model.rtm", model, cell)
    kept = models.add(
        workspace, files / "model.rtm", name="Planted", data=[measured.ref], cell=taken.ref
    )
    program = programs.add(workspace, [files / "part.src"], name="Part")
    return Shop(
        folder=files, workspace=workspace, cell=taken, measured=measured, model=kept,
        program=program,
    )  # fmt: skip


def unpacked(packed: dict[str, Any]) -> Array:
    """The float64 array of a packed one."""
    values = np.frombuffer(base64.b64decode(packed["f32"]), dtype="<f4")
    return values.reshape(packed["shape"]).astype(np.float64)
