"""A simulated pressure foot on a five-axis head: what makes readings wrong, by seed, and its files.

Sizes are those of a foot whose readings are off by some 240 counts of 1 um without clamp force and
by 310 at 1 kN. Everything made with it is simulated; files are those that its users would have:
foot, campaign, test.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.campaign import FORCE, HEIGHT, Campaign, Clamps
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.drilling.foot import FLAT, Foot, Skin, readings
from robotrue.drilling.head import AXIS_ORDER, SENSE, AxisOrder, Head, normal_from_tilt
from robotrue.errors import ConfigurationError

RECENTRED: Final = ""
"""The foot is in its rest position before every clamp."""
AS_LEFT: Final = "as left"
"""The foot meets the skin as the clamp before left it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DrillingMachine:
    """Truth of one machine.

    Attributes:
        foot: The sensors as drawn.
        built: The sensors as they are.
        order: Axis order of the head.
        gain: (k,) sensor reading per metre.
        offset: (k,) m, of the zero and of the foot at rest.
        axis_zero: (2,) rad, zero errors of A and B.
        axis_scale: (2,) their scale.
        by_force: (k,) m per kN, and ``by_force_squared``.
        by_force_squared: (k,) m per kN^2.
        by_height: (k,) m per 100 mm.
        yielding: (2,) deflection of the structure per kN, as a share of the tilt.
        by_force_tilt: (k, 2) m per kN and degree.
        by_force_bend: (k, 3) m per kN and degree^2 in a^2, a b, b^2.
        friction: rad, angle by which the foot's joint lags without force.
        fading: N, force that reduces it to 1/e.
        noise: m, scatter of a reading.
        sag: (2, 2) rad of a and b per rad of the machine's A and B.
        warp: (2, 2) rad of a and b per m of the machine's X and Y: guides that are not straight.
    """

    foot: Foot
    built: Foot
    order: AxisOrder
    gain: Array
    offset: Array
    axis_zero: Array
    axis_scale: Array
    by_force: Array
    by_force_squared: Array
    by_height: Array
    yielding: Array
    by_force_tilt: Array
    by_force_bend: Array
    friction: float
    fading: float
    noise: float
    sag: Array = field(default_factory=lambda: np.zeros((2, 2)))
    warp: Array = field(default_factory=lambda: np.zeros((2, 2)))


def _build_foot(foot: Foot, random: np.random.Generator) -> Foot:
    """Returns the foot as it was made: every sensor up to 0.25 mm from its drawn place."""
    seat = foot.seat + random.uniform(-0.25, 0.25, (len(foot.radius), 2)) * MM
    return replace(
        foot, radius=np.hypot(seat[:, 0], seat[:, 1]), angle=np.arctan2(seat[:, 1], seat[:, 0])
    )


def drilling_machine(
    seed: int,
    *,
    nonlinear: bool = False,
    friction: bool = False,
    order: AxisOrder = AXIS_ORDER,
    skin: Skin = FLAT,
    foot: Foot | None = None,
    sag: Array | None = None,
    warp: Array | None = None,
) -> DrillingMachine:
    """Returns the machine of a seed; the same with and without nonlinear terms and friction.

    Args:
        seed: Of everything that makes one machine another.
        nonlinear: With terms in the force squared and in force times tilt.
        friction: With friction in the foot's joint.
        order: Axis order of the head.
        skin: What sensors without a foot plate look at, known to the cell.
        foot: The sensors as drawn, with their skin; three on a radius of 60 mm without.
        sag: (2, 2) rad of a and b per rad of the machine's A and B; none without.
        warp: (2, 2) rad of a and b per m of its X and Y; none without.
    """
    random = np.random.default_rng(seed)
    if foot is None:
        seats = np.array([90.0, 210.0, 330.0]) * DEG
        foot = Foot(radius=np.full(3, 60.0 * MM), angle=seats, skin=skin)
    k = len(foot.radius)
    built = _build_foot(foot, random)
    pattern = random.normal(size=k)
    pattern -= pattern.mean()
    pattern *= 0.35 * MM / np.abs(pattern).max()
    rest = (
        random.choice([-1.0, 1.0]) * random.uniform(0.15, 0.3) + random.normal(0.0, 0.1, k)
    ) * MM
    machine = DrillingMachine(
        foot=foot,
        built=built,
        order=order,
        gain=1.0 + random.uniform(-0.006, 0.006, k),
        offset=rest + random.normal(0.0, 0.005, k) * MM,
        axis_zero=random.uniform(-0.10, 0.10, 2) * DEG,
        axis_scale=1.0 + random.uniform(-0.01, 0.01, 2),
        by_force=pattern,
        by_force_squared=0.35 * pattern * random.uniform(0.5, 1.5, k),
        by_height=random.normal(0.0, 0.004, k) * MM,
        yielding=random.uniform(0.008, 0.020, 2),
        by_force_tilt=random.normal(0.0, 0.020, (k, 2)) * MM,
        by_force_bend=random.normal(0.0, 0.0025, (k, 3)) * MM,
        friction=0.12 * DEG if friction else 0.0,
        fading=60.0 * 9.81,
        noise=2.0 * UM,
        sag=np.zeros((2, 2)) if sag is None else sag,
        warp=np.zeros((2, 2)) if warp is None else warp,
    )
    if nonlinear:
        return machine
    none = np.zeros(k)
    return replace(
        machine,
        by_force_squared=none,
        by_force_tilt=np.zeros((k, 2)),
        by_force_bend=np.zeros((k, 3)),
    )


def clamp(
    machine: DrillingMachine,
    tilt: Array,
    force: Array,
    height: Array,
    random: np.random.Generator,
    *,
    approach: str = RECENTRED,
    axes: Array | None = None,
    place: Array | None = None,
) -> Clamps:
    """Returns the readings of clamps made one after the other (simulated).

    Args:
        machine: Its truth.
        tilt: (n, 2) rad, angles of the machine's axes from the skin's normal.
        force: (n,) N.
        height: (n,) m.
        random: Of the readings' scatter.
        approach: :data:`RECENTRED` or :data:`AS_LEFT`.
        axes: (n, 2) rad, A and B of the machine; 0, and not recorded, without.
        place: (n, 2) m, its X and Y; likewise.
    """
    load, z = force / FORCE, height / HEIGHT
    true = tilt * machine.axis_scale * (1.0 - machine.yielding * load[:, None])
    if axes is not None:
        true = true + axes @ machine.sag.T
    if place is not None:
        true = true + place @ machine.warp.T
    followed = _stop_short(machine, true + machine.axis_zero, force, approach)
    angle = tilt / DEG
    a, b = angle.T
    bend = np.stack([a * a, a * b, b * b], axis=-1)
    seen = readings(machine.built, normal_from_tilt(machine.order, followed), np.zeros(len(tilt)))
    seen = seen * machine.gain + machine.offset
    seen += load[:, None] * machine.by_force + load[:, None] ** 2 * machine.by_force_squared
    seen += z[:, None] * machine.by_height
    seen += load[:, None] * (angle @ machine.by_force_tilt.T + bend @ machine.by_force_bend.T)
    seen += random.normal(0.0, machine.noise, seen.shape)
    return Clamps(
        readings=seen,
        force=force,
        height=height,
        approach=(approach,) * len(seen),
        axes=np.full((len(seen), 2), np.nan) if axes is None else axes,
        place=np.full((len(seen), 2), np.nan) if place is None else place,
    )


def _stop_short(machine: DrillingMachine, tilt: Array, force: Array, approach: str) -> Array:
    """(n, 2) rad where friction lets the foot stop on its way to the skin's tilt."""
    left = np.zeros(2)
    out = np.empty_like(tilt)
    behind = machine.friction * np.exp(-force / machine.fading)
    for i, goal in enumerate(tilt):
        way = goal - (left if approach == AS_LEFT else 0.0)
        length = float(np.hypot(*way))
        out[i] = goal - way * (min(1.0, behind[i] / length) if length > 0.0 else 0.0)
        left = out[i]
    return out


def random_campaign(
    machine: DrillingMachine,
    count: int,
    random: np.random.Generator,
    *,
    held_out: bool = False,
    approach: str = RECENTRED,
    largest: float = 4.0 * DEG,
    swing: float = 0.0,
    travel: float = 0.0,
) -> Campaign:
    """Returns a campaign of random tilts on five forces and three heights (simulated).

    Args:
        machine: Its truth.
        count: Clamps.
        random: Of tilts and scatter.
        held_out: Forces and heights anywhere between, as production has them.
        approach: How the foot is brought down.
        largest: rad, tilt of each axis.
        swing: rad, largest A and B of the machine, in both directions; 0: not recorded.
        travel: m, largest X and Y, in both directions; 0: not recorded.
    """
    tilt = random.uniform(-largest, largest, (count, 2))
    if held_out:
        force = random.uniform(0.0, 1.0, count) * 100.0 * 9.81
        height = random.uniform(-1.0, 1.0, count) * HEIGHT
    else:
        grid = np.array([(f, z) for f in (0, 25, 50, 75, 100) for z in (-1, 0, 1)], dtype=float)
        chosen = grid[np.arange(count) % len(grid)]
        force, height = chosen[:, 0] * 9.81, chosen[:, 1] * HEIGHT
    axes = random.uniform(-swing, swing, (count, 2)) if swing else None
    place = random.uniform(-travel, travel, (count, 2)) if travel else None
    clamps = clamp(machine, tilt, force, height, random, approach=approach, axes=axes, place=place)
    origin = Provenance(simulated=True, instrument="pressure foot")
    return Campaign(clamps=clamps, tilt=tilt, order=machine.order, provenance=origin)


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
