"""How often the 95 % band of a pass holds, and how often it would by chance. SIMULATED.

    python benchmarks/dynamic_band.py FOLDER [--arms 1-20] [--raw 5,13]

Each arm mills six passes; each pass is held out and the other five learned from. Three tables of
windows: the zero of the dynamometer *kept*, drifting along each pass; *taken*, its line taken off
and a bow of 0.05 N left; and *raw*, both done by ``robotrue dynamics windows`` from the records of
every instrument (a minute of CPU per arm). What is done stands in FOLDER and is not done again.

A window is no test of its own: neighbours share their error. Beside each pass stands what a band
that is right would hold, drawn from the errors as the model has them together.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.stats import binom

from robotrue.cli.main import app
from robotrue.core.units import UM
from robotrue.dynamics.deviation import fit_deviation
from robotrue.dynamics.deviation_physics import (
    CompliantArm,
    StaticCompliance,
    compliance_of,
    static_compliance,
)
from robotrue.dynamics.deviation_validation import TWO_SIDED_95, share_by_chance
from robotrue.dynamics.formats.dynamics_csv import read_windows, write_windows
from robotrue.dynamics.formats.frf_table import read_frf
from robotrue.dynamics.interpolation import fit_curve
from robotrue.dynamics.window_folds import folds
from robotrue.dynamics.windows import WindowSet
from robotrue.simulation.milling_arm import milling_arm
from robotrue_reproductions.jin2022.jin_tables import arm_of
from robotrue_reproductions.jin2022.milling_experiment import milling_experiment
from robotrue_reproductions.jin2022.milling_pass import SHIFTS, tooling
from robotrue_reproductions.jin2022.raw_records import BOW, write_cell, write_hammer, write_raw_pass

LOW: Final = 0.88
"""Share of a pass below which it is counted."""
_Line = dict[str, float | str]


def main() -> None:
    """Does what is missing, and prints the table of what is there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--arms", default="1-20")
    parser.add_argument("--raw", default="")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    first, _, last = options.arms.partition("-")
    arms = range(int(first), int(last or first) + 1)
    wanted = [(source, seed) for seed in arms for source in ("kept", "taken")]
    wanted += [("raw", int(seed)) for seed in options.raw.split(",") if seed]
    log = options.folder / "folds.jsonl"
    done = {(line["source"], line["arm"]) for line in _read_lines(log)}
    for source, seed in wanted:
        if (source, seed) in done:
            continue
        start = time.process_time()
        windows, row = _windows_of(options.folder, source, seed)
        with log.open("a", encoding="utf-8") as file:
            for line in judge_passes(windows, arm_of(milling_arm(seed)), row):
                file.write(json.dumps({"source": source, "arm": seed, **line}) + "\n")
        print(f"{source} {seed}: {time.process_time() - start:.1f} s of CPU", flush=True)
    for source in ("kept", "taken", "raw"):
        _print_table(source, [line for line in _read_lines(log) if line["source"] == source])


def judge_passes(windows: WindowSet, arm: CompliantArm, row: StaticCompliance) -> Iterator[_Line]:
    """Yields share, error and what chance does of every pass held out."""
    for train, test in folds(windows, "passes"):
        held = windows.take(test)
        model = fit_deviation(windows.take(train), arm, row=row)
        found = model.predict(held)
        miss = found.error - held.measured
        share = float((np.abs(miss) <= TWO_SIDED_95 * found.sd).mean())
        chance = share_by_chance(model.predict_covariance(held))
        yield {
            "pass": held.passes[0],
            "share": share,
            "rmse_um": float(np.sqrt((miss**2).mean())) / UM,
            "sd_um": float(np.sqrt((found.sd**2).mean())) / UM,
            "effective": chance.effective,
            "low_by_chance": chance.below(LOW),
            "as_low_by_chance": chance.below(share + 1e-9),
            "drift_N": model.sizes["drift_N"],
        }


def _windows_of(folder: Path, source: str, seed: int) -> tuple[WindowSet, StaticCompliance]:
    """Windows of all passes of an arm, and the static row they were predicted with."""
    if source == "raw":
        return _raw_windows(folder / f"raw-{seed}", seed)
    table, truth = folder / f"arm-{seed}.csv", folder / f"arm-{seed}.npz"
    if not truth.exists():
        made = milling_experiment(seed)
        write_windows(table, made.windows)
        np.savez(truth, zero=made.zero, row=-made.hammer[0].real)
    windows = read_windows(table)
    with np.load(truth) as known:
        zero, row = known["zero"], known["row"]
    if source == "kept":
        return windows, static_compliance(row)
    off = zero - _bow(windows, seed)
    return replace(
        windows,
        force=windows.force - off,
        force_mean=windows.force_mean - off[:, 1],
        predicted=windows.predicted - off @ row,
        zero_taken=np.ones(len(windows), dtype=bool),
    ), static_compliance(row)


def _bow(windows: WindowSet, seed: int) -> np.ndarray:
    """What no line through both ends takes off (n, 3) N: most in the middle of a pass."""
    drawn = BOW * np.random.default_rng([seed, 77]).standard_normal((len(SHIFTS), 3))
    member = windows.pass_index
    part = np.concatenate([(np.arange(n) + 0.5) / n for n in np.bincount(member)])
    return np.asarray(drawn[member] * (4.0 * part * (1.0 - part))[:, None])


def _raw_windows(folder: Path, seed: int) -> tuple[WindowSet, StaticCompliance]:
    """Windows that the command cuts out of raw records, pass after pass."""
    arm, tools = milling_arm(seed), tooling(seed)
    folder.mkdir(exist_ok=True)
    write_cell(folder / "cell.toml", arm)
    write_hammer(folder / "frf.csv", arm, seed)
    whole = folder / "windows.csv"
    for which in range(len(SHIFTS)):
        records = write_raw_pass(folder, arm, tools, seed, which)
        onto = ["--onto", str(whole)] if which else []
        output = folder / f"passes-{which + 1}.csv"
        app(["dynamics", "windows", *records, *onto, "-o", str(output)], standalone_mode=False)
        output.replace(whole)
    for record in folder.glob("*.mat"):
        record.unlink()
    curve = fit_curve(read_frf(folder / "frf.csv"), "auto")
    return read_windows(whole), compliance_of(curve, np.array([0.0, -1.0, 0.0]))


def _read_lines(log: Path) -> list[_Line]:
    text = log.read_text(encoding="utf-8") if log.exists() else ""
    return [json.loads(line) for line in text.splitlines()]


def _print_table(source: str, lines: list[_Line]) -> None:
    """What a source holds over its arms and passes."""
    if not lines:
        return
    column = {name: np.array([line[name] for line in lines]) for name in lines[0]}
    share = column["share"]
    seeds = {line["arm"] for line in lines}
    arms = [float(share[column["arm"] == seed].mean()) for seed in seeds]
    number = float(np.median(column["effective"]))
    low, high = binom.ppf([0.025, 0.975], round(number), 0.95) / round(number)
    rarest = float(column["as_low_by_chance"].min())
    print(f"\nSIMULATED, zero {source}: {len(arms)} arms, {len(share)} passes held out")
    print(f"  rms um                          {np.sqrt((column['rmse_um'] ** 2).mean()):.2f}")
    print(f"  in the band, mean               {100 * share.mean():.1f} %")
    print(f"  of an arm                       {100 * min(arms):.1f} to {100 * max(arms):.1f} %")
    print(f"  least of a pass                 {100 * share.min():.1f} %")
    print(f"  effective windows, median       {number:.1f} of 93")
    print(f"  binomial of so many, 95 %       {100 * low:.0f} to {100 * high:.0f} %")
    print(f"  passes under 88 %               {(share < LOW).sum()}")
    print(f"  expected by chance              {column['low_by_chance'].sum():.1f}")
    print(f"  rarest pass, by chance          {100 * rarest:.2f} %")
    print(f"  one as rare among all of them   {100 * (1 - (1 - rarest) ** len(share)):.0f} %")


if __name__ == "__main__":
    main()
