"""The online estimator, whole, in processor time of one thread. Forces are SIMULATED.

    python benchmarks/sensing.py [--quick]

Joints at 250 and forces at 20,000 samples a second, thirteen modes, stiffness with its covariance,
in blocks of 1 to 4,096 forces; beside it the modal filters alone, the floor. Best of several runs.
Then whether the blocks gave the same bits.
"""

from __future__ import annotations

import sys
import time
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.dynamics.oscillators import join_oscillators
from robotrue.dynamics.pose_modes import pose_modes
from robotrue.dynamics.streaming import ModalFilter
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_models import JointCompliance, MeasuredResponse, SensingModels
from robotrue.simulation.milling_arm import FEED, RATE, milling_arm, milling_robot, pass_joints
from robotrue_reproductions.jin2022.milling_pass import pass_force, tooling

BLOCKS: Final = (1, 20, 256, 1024, 4096)
COMPARED: Final = 256
JOINT_RATE: Final = 250.0
RUNS: Final = 3


def models() -> SensingModels:
    arm = milling_arm(1)
    home = pass_joints(np.array([0.25]))[0]
    own = join_oscillators([pose_modes(arm.arm, home).oscillators(), arm.tool])
    known = 1.0 / arm.arm.stiffness
    return SensingModels(
        robot=milling_robot(),
        rate=RATE,
        compliance=JointCompliance(compliance=known, covariance=np.diag((0.1 * known) ** 2)),
        response=MeasuredResponse(oscillators=own, joints=home, frame="base"),
    )


def joints(seconds: float) -> JointBlock:
    time_ = np.arange(0.0, seconds, 1.0 / JOINT_RATE)
    q = pass_joints(0.2 + FEED * time_)
    return JointBlock(
        controller_time=time_,
        host_time=time_,
        joints=milling_robot().controller.to_controller(q),
        T_frame_tool=np.full((len(time_), 4, 4), np.nan),
        sequence=np.arange(len(time_)),
        flags=np.zeros(len(time_), dtype=np.int64),
    )


def blocks(force: Array, size: int) -> list[ForceBlock]:
    out = []
    for a in range(0, len(force), size):
        n = len(force[a : a + size])
        wrench = np.full((n, 6), np.nan)
        wrench[:, :3] = force[a : a + size]
        stamp = (a + np.arange(n)) / RATE
        out.append(
            ForceBlock(
                controller_time=stamp,
                host_time=stamp,
                wrench=wrench,
                frame="base",
                sequence=a + np.arange(n),
                status=np.zeros(n, dtype=np.int64),
                flags=np.zeros(n, dtype=np.int64),
            )
        )
    return out


def main(arguments: list[str]) -> None:
    seconds = 5.0 if "--quick" in arguments else 8.0  # some of it after the filters settled
    force = pass_force(tooling(1), round(seconds * RATE), np.random.default_rng(1))
    known, arm = models(), joints(seconds)
    floor = ModalFilter(known.response.oscillators, RATE)  # type: ignore[union-attr]
    whole = None
    print("M samples per CPU-second, microseconds per call; filters alone; share of the filters")
    for size in BLOCKS:
        part = blocks(force[: size * 2000], size)
        best, least = np.inf, np.inf
        for _ in range(RUNS):
            sensing = Sensing(known)
            sensing.joints(arm)
            start = time.process_time()
            found = [sensing.force(block) for block in part]
            best = min(best, time.process_time() - start)
            start = time.process_time()
            for block in part:
                floor.push(block.wrench[:, :3])
            least = min(least, time.process_time() - start)
        rows = sum(len(block) for block in part)
        error = np.concatenate([f.error for f in found])
        whole = error if size == BLOCKS[-1] else whole
        print(
            f"{size:6d} {rows / best / 1e6:8.3f} {best / len(part) * 1e6:8.1f} "
            f"{rows / least / 1e6:8.2f} {100.0 * least / best:6.1f} %"
        )
        if size == COMPARED:
            first = error
    same = whole is not None and np.array_equal(first, whole[: len(first)], equal_nan=True)
    settled = int(np.isfinite(first).all(axis=1).sum())
    print(
        f"blocks of {COMPARED} and of {BLOCKS[-1]}: {'the same bits' if same else 'DIFFERENT'}, "
        f"{settled} of {len(first)} rows settled"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
