"""A day of the service replayed at speed: memory, losses, kills survived, samples per CPU-second.

    python benchmarks/replay_day.py --folder /somewhere/with/25GB [--hours 24] [--kills 3]

Joints at 250 Hz and force at 1 kHz, simulated, 30 s repeated; static and dynamic part, everything
recorded. The process is killed (SIGKILL) at moments chosen by a seed within the first fifth and
started again with --resume; from a quarter of the day on its memory is watched. Then the record is
read frame by frame: every sample and every estimate once and in order, and the first part equal
bit for bit to that of a run nobody disturbed.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from robotrue.online.record import StreamRecord, segments
from robotrue.online.record_frames import Kind

PERIOD, JOINT_RATE, FORCE_RATE = 30, 250, 1000
CELL = """schema = 1
[robot]
preset = "KUKA KR160 R1570"
stiffness_Nm_per_rad = [1.75e6, 1.72e6, 1.95e6, 3.73e5, 2.11e5, 1.74e5]
[tool]
xyz_mm = [320, 0, 160]
"""
HOME = (-20.0, -95.0, 105.0, 5.0, 70.0, -8.0)
MODES = ((14.0, 0.03, 4.0e6), (52.0, 0.03, 9.0e6), (310.0, 0.04, 1.2e7))
"""Hz, damping ratio, N/m, the same along x, y and z."""
FLAT_MB_PER_H = 0.1
"""Memory that grows by less than this over the second half of the day does not grow: what is left
is the allocator's own to and fro, of a few pages."""
BYTES = 240.0
"""Of the record per force sample, about; to choose the moments of the kills."""


def inputs(folder: Path) -> None:
    (folder / "cell.toml").write_text(CELL)
    t = np.arange(PERIOD * JOINT_RATE) / JOINT_RATE
    swing = np.sin(2.0 * np.pi * t[:, None] / PERIOD * np.arange(1, 7))
    joints = np.array(HOME) + np.array([3, 2, 2, 4, 3, 5]) * swing
    names = ",".join(f"a{k}_deg" for k in range(1, 7))
    table(folder / "joints.csv", f"t_s,{names}", np.column_stack([t, joints]))
    t = np.arange(PERIOD * FORCE_RATE) / FORCE_RATE
    teeth = 40.0 * np.sin(2.0 * np.pi * 120.0 * t[:, None] + np.arange(3.0))
    noise = 0.5 * np.random.default_rng(0).standard_normal(teeth.shape)
    force = np.array([-30.0, 60.0, 20.0]) + teeth + noise
    table(folder / "force.csv", "t_s,fx_N,fy_N,fz_N", np.column_stack([t, force]))
    f = np.arange(4.0, 450.0, 0.5)
    g = sum(1.0 / k / (1.0 - (f / f0) ** 2 + 2j * z * f / f0) for f0, z, k in MODES)
    names = ",".join(f"G{a}{a}_re_m_per_N,G{a}{a}_im_m_per_N" for a in "xyz")
    columns = np.column_stack([f, *(part for _ in "xyz" for part in (g.real, g.imag))])
    table(folder / "frf.csv", f"f_Hz,{names}", columns, "%.9e")


def table(path: Path, header: str, rows: np.ndarray, how: str = "%.6f") -> None:
    np.savetxt(path, rows, fmt=how, delimiter=",", header=header, comments="")


def command(folder: Path, record: Path, repeats: int) -> list[str]:
    play = f"?repeat={repeats}&period={PERIOD}s"
    return [
        *(sys.executable, "-c", "from robotrue.cli.main import run; run()", "sense"),
        *(str(folder / "cell.toml"), "--robot", f"replay://{folder / 'joints.csv'}{play}"),
        *("--force", f"replay://{folder / 'force.csv'}{play}", "--record", str(record)),
        *("--frf", str(folder / "frf.csv"), "--frf-frame", "base", "--frf-joints"),
        *(",".join(map(str, HOME)), "--resume", "--json"),
    ]


def run(call: list[str], record: Path, kill_at: float, seen: list[tuple[float, int]]) -> float:
    """CPU seconds of one process; killed once the record has so many bytes."""
    before = os.times()
    with subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        while process.poll() is None:
            time.sleep(0.5)
            size = sum(p.stat().st_size for p in segments(record)) if record.exists() else 0
            seen.append((size, memory(process.pid)))
            if len(seen) % 60 == 0:
                print(f"# {size / 1e9:.2f} GB, RSS {seen[-1][1] / 1024:.1f} MB", file=sys.stderr)
            if size >= kill_at:
                process.send_signal(signal.SIGKILL)
                process.wait()
        said = process.stderr.read().decode() if process.stderr else ""
        if process.returncode not in (0, -signal.SIGKILL):
            raise SystemExit(said)
    after = os.times()
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )


def memory(pid: int) -> int:
    """Resident kB."""
    try:
        text = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    return next((int(x.split()[1]) for x in text.splitlines() if x.startswith("VmRSS")), 0)


def growth(seen: list[tuple[float, float]]) -> float:
    """Slope in MB per hour of a straight line through (h, MB)."""
    hours, size = np.array(seen).T
    return float(np.polyfit(hours, size, 1)[0])


def checked(record: Path, first: int) -> tuple[dict[str, int], str]:
    """Rows by stream, each once and in order, and the hash of the first estimates."""
    rows = {"joints": 0, "force": 0, "estimates": 0}
    digest = hashlib.sha256()
    kinds = {Kind.JOINTS: "joints", Kind.FORCE: "force", Kind.ESTIMATES: "estimates"}
    for frame in StreamRecord(record).frames(kinds):
        name, block = kinds[frame.kind], frame.content
        begin = rows[name]
        if not np.array_equal(block.sequence, np.arange(begin, begin + len(block))):
            raise SystemExit(f"{name}: rows {begin}... are not in order")
        if name == "estimates" and begin < first:
            left = slice(first - begin)
            for column in ("host_time", "error", "sd", "static", "wrench", "joints", "doubt"):
                for row in getattr(block, column)[left]:
                    digest.update(row.tobytes())
        rows[name] += len(block)
    return rows, digest.hexdigest()


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--folder", type=Path, required=True)
    options.add_argument("--hours", type=float, default=24.0)
    options.add_argument("--kills", type=int, default=3)
    options.add_argument("--compared-minutes", type=float, default=10.0)
    told = options.parse_args()
    folder: Path = told.folder
    folder.mkdir(parents=True, exist_ok=True)
    inputs(folder)
    repeats = round(told.hours * 3600 / PERIOD)
    forces, joints = repeats * PERIOD * FORCE_RATE, repeats * PERIOD * JOINT_RATE
    compared = min(forces, round(told.compared_minutes * 60) * FORCE_RATE)
    for name in ("day", "calm"):
        shutil.rmtree(folder / name, ignore_errors=True)
    calm = command(folder, folder / "calm", max(1, compared // (PERIOD * FORCE_RATE)))
    cpu_calm = run(calm, folder / "calm", np.inf, [])
    _, wanted = checked(folder / "calm", compared)

    day = folder / "day"
    moments = np.sort(np.random.default_rng(1).uniform(0.02, 0.2, told.kills)) * forces * BYTES
    seen: list[tuple[float, int]] = []
    cpu, killed = 0.0, 0
    begun = time.monotonic()
    for moment in [*moments.tolist(), np.inf]:
        seen = []
        cpu += run(command(folder, day, repeats), day, moment, seen)
        killed += moment < np.inf
    wall = time.monotonic() - begun
    size = sum(p.stat().st_size for p in segments(day))
    rows, found = checked(day, compared)
    late = [(s / size, m) for s, m in seen if s >= 0.25 * size and m]
    quarter = np.median([m for s, m in late if s < 0.35])
    end = np.median([m for s, m in late if s > 0.90])
    print(f"simulated input: {told.hours:g} h, joints {JOINT_RATE} Hz, force {FORCE_RATE} Hz")
    print(f"samples in         joints {joints}, force {forces}")
    print(f"samples recorded   joints {rows['joints']}, force {rows['force']}")
    print(f"estimates recorded {rows['estimates']}")
    lost = joints - rows["joints"] + 2 * forces - rows["force"] - rows["estimates"]
    print(f"lost               {lost}")
    print(f"kills survived     {killed} (SIGKILL), record {size / 1e9:.2f} GB")
    print(f"first {compared} estimates equal an undisturbed run bit for bit: {found == wanted}")
    print(f"CPU                {cpu:.0f} s, wall {wall:.0f} s, all starts included")
    print(f"samples / CPU-s    {(forces + joints) / cpu:.0f} (force and joints)")
    print(f"calm run           {cpu_calm:.1f} CPU-s for {compared} force samples, start included")
    print(f"RSS 25-35 %        {quarter / 1024:.1f} MB (median)")
    print(
        f"RSS 90-100 %       {end / 1024:.1f} MB (median), growth {(end - quarter) / 1024:+.1f} MB"
    )
    print(f"RSS peak from 25 % {max(m for _, m in late) / 1024:.1f} MB")
    slope = growth([(s / size * told.hours, m / 1024) for s, m in seen if s >= 0.5 * size and m])
    verdict = "none" if slope < FLAT_MB_PER_H else "grows"
    print(
        f"RSS slope          {slope:+.3f} MB per hour of the day, straight line over its second "
        f"half: {verdict} (none: below {FLAT_MB_PER_H:g})"
    )


if __name__ == "__main__":
    main()
