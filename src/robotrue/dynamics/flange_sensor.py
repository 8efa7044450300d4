"""Force sensor at the flange: the carried tool, and the share of the signal that is the cut.

Two linear least-squares steps, gravity's direction free, so that a tilted base or a turned sensor
is absorbed. With R = R_base_sensor, c the centre of mass in the sensor frame::

    F_i = R_i^T g + F0          6 unknowns: g (weight vector in base), F0
    M_i = c x (R_i^T g) + M0    6 unknowns: c, M0;    mass = |g| / 9.81

Afterwards gravity and inertia are subtracted: F_cut = F - F0 - R^T g + m a, with a the acceleration
of the centre of mass, of an accelerometer or of the joints. Wrenches and signals act on the sensor
from the tool's side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.archive import Archive, archive_reader
from robotrue.core.archive_tables import pack_table, unpack_table
from robotrue.core.arrays import Array, frozen
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance, provenance_from
from robotrue.core.rotations import skew
from robotrue.core.units import MM, STANDARD_GRAVITY
from robotrue.errors import ArchiveError, ImplausibleDataError, ObservabilityError, ShapeError

WORST_CONDITION: Final = 5.0
"""Six wrist poses +-90 deg have 2.2, twelve within 15 deg 10.6, with five times the deviation."""
_WEIGHED: Final = 0.2
"""kg below which the centre of the load on the sensor is not determined."""
_HEAVIEST: Final = 2000.0
"""kg; no robot carries more."""
KIND: Final = "held-tool"
SCHEMA: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldTool(Columns):
    """Mass and centre of the tool that a force sensor carries, and the sensor's offsets.

    Attributes:
        mass: kg.
        centre: (3,) m in the sensor frame.
        weight_in_base: (3,) N, mass times gravity, in base axes.
        force_offset: (3,) N.
        moment_offset: (3,) N m.
        mass_sd: kg.
        centre_sd: (3,) m.
        force_offset_sd: (3,) N.
        condition: Of the poses; 1 is best.
        force_noise: N, standard deviation of a reading about the model.
        moment_noise: N m, likewise.
        provenance: Of the readings.
    """

    mass: float
    centre: Annotated[Array, Column("3", unit="m")]
    weight_in_base: Annotated[Array, Column("3", unit="N")]
    force_offset: Annotated[Array, Column("3", unit="N")]
    moment_offset: Annotated[Array, Column("3", unit="N m")]
    mass_sd: float
    centre_sd: Annotated[Array, Column("3", unit="m")]
    force_offset_sd: Annotated[Array, Column("3", unit="N")]
    condition: float
    force_noise: float
    moment_noise: float
    provenance: Provenance = MEASURED

    def to_archive(self, *, source: str) -> Archive:
        """Returns it as document and arrays (SI).

        Args:
            source: File of the readings.
        """
        numbers, arrays = pack_table(self, leave=("provenance",))
        origin = {"source": source, "provenance": self.provenance.to_document()}
        return Archive(kind=KIND, schema=SCHEMA, document={**origin, **numbers}, arrays=arrays)


@archive_reader
def held_tool_from_archive(archive: Archive) -> HeldTool:
    """Reads what ``HeldTool.to_archive`` wrote.

    Raises:
        ArchiveError: Another kind, damaged, or written by a newer robotrue.
    """
    archive.expect(KIND, SCHEMA)
    document = dict(archive.document)
    origin = provenance_from(document.get("provenance"))
    tool = unpack_table(HeldTool, archive, document, provenance=origin)
    numbers = (tool.mass, tool.mass_sd, tool.condition, tool.force_noise, tool.moment_noise)
    if not all(0.0 <= value < np.inf for value in numbers) or tool.mass > _HEAVIEST:
        raise ArchiveError(f"a held tool with {numbers}.")
    return tool


def identify_held_tool(R_base_sensor: Array, readings: Array) -> HeldTool:
    """Returns mass, centre and offsets from readings at rest in several poses of the wrist.

    Args:
        R_base_sensor: (n, 3, 3), rotations of the sensor in base.
        readings: (n, 6) N, N m in the sensor frame, force first, each a mean at rest.

    Raises:
        ObservabilityError: Fewer than four poses, or poses too much alike (condition above 5).
        ImplausibleDataError: No load on it; moments that no centre explains (millinewtons, inches,
            a frame of another hand).
        ShapeError: Other shapes.

    Fails when: the arm still moves, or a hose pulls differently in every pose.

    The deviations stated are those of the noise the residuals show.
    """
    n = len(readings)
    R = frozen(R_base_sensor, (n, 3, 3), "R_base_sensor")
    wrench = frozen(readings, (n, 6), "readings")
    if n < 4:
        raise ObservabilityError(
            f"{n} poses of the wrist, expected four or more, best six.",
            hint="the tool up, down and to four sides.",
        )
    turned = R.transpose(0, 2, 1)
    design = np.concatenate([turned, np.tile(np.eye(3), (n, 1, 1))], axis=2).reshape(3 * n, 6)
    condition = float(np.linalg.cond(design))
    if not condition <= WORST_CONDITION:
        raise ObservabilityError(
            f"the poses are too similar: condition {condition:.3g}, at most {WORST_CONDITION:g}.",
            hint="turn the wrist by 90 deg to both sides about two axes.",
        )
    found, force_noise, cov = _solve_least_squares(design, wrench[:, :3].ravel())
    weight, offset = found[:3], found[3:]
    mass = float(np.linalg.norm(weight)) / STANDARD_GRAVITY
    mass_sd = float(np.sqrt(weight @ cov[:3, :3] @ weight) / np.linalg.norm(weight))
    mass_sd /= STANDARD_GRAVITY
    _check_forces(wrench, force_noise, mass, mass_sd)
    pull = turned @ weight
    lever = np.concatenate([-skew(pull), np.tile(np.eye(3), (n, 1, 1))], axis=2)
    placed, moment_noise, moment_cov = _solve_least_squares(
        lever.reshape(3 * n, 6), wrench[:, 3:].ravel()
    )
    # The weight is not known exactly either: what it is off by, the centre is off by.
    moved = (skew(placed[:3]) @ turned).reshape(3 * n, 3)
    follows = np.linalg.lstsq(lever.reshape(3 * n, 6), moved, rcond=None)[0]
    moment_cov = moment_cov + follows @ cov[:3, :3] @ follows.T
    _check_moments(wrench, moment_noise, mass, placed[:3])
    return HeldTool(
        mass=mass,
        centre=placed[:3],
        weight_in_base=weight,
        force_offset=offset,
        moment_offset=placed[3:],
        mass_sd=mass_sd,
        centre_sd=np.sqrt(np.diag(moment_cov)[:3]),
        force_offset_sd=np.sqrt(np.diag(cov)[3:]),
        condition=condition,
        force_noise=force_noise,
        moment_noise=moment_noise,
    )


def held_tool_remarks(tool: HeldTool) -> tuple[str, ...]:
    """Returns warnings about the tool's estimate, one sentence each."""
    up = float(tool.weight_in_base[2] / np.linalg.norm(tool.weight_in_base))
    if up <= 0.0:
        return ()
    return (
        "the weight points up in base: right for an arm that hangs from above; for an arm on the "
        "floor the sensor shows the force of the tool, and every force must change its sign",
    )


def process_wrench(
    tool: HeldTool,
    R_base_sensor: Array,
    readings: Array,
    *,
    acceleration: Array | None = None,
    T_sensor_tool: Array | None = None,
) -> Array:
    """Returns the wrench of the cut on the tool (n, 6) N, N m, at the tool point in tool axes.

    Args:
        tool: Load on the sensor.
        R_base_sensor: (n, 3, 3).
        readings: (n, 6) N, N m in the sensor frame.
        acceleration: (n, 3) m/s^2 of the centre of mass, in base axes (an accelerometer without
            gravity, or ``centre_acceleration``); None: at rest, which is wrong by mass times
            acceleration as soon as the spindle runs.
        T_sensor_tool: (4, 4); default: the sensor frame itself.

    Raises:
        ShapeError: Other shapes.
    """
    n = len(readings)
    turned = frozen(R_base_sensor, (n, 3, 3), "R_base_sensor").transpose(0, 2, 1)
    wrench = frozen(readings, (n, 6), "readings")
    carried = np.tile(tool.weight_in_base, (n, 1))
    if acceleration is not None:
        carried = carried - tool.mass * frozen(acceleration, (n, 3), "acceleration")
    pull = np.einsum("nij,nj->ni", turned, carried)
    force = wrench[:, :3] - tool.force_offset - pull
    moment = wrench[:, 3:] - tool.moment_offset - np.cross(tool.centre, pull)
    if T_sensor_tool is None:
        return np.concatenate([force, moment], axis=1)
    T = frozen(T_sensor_tool, (4, 4), "T_sensor_tool")
    moment = moment - np.cross(T[:3, 3], force)
    return np.concatenate([force @ T[:3, :3], moment @ T[:3, :3]], axis=1)


def centre_acceleration(centre_in_base: Array, rate: float, *, half_width: int = 5) -> Array:
    """Returns accelerations (n, 3) m/s^2 of a path of the centre of mass, from joint kinematics.

    Second derivative of a local parabola (Savitzky and Golay 1964) over 2 ``half_width`` + 1
    samples.

    Args:
        centre_in_base: (n, 3) m, forward kinematics of measured joints applied to the centre.
        rate: Samples per second.
        half_width: Samples to each side.

    Raises:
        ShapeError: Fewer samples than the parabola takes.

    Fails when: the tool vibrates between flange and tip, or faster than the joints are read: no
    joint sees that. An accelerometer on the spindle does.
    """
    path = frozen(centre_in_base, (None, 3), "centre_in_base")
    width = 2 * half_width + 1
    if half_width < 1 or len(path) < width:
        raise ShapeError(f"{len(path)} samples, expected {max(3, width)} or more.")
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(path, width, 2, deriv=2, delta=1.0 / rate, axis=0))


def _solve_least_squares(design: Array, values: Array) -> tuple[Array, float, Array]:
    """Least squares: unknowns, noise of a value, covariance of the unknowns."""
    found = np.linalg.lstsq(design, values, rcond=None)[0]
    residual = values - design @ found
    freedom = len(values) - len(found)
    noise = float(np.sqrt(residual @ residual / freedom))
    covariance = noise**2 * np.linalg.inv(design.T @ design)
    return np.asarray(found), noise, np.asarray(covariance, dtype=np.float64)


def _check_forces(wrench: Array, force_noise: float, mass: float, mass_sd: float) -> None:
    spread = float(np.ptp(wrench[:, :3], axis=0).max())
    if force_noise > 0.2 * spread and spread > 10.0 * _WEIGHED * STANDARD_GRAVITY:
        raise ImplausibleDataError(
            f"forces change by {spread:.4g} N from pose to pose and are {force_noise:.3g} N off "
            "any weight.",
            hint="the arm at rest, the cutter off the part, R_base_sensor of the same poses; a "
            "sensor frame that is turned must be stated.",
        )
    if mass < max(_WEIGHED, 5.0 * mass_sd):
        raise ImplausibleDataError(
            f"the tool would weigh {mass:.3g} +- {mass_sd:.2g} kg: the sensor has no load, or its "
            "force is not in N.",
            hint="check the unit and the sensor's own tare function, which must be off.",
        )
    if mass > _HEAVIEST:
        raise ImplausibleDataError(
            f"the tool would weigh {mass:.4g} kg, expected at most {_HEAVIEST:g} kg.",
            hint="check the unit: counts, mN or grams are not N.",
        )


def _check_moments(wrench: Array, moment_noise: float, mass: float, centre: Array) -> None:
    weight = mass * STANDARD_GRAVITY
    spread = float(np.ptp(wrench[:, 3:], axis=0).max())
    if moment_noise > 0.2 * spread and moment_noise > 0.005 * weight:
        raise ImplausibleDataError(
            f"moments are {moment_noise:.3g} N m off any centre of mass, of {spread:.3g} N m in "
            "all.",
            hint="check the order and unit of the moments.",
        )
    if np.linalg.norm(centre) > 2.0:
        raise ImplausibleDataError(
            f"the centre of mass would lie {np.linalg.norm(centre) / MM:.0f} mm from the sensor.",
            hint="moments in N m, forces in N.",
        )
