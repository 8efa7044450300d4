"""Write cell.toml from the open RoboDK station, and bring compensated programs back into it.

In RoboDK: Tools, Run script (or the Add-in Manager). If the folder of the station has one model
(``*.robotrue``), a program is chosen in the station, generated with its post processor, compensated
by ``robotrue compensate``, and added to the station. Otherwise cell.toml is written to the folder.

Requires the package ``robodk`` (RoboDK brings it) and the command ``robotrue`` on the PATH.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robodk import robolink, robomath

DIGITS = 9
"""Decimals of mm and deg."""


def xyz_abc(pose: Any) -> list[float]:
    """Returns x, y, z in mm and A, B, C in deg, R = Rz(A) Ry(B) Rx(C), of a robomath.Mat."""
    return [round(float(value), DIGITS) + 0.0 for value in robomath.Pose_2_KUKA(pose)]


def pose_lines(pose: Any) -> list[str]:
    """Returns the two lines of a pose in cell.toml."""
    values = xyz_abc(pose)
    return [f"xyz_mm = {values[:3]}", f"abc_deg = {values[3:]}"]


def named_lines(table: str, poses: Sequence[tuple[str, Any]]) -> list[str]:
    """Returns ``[[controller.base]]`` or ``[[controller.tool]]`` of named poses.

    The number at the end of a name (``Frame 3``) is that of the controller, where it is unique.
    """
    ends = [re.search(r"(\d+)\s*$", name) for name, _ in poses]
    numbers = [int(found[1]) if found else None for found in ends]
    lines = []
    for (name, pose), number in zip(poses, numbers, strict=True):
        lines += ["", f"[[controller.{table}]]", f"name = {json.dumps(name, ensure_ascii=False)}"]
        if number is not None and numbers.count(number) == 1:
            lines.append(f"number = {number}")
        lines += pose_lines(pose)
    return lines


def base_of(robot: Any) -> Any:
    """Returns the pose of the robot base in the station, a robomath.Mat."""
    return robot.Parent().PoseAbs()


def frames_of(rdk: Any, robot: Any) -> list[tuple[str, Any]]:
    """Returns names of the station's frames and their poses in the robot base; not that itself."""
    own = robot.Parent()
    into_base = robomath.invH(base_of(robot))
    frames = rdk.ItemList(robolink.ITEM_TYPE_FRAME)
    return [(item.Name(), into_base * item.PoseAbs()) for item in frames if item != own]


def tools_of(rdk: Any, robot: Any) -> list[tuple[str, Any]]:
    """Returns names of the robot's tools and their poses on its flange."""
    tools = rdk.ItemList(robolink.ITEM_TYPE_TOOL)
    return [(item.Name(), item.PoseTool()) for item in tools if item.Parent() == robot]


def cell_text(rdk: Any, robot: Any) -> str:
    """Returns the text of cell.toml: robot (a preset of its name), tool, frames."""
    low, high, _ = robot.JointLimits()
    limits = [[float(a), float(b)] for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    lines = [
        "# Written from a RoboDK station. State payload, reflector and tracker before calibrating.",
        f"# Limits in RoboDK, deg, axes of the controller: {limits}",
        "schema = 1",
        "",
        "[robot]",
        f"preset = {json.dumps(robot.Name(), ensure_ascii=False)}",
        "",
        "[tool]",
        *pose_lines(robot.PoseTool()),
        *named_lines("base", frames_of(rdk, robot)),
        *named_lines("tool", tools_of(rdk, robot)),
    ]
    return "\n".join(lines) + "\n"


def only_robot(rdk: Any) -> Any:
    """Returns the robot of the station; of several, the one the user picks."""
    robots = rdk.ItemList(robolink.ITEM_TYPE_ROBOT)
    if not robots:
        raise SystemExit("The station has no robot. Try: open a station with a robot.")
    if len(robots) == 1:
        return robots[0]
    picked = rdk.ItemUserPick("Robot of cell.toml", robolink.ITEM_TYPE_ROBOT)
    if not picked.Valid():
        raise SystemExit("No robot was picked.")
    return picked


def write_cell(rdk: Any, folder: Path) -> Path:
    """Returns the cell.toml that was written; an existing one is kept, the new one numbered."""
    path, number = folder / "cell.toml", 1
    while path.exists():
        number += 1
        path = folder / f"cell_{number}.toml"
    path.write_text(cell_text(rdk, only_robot(rdk)), encoding="utf-8")
    return path


def compensate_program(
    rdk: Any, program: Any, model: Path, folder: Path, command: Sequence[str] = ("robotrue",)
) -> list[Path]:
    """Returns the compensated files, in ``folder``/compensated; each was added to the station.

    The cell in the model has to hold the frames and tools that the program names.
    """
    with tempfile.TemporaryDirectory() as made:
        success, log, _ = program.MakeProgram(made, robolink.RUNMODE_MAKE_ROBOTPROG)
        files = sorted(path for path in Path(made).iterdir() if path.is_file())
        if not success or not files:
            raise SystemExit(f"RoboDK did not generate {program.Name()}: {log}")
        out = folder / "compensated"
        out.mkdir(exist_ok=True)
        words = [*command, "compensate", str(model), *map(str, files), "-o", str(out)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode:
            raise SystemExit(f"{program.Name()} was not compensated: {done.stderr or done.stdout}")
        written = [out / path.name for path in files if (out / path.name).exists()]
    print(done.stderr)
    for path in written:
        if not rdk.AddFile(str(path)).Valid():
            raise SystemExit(f"RoboDK did not read {path}; the file is complete.")
    return written


def main() -> None:
    """Writes cell.toml of the open station; compensates a program if a model is in its folder."""
    rdk = robolink.Robolink()
    folder = Path(rdk.getParam(robolink.PATH_OPENSTATION))
    models = sorted(folder.glob("*.robotrue"))
    if len(models) != 1:
        path = write_cell(rdk, folder)
        rdk.ShowMessage(f"{path} written. {len(models)} models in its folder, none was used.")
        return
    program = rdk.ItemUserPick("Program to compensate", robolink.ITEM_TYPE_PROGRAM)
    if not program.Valid():
        sys.exit("No program was picked.")
    written = compensate_program(rdk, program, models[0], folder)
    rdk.ShowMessage(f"Compensated: {', '.join(map(str, written))}")


if __name__ == "__main__":
    main()
