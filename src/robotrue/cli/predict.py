"""``robotrue predict``: error and standard deviation at the poses of a CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotrue.calibration.model import Query
from robotrue.cli.console import emit_json, say
from robotrue.core.files import write_atomic
from robotrue.core.units import MM
from robotrue.measurement.queries import QueryTable, read_queries
from robotrue.robot.statics import Load
from robotrue.store.model_file import ModelFile, read_model


def run(model_path: Path, queries_path: Path, output: Path, *, as_json: bool) -> None:
    """Writes ``ex_mm, ey_mm, ez_mm, sx_mm, sy_mm, sz_mm`` (base axes), one row per query."""
    stored = read_model(model_path)
    queries = read_queries(queries_path)
    prediction = stored.model.predict(
        Query(joints=queries.joints, load=_load(stored, queries), approach=queries.approach)
    )
    sigma = np.sqrt(np.diagonal(prediction.covariance, axis1=1, axis2=2))
    rows = np.hstack([prediction.error, sigma]) / MM
    lines = ["ex_mm,ey_mm,ez_mm,sx_mm,sy_mm,sz_mm"]
    lines += [",".join(f"{value:.6f}" for value in row) for row in rows]
    write_atomic(output, ("\n".join(lines) + "\n").encode())
    size = np.linalg.norm(prediction.error, axis=1) / MM
    if as_json:
        emit_json(
            {
                "n": len(queries),
                "mean_mm": size.mean(),
                "max_mm": size.max(),
                "mean_sigma_mm": (sigma / MM).mean(),
                "output": str(output),
            }
        )
    else:
        say(f"{len(queries)} predictions, mean |error| {size.mean():.3f} mm, written to {output}")


def _load(stored: ModelFile, queries: QueryTable) -> Load:
    n = len(queries)
    payload = stored.cell.payload
    own = np.isfinite(queries.payload_mass)
    return Load(
        mass=np.where(own, queries.payload_mass, payload.mass[0]),
        com=np.broadcast_to(payload.com[0], (n, 3)),
        wrench=queries.wrench,
    )
