"""Writes the files of a simulated pass as a user would have them.

``python -m robotrue_reproductions.jin2022 FOLDER`` writes ``cell.toml``, the windows of the printed
pass (``windows.csv``) and of another (``unseen.csv``), the response of the hammer test
(``frf.csv``), and eight seconds of the cut as recorded (``force.csv``, ``joints.csv``). Everything
is SIMULATED and marked so in its files.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.provenance import mark_line
from robotrue.core.units import DEG
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.formats.column_table import table_bytes
from robotrue.dynamics.formats.dynamics_csv import write_windows
from robotrue.dynamics.formats.signal_table import write_force_csv
from robotrue.dynamics.oscillators import join_oscillators
from robotrue.dynamics.pose_modes import pose_modes
from robotrue.simulation.milling_arm import FEED, RATE, milling_robot, pass_joints
from robotrue_reproductions.jin2022.milling_experiment import MillingExperiment, milling_experiment
from robotrue_reproductions.jin2022.milling_pass import pass_force, read_force
from robotrue_reproductions.jin2022.raw_records import ORIGIN, write_cell

ARM: Final = 3
UNSEEN: Final = 4
SECONDS: Final = 8.0
HOME: Final = 0.25
"""m along the pass where the hammer struck."""


def write_lab(folder: Path, arm: int) -> None:
    """Writes the files of an arm into a folder.

    Raises:
        FormatError: A file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = milling_experiment(arm, (0, UNSEEN))
    write_cell(folder / "cell.toml", made.arm)
    first = made.windows.pass_index == 0
    write_windows(folder / "windows.csv", made.windows.take(first))
    write_windows(folder / "unseen.csv", made.windows.take(~first))
    _write_response(folder / "frf.csv", made)
    _write_cut(folder, made)


def _write_response(path: Path, made: MillingExperiment) -> None:
    """All nine pairs at mid-pass, unloaded, from 4 to 2,800 Hz, with the static row of 0 Hz."""
    own = join_oscillators(
        [pose_modes(made.arm.arm, pass_joints(np.array([HOME]))[0]).oscillators(), made.arm.tool]
    )
    lines = np.concatenate([[0.0], np.arange(4.0, 2800.0, 0.5)])
    response = own.response(lines)
    names, columns = ["f_Hz"], [lines]
    for i, moved in enumerate("xyz"):
        for j, pushed in enumerate("xyz"):
            names += [f"G{moved}{pushed}_re_m_per_N", f"G{moved}{pushed}_im_m_per_N"]
            columns += [response[:, i, j].real, response[:, i, j].imag]
    table = table_bytes(names, np.column_stack(columns))
    path.write_bytes(mark_line(ORIGIN).encode() + table)


def _write_cut(folder: Path, made: MillingExperiment) -> None:
    """Force and joints of a stretch in the middle of the pass."""
    rng = np.random.default_rng([made.seed, 9])
    count = round(SECONDS * RATE)
    force = read_force(made.tools, pass_force(made.tools, count, rng), rng)
    record = ForceRecord(start=0.0, rate=RATE, force=force, source="simulated", provenance=ORIGIN)
    write_force_csv(folder / "force.csv", record)
    time = np.arange(-10, round(250.0 * SECONDS) + 10) / 250.0
    robot = milling_robot()
    joints = pass_joints(HOME + FEED * time)
    shown = robot.controller.to_controller(joints)
    names = ["t_s", *(f"a{k + 1}_deg" for k in range(joints.shape[1]))]
    table = table_bytes(names, np.column_stack([time, shown / DEG]))
    (folder / "joints.csv").write_bytes(mark_line(ORIGIN).encode() + table)


if __name__ == "__main__":
    write_lab(Path(sys.argv[1]), ARM)
