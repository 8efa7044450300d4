"""Corrections against an adversary: does the robot ever leave limit or rate? All SIMULATED.

    python benchmarks/adversarial_corrections.py [--runs 10000] [--seconds 60] [--seed 0]
        [--part relative absolute links egm] [--plot FILE.png]

Each run draws a controller (how it counts Delay, whether it takes late answers), a network that
loses, delays, repeats and reorders in both directions, and events: RSI started anew, pauses,
leaps of IPOC, Delay and our clock, the answering process killed, strange senders. An adversary
that sees the guard loses the packets that could part its belief from what the robot holds. When
corrections are refused for good, the operator starts the controller anew after a second.

``relative`` and ``absolute``: guard and booking of an RSI link, 12 ms. ``links``: the RSI link with
its packets, both modes. ``egm``: the EGM link with its messages, 4 ms; EGM confirms no answer, so
its rate is judged between answers taken, by the time between their sending. RTDE takes no
corrections. The limit is 0.2 mm, rates are 1 and 10 mm/s.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import adversary_links
from adversary import ABSOLUTE, RELATIVE, Outcome, World

LIMIT_NM = 200_000.0


def worlds(part: str, runs: int, seconds: float, seed: int) -> Iterator[tuple[int, Outcome, float]]:
    """Seed, outcome, and nm of the largest first answer after a restart, of each run."""
    cycles = round(seconds / 12e-3)
    for k in range(runs):
        number = seed + k
        if part == "egm":
            world = adversary_links.EgmWorld(number)
            yield number, world.cycles(round(seconds / 4e-3)), world.first_nm
        elif part == "links":
            mode = (RELATIVE, ABSOLUTE)[k % 2]
            yield number, World(number, mode, 12, link=True).cycles(cycles), 0.0
        else:
            mode = RELATIVE if part == "relative" else ABSOLUTE
            yield number, World(number, mode, 12).cycles(cycles), 0.0


def judged(part: str, found: Iterator[tuple[int, Outcome, float]], runs: int) -> None:
    """Runs one part and prints what came of it."""
    began = time.process_time()
    farthest = fastest = first = left = 0.0
    trips = refusals = outside = held = 0
    worst = 0
    for done, (seed, outcome, answer) in enumerate(found, 1):
        if outcome.farthest_nm > farthest:
            farthest, worst = outcome.farthest_nm, seed
        fastest, first = max(fastest, outcome.fastest_nm), max(first, answer)
        left = max(left, outcome.left_nm)
        trips, refusals = trips + outcome.trips, refusals + outcome.refusals
        outside += outcome.outside > 0
        held += outcome.farthest_nm > 0.5 * LIMIT_NM
        if outcome.outside:
            print(f"   seed {seed} left limit or rate in {outcome.outside} cycles", flush=True)
        if done % 500 == 0:
            print(f"   {done} runs, {1e-6 * farthest:.6f} mm", flush=True)
    print(
        f"{part:9s} {runs:6d} runs: largest held {1e-6 * farthest:.6f} mm (seed {worst}), rate "
        f"{fastest:.6f} of the limit, {outside} runs outside, {held} beyond half of the limit, "
        f"{trips} trips, {refusals} refusals, CPU {time.process_time() - began:.0f} s",
        flush=True,
    )
    within = farthest <= LIMIT_NM and not outside
    verdict = "reached" if within else "missed"
    before = "3.96 before" if part == "relative" else "-"
    print(
        f"RESULT | corrections, {part}, {runs} runs, simulated: largest held, mm | "
        f"{before} | <= 0.200 | {1e-6 * farthest:.4f} | {verdict}"
    )
    if part == "egm":
        verdict = "reached" if first <= 4000.0 else "missed"
        print(
            "RESULT | EGM at 1 mm/s, simulated: first answer after a restart, mm | 0.200 before | "
            f"<= 0.004 | {1e-6 * first:.6f} | {verdict}"
        )


def telling(runs: int, seconds: float, seed: int) -> tuple[int, World]:
    """Of some runs with aimed losses at 1 mm/s one that refuses and trips about ten times."""
    cycles = round(seconds / 12e-3)
    found = []
    for number in range(seed, seed + runs):
        world = World(number, RELATIVE, 12)
        if world.harm.aimed != "packet out" or world.limits.shift_rate > 1e-3:
            continue
        outcome = world.cycles(cycles)
        score = 1e-3 * outcome.farthest_nm + 20.0 * min(outcome.refusals, 2)
        found.append((score - 2.0 * abs(outcome.trips - 10), number))
    number = max(found)[1]
    world = World(number, RELATIVE, 12)
    world.cycles(cycles, trace=1)
    return number, world


def plotted(path: Path, seconds: float, seed: int) -> None:
    """Writes the picture of what the robot held, believed and might have held."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    number, world = telling(150, seconds, seed)
    time_s, held, believed, farthest = zip(*world.outcome.trace, strict=True)
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(11, 7), sharex=True, height_ratios=(3, 1))

    def micro(nm: tuple[float, ...]) -> list[float]:
        return [v * 1e-3 for v in nm]

    upper.fill_between(
        time_s, 0.0, micro(farthest), color="0.88", label="may be held, by what the guard knows"
    )
    upper.plot(time_s, micro(believed), color="tab:orange", lw=2.4, label="believed by the guard")
    upper.plot(time_s, micro(held), color="tab:blue", lw=0.8, label="held by the robot (truth)")
    upper.axhline(1e-3 * LIMIT_NM, color="tab:red", ls="--", label="limit 200 um")
    upper.set_ylabel("shift, um")
    upper.set_ylim(0.0, 1.25e-3 * LIMIT_NM)
    upper.set_title(
        f"SIMULATED: RSI relative, adversarial losses and restarts (seed {number}), "
        f"{world.outcome.trips} trips, {world.outcome.refusals} refusals"
    )
    upper.legend(loc="upper right", ncols=2, fontsize=8)
    lower.plot(time_s, [abs(a - b) * 1e-3 for a, b in zip(held, believed, strict=True)], lw=0.8)
    lower.set_ylabel("|held - believed|, um")
    lower.set_xlabel("time, s   (after RSI_OFF the robot holds 0; the next packet tells the guard)")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    print(f"picture: {path} (simulated)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000, help="of relative; others a share")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--part", nargs="+", default=["relative", "absolute", "links", "egm"], help="which"
    )
    parser.add_argument("--plot", type=Path, default=None, help="PNG to write")
    asked = parser.parse_args()
    share = {"relative": 1, "absolute": 10, "links": 100, "egm": 200}
    print(f"SIMULATED; {asked.runs} runs of {asked.seconds:g} s from seed {asked.seed}")
    with adversary_links.replaced():
        for part in asked.part:
            runs = max(2, asked.runs // share[part])
            judged(part, worlds(part, runs, asked.seconds, asked.seed), runs)
    if asked.plot is not None:
        plotted(asked.plot, asked.seconds, asked.seed)


if __name__ == "__main__":
    main()
