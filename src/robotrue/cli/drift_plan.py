"""``robotrue drift-plan``: a few poses that show whatever may have happened to a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import qmc

from robotrue.app.outputs import check_output
from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import ErrorModel, Query
from robotrue.cell.cell import Cell, tracker_covariance
from robotrue.cli.console import count, emit_json, emit_table, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.canonical import canonical_mapping
from robotrue.planning.arm_scene import Scene, scene_of
from robotrue.planning.candidates import STEP, draw_candidates, nothing_left, usable
from robotrue.planning.criteria import greedy
from robotrue.planning.order import short_order
from robotrue.robot.forward import forward
from robotrue.store.model_file import read_model
from robotrue.validation.drift_check import FEWEST, cause_columns

EXPECTED: Final = 1e-4
"""m and rad: the size of a change that is to be seen (0.1 mm, 0.006 deg)."""
CANDIDATES: Final = 512
DRAWN: Final = 8192
CLEARANCE: Final = 50.0 * MM
MARGIN: Final = 5.0 * DEG


def run(model_path: Path, output: Path, *, poses: int, seed: int, as_json: bool) -> None:
    """Chooses the poses and writes a sheet to fill in; prints how well each cause will be seen."""
    check_output(output, [model_path])
    if poses < FEWEST:
        raise ConfigurationError(
            f"{poses} poses; a drift check needs {FEWEST} or more.", hint="--poses 7"
        )
    stored = read_model(model_path)
    joints, seen = chosen(stored.model, stored.cell, poses, seed=seed)
    origin = provenance_of(stored.model)
    write_atomic(output, sheet(joints))
    say_mark(origin)
    say(f"{count(len(joints), 'pose')} written to {output}: fill in what the tracker reads")
    if as_json:
        emit_json({"poses_csv": str(output), "sd": seen}, origin)
        return
    emit_table(
        "standard deviation of each cause, alone",
        ("cause", "known to"),
        [(name, f"{value:.4f} {unit}") for name, (value, unit) in _worst(seen).items()],
        provenance=origin,
    )


def chosen(
    model: ErrorModel, cell: Cell, poses: int, *, seed: int
) -> tuple[Array, dict[str, dict[str, float]]]:
    """Returns joints (n, dof) rad in a short order, and the sd of each cause's numbers, mm and deg.

    Poses can be taken, are free of collisions and seen by the instrument as far as the cell says;
    they stay within the joint ranges the model was trained in, where it knows them.

    Raises:
        ReachError: Nothing can be measured.
        ConfigurationError: More poses than candidates.
    """
    scene = scene_of(cell, clearance=CLEARANCE)
    drawn = _candidates(model, scene, seed)
    query = Query(joints=drawn, load=cell.payload)
    place = forward(model.robot.nominal(), drawn)[:, :3, 3]
    noise = model.predict(query).covariance + tracker_covariance(cell, place)
    root = np.linalg.cholesky(noise)
    causes = cause_columns(model, query)
    white = {
        name: np.stack([solve_triangular(r, a, lower=True) for r, a in zip(root, c, strict=True)])
        for name, (_, c) in causes.items()
    }
    rows = np.concatenate(list(white.values()), axis=2) * EXPECTED
    size = rows.shape[2]
    choice = greedy(rows, np.eye(size), poses, criterion="D").chosen
    order = choice[short_order(drawn[choice])]
    seen = {}
    for name, (terms, _) in causes.items():
        a = white[name][choice].reshape(-1, len(terms))
        sd = np.sqrt(np.diagonal(np.linalg.pinv(a.T @ a)))
        seen[name] = {
            f"{t}_mm" if t in "xyz" else f"{t}_deg": float(v) / (MM if t in "xyz" else DEG)
            for t, v in zip(terms, sd, strict=True)
        }
    return drawn[order], seen


def _candidates(model: ErrorModel, scene: Scene, seed: int) -> Array:
    """Postures (n, dof) rad that can be measured, within the trained joint ranges if known."""
    trained = model.training_summary().joint_range
    if trained is None or trained.shape != (2, model.robot.dof):
        found = draw_candidates(
            scene, CANDIDATES, seed=seed, margin=MARGIN, region=None, step_back=None
        )
        return found.joints
    low, high = trained
    draws = qmc.Sobol(model.robot.dof, rng=np.random.default_rng([seed, 43]))
    joints = np.round((low + draws.random(DRAWN) * (high - low)) / STEP) * STEP
    good, why = usable(scene, joints)
    if not good.any():
        raise nothing_left(DRAWN, why)
    return np.asarray(joints[good][:CANDIDATES])


def _worst(seen: dict[str, dict[str, float]]) -> dict[str, tuple[float, str]]:
    """The worst known number of each cause, with its unit."""
    out = {}
    for name, numbers in seen.items():
        term = max(numbers, key=lambda t: numbers[t] * (1.0 if t.endswith("mm") else DEG / MM))
        out[name] = (numbers[term], term.rpartition("_")[2])
    return out


def sheet(joints: Array) -> bytes:
    """Returns the poses as CSV with blank positions, one row each in the order of measuring."""
    names = canonical_mapping(joints.shape[1])
    lines = ["# poses to be measured; fill in x_mm, y_mm, z_mm and give the file to drift"]
    lines.append(",".join([*names.joints, *names.position]))
    lines += [",".join([*(f"{q:.4f}" for q in row / DEG), "", "", ""]) for row in joints]
    return ("\n".join(lines) + "\n").encode()
