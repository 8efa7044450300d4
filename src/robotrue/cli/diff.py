"""``robotrue diff``: what one program changes of another, target by target."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.force_options import read_force_options
from robotrue.app.outputs import check_output
from robotrue.app.program_differences import differences
from robotrue.app.registered import opened, provenance_used
from robotrue.cli.console import emit_json, emit_table, say, say_mark
from robotrue.compensation.difference import Change, Difference
from robotrue.compensation.stance import start_joints
from robotrue.core.arrays import Array
from robotrue.core.csv_text import csv_text
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.validation.error_map import radius_95

SHOWN: Final = 20
"""Rows of the printed table: those that moved most."""
COLUMNS: Final = (
    "file", "line", "line_after", "status", "shift_x_um", "shift_y_um", "shift_z_um", "shift_um",
    "turn_deg", "error_before_um", "error_after_um", "bound_95_um",
)  # fmt: skip


def run(
    first: Path,
    second: Path,
    *,
    model_path: Path | None,
    registered: Path | None,
    output: Path | None,
    as_json: bool,
    wrench: str | None = None,
    force: Path | None = None,
    cutter: str | None = None,
    start: str | None = None,
) -> None:
    """Compares two programs; writes every target as CSV on request."""
    sources = [p for p in (first, second, model_path, registered, force) if p is not None]
    if output is not None:
        check_output(output, sources)
    cell, model = (None, None) if model_path is None else opened(model_path, registered)
    if cell is None and (wrench or force):
        raise ConfigurationError(
            "a process force without --model: errors are not predicted.", hint="--model MODEL"
        )
    stated = np.empty(0) if cell is None else read_force_options(cell, wrench, force, cutter)
    home = np.empty(0) if cell is None else start_joints(cell.robot, cell.controller.start, start)
    found = differences(first, second, cell, model, stated, home)
    rows = [row for name, one in found for row in _rows(name, one)]
    origin = None if cell is None else provenance_used(cell, model)
    say_mark(origin)
    if output is not None:
        write_atomic(output, mark_line(origin).encode() + _csv(rows))
        say(f"{len(rows)} targets written to {output}")
    if as_json:
        emit_json({"files": [{"file": name, **one.summary()} for name, one in found]}, origin)
        return
    for name, one in found:
        _show(name, one, origin)


def _rows(name: str, found: Difference) -> list[dict[str, Any]]:
    size = np.linalg.norm(found.shift, axis=1)
    before, after, bound = _errors(found)
    return [
        {
            "file": name,
            "line": int(found.line[i]),
            "line_after": int(found.line_after[i]),
            "status": Change(int(found.change[i])).name.lower(),
            **dict(zip(COLUMNS[4:7], (found.shift[i] / UM).tolist(), strict=True)),
            "shift_um": size[i] / UM,
            "turn_deg": found.turn[i] / DEG,
            "error_before_um": before[i] / UM,
            "error_after_um": after[i] / UM,
            "bound_95_um": bound[i] / UM,
        }
        for i in range(len(size))
    ]


def _errors(found: Difference) -> tuple[Array, Array, Array]:
    """Length (n,) m of the error before and after, and the radius that holds 95 % about it."""
    n = len(found.change)
    if not found.has_errors:
        nothing = np.full(n, np.nan)
        return nothing, nothing, nothing
    bound = np.full(n, np.nan)
    known = np.isfinite(found.covariance).all(axis=(1, 2))
    bound[known] = radius_95(found.covariance[known])
    before, after = (np.linalg.norm(e, axis=1) for e in (found.error_before, found.error_after))
    return before, after, bound


def _csv(rows: Sequence[dict[str, Any]]) -> bytes:
    return csv_text([COLUMNS, *([_cell(row[name]) for name in COLUMNS] for row in rows)]).encode()


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if np.isfinite(value) else ""
    return str(value)


def _show(name: str, found: Difference, origin: Provenance | None) -> None:
    size = np.nan_to_num(np.linalg.norm(found.shift, axis=1))
    before, after, bound = _errors(found)
    order = np.argsort(-size, kind="stable")[:SHOWN]
    known = found.has_errors
    emit_table(
        f"{name}: {len(size)} targets, those that moved most",
        ("line", "shift mm", "x mm", "y mm", "z mm", "turn deg")
        + (("before mm", "after mm", "95 % mm") if known else ()),
        [
            [
                str(int(found.line[i])),
                *(f"{v / MM:.4f}" for v in (size[i], *np.nan_to_num(found.shift[i]))),
                f"{found.turn[i] / DEG:.4f}",
                *((f"{v / MM:.4f}" for v in (before[i], after[i], bound[i])) if known else ()),
            ]
            for i in order.tolist()
            if found.change[i] == Change.MOVED
        ],
        provenance=origin,
    )
    number = np.bincount(found.change, minlength=len(Change))
    said = ", ".join(f"{number[c]} {c.name.lower()}" for c in Change if number[c])
    say(f"{name}: {said}")
    if known and np.isfinite(after).any():
        say(
            f"{name}: predicted error {np.nanmean(before) / UM:.0f} um mean before, "
            f"{np.nanmean(after) / UM:.1f} um after, within {np.nanmax(bound) / UM:.0f} um with "
            "95 % at the worst target"
        )
