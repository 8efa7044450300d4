"""A milling pass made by hand: every window of it is known before anything reads it.

3000 rpm, force at 2 kHz, laser at 1 kHz, joints at 100 Hz; a second of air, a tenth of a second of
entry at half the force, twelve seconds of cutting, exit and air. The response is a spring.
"""

from pathlib import Path

import numpy as np

from robotrue.core.csv_text import csv_text
from robotrue.core.units import DEG, UM
from robotrue.robot.forward import forward
from robotrue.simulation.milling_arm import FEED, milling_robot, pass_joints

RATE, LASER_RATE, JOINT_RATE, SPINDLE = 2000.0, 1000.0, 100.0, 50.0
TURN = 40
SECONDS, ENTRY, STEADY, LEAVING, END = 14.2, 1.0, 1.1, 13.1, 13.2
SPRING = np.array([[0.9, 0.2, 0.0], [0.2, 1.1, 0.1], [0.0, 0.1, 0.5]]) * UM
DIRECTION = np.array([0.0, -1.0, 0.0])
ZERO = np.array([0.8, -0.6, 0.4])
DRIFT = np.array([0.05, 0.08, -0.03])
"""N, N/s of the dynamometer."""
START = 0.1
"""m along the line where the force record begins."""
ROBOT = milling_robot()
CELL = 'schema = 1\n\n[robot]\npreset = "irb6660"\n\n[tool]\nxyz_mm = [320, 0, 160]\n'


def force_time():
    return np.arange(round(SECONDS * RATE)) / RATE


def force_on_tool():
    """(n, 3) N in base: half a sine a tooth, two teeth that differ, growing slowly."""
    k = np.arange(len(force_time()))
    tooth = np.maximum(np.sin(2.0 * np.pi * (k % 20) / 20.0), 0.0) * np.where(k % 40 < 20, 1.0, 0.9)
    shape = np.column_stack([-60.0 * tooth, -70.0 * tooth + 25.0, 8.0 * tooth])
    grown = 1.0 + 0.004 * np.floor(k / TURN / 7.0) / 10.0
    return shape * (grown * share())[:, None]


def share():
    """Part of the tool that cuts, at the samples of the force: known by their number."""
    k = np.arange(len(force_time()))
    out = np.zeros(len(k))
    out[(k >= 2000) & (k < 26400)] = 0.5
    out[(k >= 2200) & (k < 26200)] = 1.0
    return out


def joints_at(time, start=START):
    return pass_joints(start + FEED * np.asarray(time))


def edge_of(place):
    """The straight-edge (n,) m at places along the line."""
    return 5 * UM + 300e-6 * place


def laser_time():
    return np.arange(round(SECONDS * LASER_RATE)) / LASER_RATE


def cut_error():
    """(n,) m of the laser, less the straight-edge."""
    k = np.arange(len(laser_time()))
    bump = 20 * UM + 12 * UM * np.sin(2.0 * np.pi * (k % 20) / 20.0) + 0.3 * UM * (k // 1000)
    return np.where((k >= 1000) & (k < 13200), bump, 0.0)


def windows_by_hand(seconds=1.0):
    """Columns of the table: joints deg, force N, peak, mean, predicted um, measured um."""
    rows = []
    force, bent = force_on_tool(), force_on_tool() @ SPRING.T @ DIRECTION
    seen, joints = cut_error(), joints_by_sample()
    n, m = round(seconds * RATE), round(seconds * LASER_RATE)
    for k in range(int(12.0 / seconds + 1e-9)):
        one = slice(2200 + k * n, 2200 + (k + 1) * n)
        two = slice(1100 + k * m, 1100 + (k + 1) * m)
        push = np.abs(force[one] @ DIRECTION).reshape(-1, 40).max(axis=1).mean()
        rows.append(
            [
                *joints[one].mean(axis=0) / DEG,
                *force[one].mean(axis=0),
                push,
                (force[one] @ DIRECTION).mean(),
                bent[one].reshape(-1, 40).max(axis=1).mean() / UM,
                seen[two].reshape(-1, 20).max(axis=1).mean() / UM,
            ]
        )
    return np.array(rows)


def joints_by_sample():
    """(n, 6) rad at the samples of the force, straight between those of the controller."""
    clock = joint_time()
    table = joints_at(clock)
    return np.column_stack([np.interp(force_time(), clock, q) for q in table.T])


def joint_time():
    return np.arange(-50, round((SECONDS + 0.5) * JOINT_RATE)) / JOINT_RATE


def spindle_angle(time):
    return 0.7 + 2.0 * np.pi * SPINDLE * time


def reading(carried="base"):
    """(n, 3) N of the dynamometer: turned sensor axes -y, x, z, its zero on top."""
    time, force = force_time(), force_on_tool()
    if carried != "base":
        R = forward(ROBOT, joint_rows())[:, :3, :3]
        force = np.einsum("nji,nj->ni", R, force)
    if carried == "spindle":
        a = spindle_angle(time)
        x, y = force[:, 0].copy(), force[:, 1].copy()
        force[:, 0], force[:, 1] = np.cos(a) * x + np.sin(a) * y, np.cos(a) * y - np.sin(a) * x
    turned = np.column_stack([-force[:, 1], force[:, 0], force[:, 2]])
    return turned + ZERO + DRIFT * time[:, None]


def joint_rows():
    """One pose: the line keeps the attitude to rounding, which stays out of the truth."""
    return np.tile(joints_at([0.0]), (len(force_time()), 1))


def write_table(path, names, table):
    """A table of named columns as CSV, TDMS, MAT or UFF, by the suffix of the path."""
    path = Path(path)
    if path.suffix == ".csv":
        rows = [list(names), *([repr(float(v)) for v in row] for row in np.asarray(table))]
        path.write_text(csv_text(rows))
    elif path.suffix == ".mat":
        from scipy.io import savemat

        savemat(path, dict(zip(names, np.asarray(table).T, strict=True)))
    elif path.suffix == ".uff":
        columns = np.asarray(table).T
        step = float(round((columns[0][-1] - columns[0][0]) / (len(columns[0]) - 1), 9))
        sets = zip(names[1:], columns[1:], strict=True)
        path.write_text("".join(uff_set(*one, columns[0][0], step) for one in sets))
    else:
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(path) as writer:
            writer.write_segment(
                [
                    ChannelObject("record", name, np.asarray(column), properties=_unit(name))
                    for name, column in zip(names, np.asarray(table).T, strict=True)
                ]
            )


def uff_set(name, values, start, step, *, kind=None, direction=None, unit=None, uneven=None):
    """A time history as dataset 58 prints it: double, ASCII. A force is told by its type alone."""
    force = len(name) == 4 and name.endswith("_N")
    kind = (13 if force else 1) if kind is None else kind
    direction = ("xyz".index(name[1]) + 1 if force else 0) if direction is None else direction
    unit = ("N" if force else "") if unit is None else unit
    title = f"channel {direction}" if force else name
    values = np.asarray(values, dtype=float)
    head = [
        "    -1", "    58", title, "NONE", "23-Nov-26 12:00:00", "NONE", "NONE",
        f"{1:5d}{0:10d}{1:5d}{0:10d} {'NONE':10s}{1:10d}{direction:4d} {'NONE':10s}{0:10d}{0:4d}",
        f"{4:10d}{len(values):10d}{int(uneven is None):10d}{start:13.5E}{step:13.5E}{0.0:13.5E}",
    ]  # fmt: skip
    for type_, label in ((17, "s"), (kind, unit), (0, "NONE"), (0, "NONE")):
        head.append(f"{type_:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {label:20s}")
    if uneven is None:
        cells = [f"{v:20.12E}" for v in values]
        rows = ["".join(cells[k : k + 4]) for k in range(0, len(cells), 4)]
    else:
        rows = [f"{t:13.5E}{v:20.12E}" for t, v in zip(uneven, values, strict=True)]
    return "\n".join([*head, *rows, "    -1", ""])


def _unit(name):
    return {"unit_string": "N"} if name.endswith("_N") else {}


def write_pass(folder, suffix=".csv", carried="base"):
    """Writes all records of the pass; returns the arguments of ``dynamics windows``."""
    time, moved = force_time(), joint_time()
    write = lambda name, names, table: write_table(folder / f"{name}{suffix}", names, table)  # noqa: E731
    write("force", ("t_s", "fx_N", "fy_N", "fz_N"), np.column_stack([time, reading(carried)]))
    names = tuple(f"j{k}_deg" for k in range(1, 7))
    write("joints", ("t_s", *names), np.column_stack([moved, joints_at(moved) / DEG]))
    shown = laser_time()
    laser = edge_of(START + FEED * shown) + cut_error()
    write("laser", ("t_s", "d_um"), np.column_stack([shown, laser / UM]))
    # the dry run starts elsewhere on the line, on a clock of its own
    dry = np.arange(0.0, 20.0, 1.0 / LASER_RATE)
    edge = edge_of(START - 0.01 + FEED * dry)
    write("dry_laser", ("t_s", "d_mm"), np.column_stack([dry + 40.0, edge * 1e3]))
    clock = np.arange(0.0, 20.0, 1.0 / JOINT_RATE)
    dried = joints_at(clock, START - 0.01) / DEG
    write("dry_joints", ("t_s", *names), np.column_stack([clock + 40.0, dried]))
    turning = np.degrees(spindle_angle(time))
    write("angle", ("t_s", "angle_deg"), np.column_stack([time, turning]))
    write_response(folder / "frf.csv")
    (folder / "cell.toml").write_text(CELL)
    return [
        folder / f"force{suffix}", "--cell", folder / "cell.toml",
        "--joints", folder / f"joints{suffix}", "--frf", folder / "frf.csv",
        "--spindle-rpm", 3000, "--laser", folder / f"laser{suffix}",
        "--dry-laser", folder / f"dry_laser{suffix}",
        "--dry-joints", folder / f"dry_joints{suffix}",
        "-o", folder / "windows.csv", "--sensor-axes=-y,x,z", "--between", "lines",
        "--carried-by", carried,
        *(["--spindle-angle", folder / f"angle{suffix}"] if carried == "spindle" else []),
    ]  # fmt: skip


def write_response(path):
    """A spring: the same receptance from 0 to beyond what the force's samples hold."""
    lines = np.arange(0.0, 1201.0, 1.0)
    names, columns = ["f_Hz"], [lines]
    for i, moved in enumerate("xyz"):
        for j, pushed in enumerate("xyz"):
            names += [f"G{moved}{pushed}_re_m_per_N", f"G{moved}{pushed}_im_m_per_N"]
            columns += [np.full(len(lines), SPRING[i, j]), np.zeros(len(lines))]
    write_table(path, names, np.column_stack(columns))
