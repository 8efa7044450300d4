"""Generated KRL programs executed before and after a correction that depends on the flange alone.

    python tests/fuzz/executed.py FIRST LAST

Every executed target must be either where it was, or where the correction of its own frames sends
it. Prints the seeds of the programs for which one is elsewhere, and leaves with 1 if there are any.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from krl_controller import KrlController, Move
from krl_flow_programs import FlowWriter
from laws import changed, read, write
from written import TABLE, Pen

from robotrue.core.poses import inverse
from robotrue.core.rotations import matrix_from_abc
from robotrue.program.program import Program, Reason, Replacement

WAYS, RUNS = 6, 3
PLACE, TURN = 3e-6, 6e-5
"""m and elements of a matrix: what the printed digits can hold; corrections are about a
millimetre."""
FRAMES = {"base": TABLE.bases, "tool": TABLE.tools}


def corrected(base: np.ndarray, tool: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The target (4, 4) whose flange is moved by a smooth function of its pose."""
    flange = base @ target @ inverse(tool)
    x, y, z = flange[:3, 3]
    shift = [np.sin(3 * x + 5 * y + 1), np.cos(4 * y - 2 * z), np.sin(6 * z + x + 2)]
    turn = [np.cos(2 * x - z), np.sin(3 * y + z), np.cos(5 * x + y)]
    flange[:3, 3] += 1e-3 * np.array(shift)
    flange[:3, :3] = matrix_from_abc(2e-3 * np.array(turn)) @ flange[:3, :3]
    return inverse(base) @ flange @ tool


def correction(program: Program) -> Replacement:
    """The correction of all targets that may be corrected."""
    position, rotation = np.array(program.position), np.array(program.rotation)
    for row in np.flatnonzero(program.reason == Reason.NONE).tolist():
        target = np.eye(4)
        target[:3, :3], target[:3, 3] = rotation[row], position[row]
        base = program.T_base_frame[program.frame[row]]
        new = corrected(base, program.T_flange_tool[program.tool[row]], target)
        rotation[row], position[row] = new[:3, :3], new[:3, 3]
    return changed(program, position, rotation, program.axes)


def execute(files: Mapping[str, str], seed: int) -> list[Move]:
    """The motions of some runs in a row; inputs are drawn from the seed."""
    controller = KrlController(files, FRAMES, np.random.default_rng(seed))
    for _ in range(RUNS):
        if not controller.run("part"):
            break
    return controller.moves


def find_strays(files: Mapping[str, str], count: Counter[str]) -> list[str]:
    """One sentence on each executed target that is neither left alone nor corrected."""
    programs = read("krl", tuple((n, t.encode()) for n, t in files.items()), TABLE)
    data = write("krl", programs, [correction(program) for program in programs])
    after = dict(files) | {name: text.decode() for name, text in data}
    strays = []
    for seed in range(WAYS):
        one, two = execute(files, seed), execute(after, seed)
        if len(one) != len(two):
            return [f"way {seed}: {len(one)} motions before, {len(two)} after"]
        for number, (was, now) in enumerate(zip(one, two, strict=True)):
            if was.target is None or now.target is None:
                continue
            goal = corrected(was.base, was.tool, was.target)
            left, moved = _is_same(was, was.target, now), _is_same(was, goal, now)
            count["corrected" if moved else "left alone" if left else "stray"] += 1
            if not left and not moved:
                off = 1e3 * np.abs(now.target - goal)[:3, 3].max()
                strays.append(f"way {seed}, motion {number}: off by {off:.3f} mm")
    return strays


def _is_same(was: Move, goal: np.ndarray, now: Move) -> bool:
    assert now.target is not None
    apart = np.abs(now.target - goal)
    return bool(
        np.array_equal(was.base, now.base)
        and np.array_equal(was.tool, now.tool)
        and apart[:3, 3].max() <= PLACE
        and (was.via or apart[:3, :3].max() <= TURN)
    )


def main() -> int:
    """Executes the programs of some seeds."""
    count: Counter[str] = Counter()
    failed = 0
    for seed in range(int(sys.argv[1]), int(sys.argv[2])):
        strays = find_strays(FlowWriter(Pen.of(seed)).job(), count)
        failed += bool(strays)
        if strays:
            sys.stdout.write(f"{seed}: {strays[0]}\n")
    sys.stdout.write(f"{failed} programs with strays; targets: {dict(count)}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
