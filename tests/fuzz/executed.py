"""Generated programs executed before and after a correction that depends on the flange alone.

    python tests/fuzz/executed.py LANGUAGE FIRST LAST

Every executed target must be either where it was, or where the correction of its own frames sends
it, whether all targets are corrected or some are declined. Prints the seeds of the programs for
which one is elsewhere, and leaves with 1 if there are any.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from apt_controller import AptController
from apt_flow_programs import AptFlowWriter
from controllers import Controller, Move
from fanuc_controller import FanucController
from fanuc_flow_programs import FanucFlowWriter
from fanuc_gcode_controller import FanucGcodeController
from fanuc_gcode_flow_programs import FanucGcodeFlowWriter
from gcode_controller import GcodeController
from gcode_flow_programs import GCODE_FRAMES
from heidenhain_controller import HeidenhainController
from heidenhain_flow_programs import HeidenhainFlowWriter
from jbi_controller import JbiController
from jbi_flow_programs import JbiFlowWriter
from krl_controller import KrlController
from krl_flow_programs import FlowWriter
from laws import changed, read, write
from rapid_controller import RapidController
from rapid_flow_programs import RapidFlowWriter
from sinumerik_controller import SinumerikController
from sinumerik_flow_programs import SinumerikFlowWriter
from urscript_controller import UrController
from urscript_flow_programs import UrFlowWriter
from val3_controller import Val3Controller
from val3_flow_programs import Val3FlowWriter
from written import FRAME, TABLE, Pen

from robotrue.core.poses import inverse, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Program, Reason, Replacement

WAYS, RUNS = 6, 3
TAKEN = 0.75
"""Of the targets, where the model declines some."""
PLACE, TURN = 3e-6, 6e-5
"""m and elements of a matrix: what the printed digits can hold; corrections are about a
millimetre."""
FOLLOWING = (
    "targets computed from it move with its correction", "INC moves by a step",
    "IMOV moves by a step", "relative (G91)", "IC counts from the point before",
    "makes its own moves", "an incremental coordinate", "GODLTA/ is a step",
)  # fmt: skip
"""Notes of a program: such a target is near its correction, not at it."""
Files = Mapping[str, str]


class Executed(NamedTuple):
    """The writer of the programs of a language, by its name of a file; and what runs them."""

    job: Callable[[Pen], Files]
    controller: Callable[[Files, np.random.Generator], Controller]
    frames: FrameTable = TABLE


def _runs(kind: type[GcodeController]) -> Callable[[Files, np.random.Generator], Controller]:
    return lambda files, rng: kind(files, GCODE_FRAMES, rng)


TIPS = {
    name: pose_from_xyz_abc(np.array([0.0, 0.0, length]), np.zeros(3))
    for name, length in (("T1", 0.08), ("T1.1", 0.2), ("T2", 0.12), ("MILL", 0.17))
}
PATHS = replace(
    TABLE,
    T_base_frame=FRAME,
    bases={"preset 1": FRAME @ TIPS["T2"], "preset 2": np.eye(4)},
    tools=TIPS,
    orientation=OrientationRule(angles="rpy", spin=20.0 * DEG),
)
"""Tools along the axis: where the flange is does not depend on what a tool axis leaves open."""
PATH_FRAMES = {"base": {**PATHS.bases, "": FRAME}, "tool": {**PATHS.tools, "": np.eye(4)}}
FRAMES = {"base": TABLE.bases, "tool": TABLE.tools}
EXECUTED = {
    "krl": Executed(
        lambda pen: FlowWriter(pen).job(), lambda files, rng: KrlController(files, FRAMES, rng)
    ),
    "fanuc_ls": Executed(
        lambda pen: FanucFlowWriter(pen).job(),
        lambda files, rng: FanucController(files, FRAMES, rng),
    ),
    "urscript": Executed(lambda pen: UrFlowWriter(pen).job(), UrController),
    "jbi": Executed(
        lambda pen: JbiFlowWriter(pen).job(),
        lambda files, rng: JbiController(files, FRAMES, rng),
    ),
    "sinumerik": Executed(
        lambda pen: SinumerikFlowWriter(pen).job(), _runs(SinumerikController), GCODE_FRAMES
    ),
    "fanuc_gcode": Executed(
        lambda pen: FanucGcodeFlowWriter(pen).job(), _runs(FanucGcodeController), GCODE_FRAMES
    ),
    "heidenhain": Executed(
        lambda pen: HeidenhainFlowWriter(pen).job(),
        lambda files, rng: HeidenhainController(files, PATH_FRAMES, rng),
        PATHS,
    ),
    "apt": Executed(
        lambda pen: AptFlowWriter(pen).job(),
        lambda files, rng: AptController(files, PATH_FRAMES, rng),
        PATHS,
    ),
    "rapid": Executed(lambda pen: RapidFlowWriter(pen).job(), RapidController),
    "val3": Executed(lambda pen: Val3FlowWriter(pen).job(), Val3Controller),
}


def corrected(base: np.ndarray, tool: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The target (4, 4) whose flange is moved by a smooth function of its pose."""
    flange = base @ target @ inverse(tool)
    x, y, z = flange[:3, 3]
    shift = [np.sin(3 * x + 5 * y + 1), np.cos(4 * y - 2 * z), np.sin(6 * z + x + 2)]
    turn = [np.cos(2 * x - z), np.sin(3 * y + z), np.cos(5 * x + y)]
    flange[:3, 3] += 1e-3 * np.array(shift)
    flange[:3, :3] = matrix_from_abc(2e-3 * np.array(turn)) @ flange[:3, :3]
    return inverse(base) @ flange @ tool


def corrected_axes(tool: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """The axes (6,) moved by a smooth function of themselves and the tool."""
    return axes + 1e-3 * np.sin(3.0 * axes + 5.0 * tool[0, 3])


def correction(program: Program, kept: np.random.Generator | None) -> Replacement:
    """The correction of all targets that may be corrected, or of most of them.

    Args:
        program: As it was read.
        kept: Decides which the model declines, a quarter; None: none.
    """
    position, rotation = np.array(program.position), np.array(program.rotation)
    for row in np.flatnonzero(program.reason == Reason.NONE).tolist():
        target = np.eye(4)
        target[:3, :3], target[:3, 3] = rotation[row], position[row]
        base = program.T_base_frame[program.frame[row]]
        new = corrected(base, program.T_flange_tool[program.tool[row]], target)
        rotation[row], position[row] = new[:3, :3], new[:3, 3]
    axes = np.array(program.axes)
    for row in np.flatnonzero(program.reason == Reason.JOINT_TARGET).tolist():
        axes[row] = corrected_axes(program.T_flange_tool[program.tool[row]], axes[row])
    out = changed(program, position, rotation, axes)
    if kept is None:
        return out
    return replace(out, changed=out.changed & (kept.random(len(program)) < TAKEN))


def execute(language: str, files: Files, seed: int) -> list[Move]:
    """The motions of some runs in a row; inputs are drawn from the seed."""
    controller = EXECUTED[language].controller(files, np.random.default_rng(seed))
    for _ in range(RUNS):
        if not controller.run():
            break
    return controller.moves


def find_strays(language: str, files: Files, count: Counter[str]) -> list[str]:
    """One sentence on each executed target that is neither left alone nor corrected."""
    programs = read(
        language, tuple((n, t.encode()) for n, t in files.items()), EXECUTED[language].frames
    )
    announced = any(each in n for p in programs for n in p.notes for each in FOLLOWING)
    corrected_files = []
    for kept in (None, np.random.default_rng(len(programs[0].data))):
        try:
            data = write(language, programs, [correction(program, kept) for program in programs])
        except ConfigurationError:  # a circle with its start corrected, and not its end
            if kept is None:
                return []
        corrected_files.append(dict(files) | {name: text.decode() for name, text in data})
    strays = []
    for seed in range(WAYS):
        one, two = (
            execute(language, files, seed),
            execute(language, corrected_files[seed % 2], seed),
        )
        if len(one) != len(two):
            return [f"way {seed}: {len(one)} motions before, {len(two)} after"]
        for number, (was, now) in enumerate(zip(one, two, strict=True)):
            if not np.array_equal(was.step, now.step):
                strays.append(f"way {seed}, motion {number}: an increment is corrected")
            if was.target is None or now.target is None:
                continue
            if was.target.ndim == 1:
                goal = corrected_axes(was.tool, was.target)
            else:
                goal = corrected(was.base, was.tool, was.target)
            left, moved = _is_same(was, was.target, now), _is_same(was, goal, now)
            told = not left and not moved and now.follows and announced
            kind = "corrected" if moved else "left alone" if left else "told" if told else "stray"
            count[kind] += 1
            if kind == "stray":
                off = [f"{1e3 * each.miss(goal)[0]:.3f}" for each in (now, was)]
                strays.append(
                    f"way {seed}, motion {number}: off by {off[0]} mm of a correction of {off[1]}"
                )
    return strays


def _is_same(was: Move, goal: np.ndarray, now: Move) -> bool:
    place, turn = now.miss(goal)
    frames = np.array_equal(was.base, now.base) and np.array_equal(was.tool, now.tool)
    return frames and place <= PLACE and turn <= TURN


def main() -> int:
    """Executes the programs of some seeds."""
    count: Counter[str] = Counter()
    language, failed = sys.argv[1], 0
    for seed in range(int(sys.argv[2]), int(sys.argv[3])):
        strays = find_strays(language, EXECUTED[language].job(Pen.of(seed)), count)
        failed += bool(strays)
        if strays:
            sys.stdout.write(f"{seed}: {strays[0]}\n")
    sys.stdout.write(f"{failed} programs with strays; targets: {dict(count)}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
