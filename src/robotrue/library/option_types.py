"""Options of the library's functions; made by ``scripts/library_options.py``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypedDict


class CalibrateOptions(TypedDict, total=False):
    """Further options of ``calibrate``."""

    method: Literal["auto", "nominal", "geometric", "elastic", "ripple", "gp"]
    mapping: str | Path | None
    cure: str | None
    table: str | Path | None
    report: str | Path | None


class TransferOptions(TypedDict, total=False):
    """Further options of ``transfer``."""

    mapping: str | Path | None
    report: str | Path | None
    curve: bool
    method: Literal["auto", "deng2022"]
    sub_spaces: int | None
    source_region: str | None
    target_region: str | None
    attitude: Literal["turning", "fixed"]
    rounds: int
    boosting: Literal["corrected", "literal"]
    reading: str | Sequence[str]


class ValidateOptions(TypedDict, total=False):
    """Further options of ``validate``."""

    mapping: str | Path | None
    report: str | Path | None


class CompensateOptions(TypedDict, total=False):
    """Further options of ``compensate``."""

    part: str | None
    wrench: str | None
    force: str | Path | None
    temperature_degC: float | None
    time_s: float | None
    e1_mm: float | None
    cutter: str | None
    start: str | None
    free_spin: bool
    axis_targets: bool
    max_shift_mm: float
    max_step_mm: float
    allow_steps: bool
    workers: int | None
    dask: str | None
    split_um: float | None
    split_limit: int
    deviation: bool
    verbose: bool


class PlanOptions(TypedDict, total=False):
    """Further options of ``plan``."""

    poses: int
    region: str | None
    program: str | Path | None
    within: str | None
    payloads: str | Sequence[str]
    approach: Literal["one-side", "as-it-comes"]
    criterion: Literal["I", "D"]
    tolerance_um: float
    recorded: str | Path | None
    candidates: int
    seed: int
    krl: str | Path | None
    trigger_output: int
    report: str | Path | None
