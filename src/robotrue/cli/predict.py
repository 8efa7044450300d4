"""``robotrue predict``: error and standard deviation at the poses of a CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.calibration.lineage import provenance_of
from robotrue.calibration.model import Query
from robotrue.cli.console import count, emit_json, say, say_mark
from robotrue.core.files import write_atomic
from robotrue.core.provenance import mark_line
from robotrue.core.units import MM
from robotrue.errors import ModelMismatchError
from robotrue.measurement.formats.mapping_file import read_mapping
from robotrue.measurement.queries import QueryTable, read_queries
from robotrue.robot.statics import Load
from robotrue.store.model_file import ModelFile, read_model


def run(
    model_path: Path, queries_path: Path, output: Path, *, mapping: Path | None, as_json: bool
) -> None:
    """Writes ``ex_mm, ey_mm, ez_mm, sx_mm, sy_mm, sz_mm`` (base axes), one row per query."""
    check_output(output, [model_path, queries_path])
    stored = read_model(model_path)
    layout = None if mapping is None else read_mapping(mapping)
    queries = read_queries(queries_path, mapping=layout)
    if queries.joints.shape[1] != stored.model.robot.dof:
        raise ModelMismatchError(
            f"{queries.joints.shape[1]} joint columns, {stored.model.robot.name} has "
            f"{stored.model.robot.dof} joints.",
            source=queries_path,
            hint="one column j1_deg, j2_deg, ... per joint.",
        )
    prediction = stored.model.predict(
        Query(joints=queries.joints, load=_load(stored, queries), approach=queries.approach)
    )
    sigma = np.sqrt(np.diagonal(prediction.covariance, axis1=1, axis2=2))
    rows = np.hstack([prediction.error, sigma]) / MM
    origin = provenance_of(stored.model)
    lines = ["ex_mm,ey_mm,ez_mm,sx_mm,sy_mm,sz_mm"]
    lines += [",".join(f"{value:.6f}" for value in row) for row in rows]
    write_atomic(output, (mark_line(origin) + "\n".join(lines) + "\n").encode())
    say_mark(origin)
    size = np.linalg.norm(prediction.error, axis=1) / MM
    if as_json:
        emit_json(
            {
                "n": len(queries),
                "mean_mm": size.mean(),
                "max_mm": size.max(),
                "mean_sigma_mm": (sigma / MM).mean(),
                "output": str(output),
            },
            origin,
        )
    else:
        say(
            f"{count(len(queries), 'prediction')}, mean error {size.mean():.3f} mm, "
            f"written to {output}"
        )


def _load(stored: ModelFile, queries: QueryTable) -> Load:
    n = len(queries)
    payload = stored.cell.payload
    own = np.isfinite(queries.payload_mass)
    return Load(
        mass=np.where(own, queries.payload_mass, payload.mass[0]),
        com=np.broadcast_to(payload.com[0], (n, 3)),
        wrench=queries.wrench,
    )
