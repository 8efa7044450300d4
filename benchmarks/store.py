"""Pages of a large workspace: 100,000 measurement sets, and one set of 100,000 poses.

``python benchmarks/store.py [--items 100000] [--postgres]`` prints ms per page, listed, filtered,
sorted and counted by the store, beside the bare SQL of the same page: what the store adds.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from kill_store import temporary_postgres
from sqlalchemy import insert, text

from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.store import items, measurements
from robotrue.store.measurements import RowQuery
from robotrue.store.nouns import MEASUREMENT
from robotrue.store.records import ItemQuery
from robotrue.store.schema import ItemRow, LinkRow
from robotrue.store.workspace import Workspace

PAGES = {
    "newest 50": (
        ItemQuery(),
        "SELECT * FROM measurement_sets WHERE latest AND NOT deleted "
        "ORDER BY created DESC, id DESC LIMIT 50",
    ),
    "page 1000": (
        ItemQuery(offset=50_000),
        "SELECT * FROM measurement_sets WHERE latest AND NOT deleted "
        "ORDER BY created DESC, id DESC LIMIT 50 OFFSET 50000",
    ),
    "by name": (
        ItemQuery(sort="name"),
        "SELECT * FROM measurement_sets WHERE latest AND NOT deleted ORDER BY name, id LIMIT 50",
    ),
    "text in name or note": (
        ItemQuery(text="grid 0777"),
        "SELECT * FROM measurement_sets WHERE latest AND NOT deleted AND (lower(name) LIKE "
        "'%grid 0777%' OR lower(note) LIKE '%grid 0777%') ORDER BY created DESC, id DESC LIMIT 50",
    ),
    "poses = 77, by poses": (
        ItemQuery(where={"poses": 77}, sort="-poses"),
        "SELECT * FROM measurement_sets WHERE latest AND NOT deleted AND poses = 77 "
        "ORDER BY poses DESC, id DESC LIMIT 50",
    ),
    "of one cell": (ItemQuery(linked=("cell", "CELL")), ""),
}


def poses(n: int) -> MeasurementSet:
    rng = np.random.default_rng(1)
    covariance = np.broadcast_to(np.eye(3) * 1e-10, (n, 3, 3))
    joints, position = rng.random((n, 6)), rng.random((n, 3))
    return MeasurementSet(
        joints=joints, position=position, covariance=covariance, station=np.arange(n) % 7
    )


def filled(workspace: Workspace, count: int) -> str:
    """Puts rows in at once, all with the samples of one set; returns the id of their cell."""
    made = measurements.add(workspace, poses(20), name="first")
    cell, begun = str(uuid.uuid4()), datetime(2026, 1, 1, tzinfo=UTC)
    ids = [str(uuid.UUID(int=k + 1)) for k in range(count)]
    common = {"version": 1, "latest": True, "deleted": False, "detail": {}, "dof": 6}
    own = {"frame": "base", "full_poses": 0, "data": made.data, "samples": made.samples}
    at = [begun + timedelta(seconds=k) for k in range(count)]
    with workspace.write() as into:
        session = into.session
        session.execute(insert(ItemRow), [{"id": cell, "noun": "cell", "created": begun}])
        nouns = [
            {"id": i, "noun": "measurement", "created": t} for i, t in zip(ids, at, strict=True)
        ]
        session.execute(insert(ItemRow), nouns)
        rows = [
            {**common, **own, "id": i, "name": f"grid {k:05d}", "note": "", "created": t,
             "poses": k % 100}
            for k, (i, t) in enumerate(zip(ids, at, strict=True))
        ]  # fmt: skip
        session.execute(insert(MEASUREMENT.table), rows)
        link = {"version": 1, "role": "cell", "position": 0, "to_id": cell, "to_version": 1}
        session.execute(insert(LinkRow), [{"id": i, **link} for i in ids[::1000]])
    return cell


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Returns median seconds of nine runs: on the clock, and of this process."""
    wall, cpu = [], []
    for _ in range(9):
        before, spent = time.perf_counter(), time.process_time()
        work()
        wall.append(time.perf_counter() - before)
        cpu.append(time.process_time() - spent)
    return statistics.median(wall), statistics.median(cpu)


def main() -> None:
    asked = argparse.ArgumentParser()
    asked.add_argument("--items", type=int, default=100_000)
    asked.add_argument("--postgres", action="store_true")
    options = asked.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "shop"
        url = stack.enter_context(temporary_postgres().running()) if options.postgres else None
        workspace = stack.enter_context(Workspace.create(folder, url))
        cell = filled(workspace, options.items)
        name = "PostgreSQL" if options.postgres else "SQLite"
        print(f"{options.items} measurement sets, {name}; median of 9, ms: clock, CPU; bare SQL")
        for what, (query, bare) in PAGES.items():
            asked_for = query if query.linked is None else ItemQuery(linked=("cell", cell))
            wall, cpu = timed(lambda q=asked_for: items.search(workspace, MEASUREMENT, q))  # type: ignore[misc]
            total = items.search(workspace, MEASUREMENT, asked_for).total
            floor = ""
            if bare and url is None:
                bare = bare.replace("latest AND NOT deleted", "latest = 1 AND deleted = 0")
            if bare:
                with workspace.engine.connect() as connection:
                    floor = (
                        f"{1e3 * timed(lambda b=bare: connection.execute(text(b)).all())[0]:8.1f}"  # type: ignore[misc]
                    )
            print(f"{what:>30} {1e3 * wall:8.1f} {1e3 * cpu:8.1f} {floor:>8}   {total} found")
        made = measurements.add(workspace, poses(options.items), name="large")
        print(f"one set of {options.items} poses, Parquet")
        for what, rows in {
            "first 50": RowQuery(),
            "station = 3, by x": RowQuery(where=(("station", "==", 3.0),), sort="-position_x"),
        }.items():
            wall, cpu = timed(lambda r=rows: measurements.some_rows(workspace, made, r))  # type: ignore[misc]
            print(f"{what:>30} {1e3 * wall:8.1f} {1e3 * cpu:8.1f}")


if __name__ == "__main__":
    main()
