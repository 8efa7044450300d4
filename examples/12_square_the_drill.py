"""Run a drilling job: campaign, freeze, production with a gauge, a zero shift. Simulated."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.adjust import adjustment
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.campaign_plan import plan_campaign
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot_model import estimate_tilt, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.drilling.production import freeze_model, record_of, update_model
from robotrue.report.drilling_report import drilling_content
from robotrue.report.page import report_html
from robotrue.simulation.drilling_machine import clamp, drilling_machine, random_campaign

GAUGE = 0.005 * DEG  # standard deviation of the gauge for finished holes
HOLES = 60


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    machine, random = drilling_machine(4, nonlinear=True, friction=True), np.random.default_rng(4)
    forces, heights = np.linspace(0.0, 1000.0, 5), np.array([-100.0, 0.0, 100.0]) * MM
    plan = plan_campaign(
        60, forces=forces, heights=heights, largest=6.0 * DEG, seed=4, by="information"
    )
    clamps = clamp(machine, plan.tilt, plan.force, plan.height, random)
    head = Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
    model, trials = fit_model(machine.foot, head, Campaign(clamps=clamps, tilt=plan.tilt))
    for trial in trials:
        print(f"held out, {trial.kind:12}: {trial.mean / DEG:.4f} deg residual tilt")
    test = random_campaign(machine, 100, random, held_out=True)
    write_model(out / "drill.robotrue", freeze_model(model, test, "test", allowed=0.1 * DEG))
    model = read_model(out / "drill.robotrue")
    result = evaluate_test(model, test)
    content = drilling_content(model, test, result, digest="test", limit=0.1 * DEG, simulated=True)
    (out / "12_square_the_drill.html").write_text(report_html(content))
    shift = np.array([50.0, -50.0, 25.0]) * UM
    left = []
    for each in (machine, replace(machine, offset=machine.offset + shift)):
        holes = random_campaign(each, HOLES, random, held_out=True)
        for i in range(HOLES):
            one = holes.clamps.take(np.array([i]))
            off = holes.tilt[i] - adjustment(model, one, np.zeros(2)).move.axes
            left.append(np.hypot(*off) / DEG)
            found, measured = estimate_tilt(model, one), off + random.normal(0.0, GAUGE, 2)
            record = record_of(str(len(left)), found, measured, "hole gauge")
            step = update_model(model, found, record, reference=GAUGE)
            model = step.model
            if step.alarm:
                print(f"ALARM: {step.said}")
    figure, axes = plt.subplots(figsize=(6, 3))
    axes.plot(np.arange(1, len(left) + 1), left, ".")
    axes.axvline(HOLES + 0.5, color="k", lw=0.8, label="zero shifted by 50, -50, 25 um")
    axes.set(xlabel="hole", ylabel="residual tilt, deg (simulated)", ylim=(0.0, None))
    axes.legend(fontsize=7)
    figure.savefig(out / "12_square_the_drill.png", bbox_inches="tight")
    tilts = np.hypot(*result.left.T) / DEG
    spread = tilts.std(ddof=1) / np.sqrt(len(tilts))
    print(f"error of the axis after one move: {tilts.mean():.4f} +- {spread:.4f} deg (simulated)")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "example-out"))
