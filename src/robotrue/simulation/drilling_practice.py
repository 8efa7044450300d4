"""Files of a simulated drilling machine as its users would have them: foot, campaign, test."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.files import write_atomic
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.drilling.head import SENSE, Head
from robotrue.errors import ConfigurationError
from robotrue.simulation.drilling_machine import DrillingMachine, random_campaign

FILES: Final = ("foot.toml", "simulated-campaign.csv", "simulated-test.csv")
CLAMPS: Final = 60
"""Of the campaign; the test holds half as many, between its forces and heights."""
PIVOT: Final = np.array([0.0, 0.0, -350.0]) * MM


def write_practice_files(
    machine: DrillingMachine, folder: Path, *, seed: int, head: Head | None = None
) -> tuple[Path, ...]:
    """Writes the foot, a campaign and a test of a machine; returns their paths.

    Raises:
        ConfigurationError: The folder cannot be made, or a folder has the name of a file.
    """
    foot, campaign, test = paths = tuple(folder / name for name in FILES)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as cause:
        raise ConfigurationError(
            f"cannot make the folder: {cause.strerror}.", source=folder, hint="--write practice"
        ) from cause
    for path in paths:
        if path.is_dir():
            raise ConfigurationError(
                "the output is a folder.", source=path, hint="--write practice"
            )
    write_atomic(
        foot, _foot_text(machine, head or Head(order=machine.order, p_pivot_tip=PIVOT)).encode()
    )
    write_campaign(campaign, random_campaign(machine, CLAMPS, np.random.default_rng([seed, 2])))
    held_out = random_campaign(
        machine, CLAMPS // 2, np.random.default_rng([seed, 3]), held_out=True
    )
    write_campaign(test, held_out)
    return paths


def _foot_text(machine: DrillingMachine, head: Head) -> str:
    foot = machine.foot
    radii = ", ".join(f"{v / MM:g}" for v in foot.radius)
    angles = ", ".join(f"{v / DEG:g}" for v in foot.angle)
    pivot = ", ".join(f"{v / MM:g}" for v in head.p_pivot_tip)
    sense = "" if head.sense == SENSE else f"sense = {[int(v) for v in head.sense]}\n"
    return (
        "# simulated machine: robotrue simulate drill\n"
        f"[foot]\nradius_mm = [{radii}]\nangles_deg = [{angles}]\n"
        f"reading_sigma_um = {machine.noise / UM:g}\n\n"
        f'[head]\norder = "{machine.order}"\npivot_to_tip_mm = [{pivot}]\n{sense}'
    )
