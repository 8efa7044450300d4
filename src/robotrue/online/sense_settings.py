"""Settings of the sensing service, and what their addresses and files state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array, parse_number_list
from robotrue.core.provenance import Provenance, read_provenance, simulation_mark
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.online.addresses import protocol_of, require_answers
from robotrue.online.answering_link import answering_guard
from robotrue.online.corrections import Corrections, PathAxes, fixed_axes
from robotrue.online.guard import CorrectionLimits
from robotrue.online.replay_blocks import Repeats, force_blocks
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.sensing_files import SensingFiles, provenances
from robotrue.robot.forward import forward


@dataclass(frozen=True, slots=True, kw_only=True)
class SenseSettings:
    """Settings of the service: inputs, outputs, duration.

    Attributes:
        files: Of the estimator.
        robot: Address of the joints.
        force: Address of the forces.
        peer: Host and port of the controller; other senders are ignored.
        correction: Of the robot; None sends none.
        out: Addresses of sinks.
        record: Folder of the record.
        resume: Continues the existing record and files.
        rate: Force samples per second, where no address states it.
        clock: File of ``robotrue sense align``.
        name: Of the cell, in topics and pages.
        note: Shown with every estimate.
        nodesets: Folder of OPC UA NodeSet files.
        seconds: How long; None until the forces end or it is stopped.
    """

    files: SensingFiles
    robot: str
    force: str
    peer: tuple[str, int] | None = None
    correction: CorrectionSettings | None = None
    out: tuple[str, ...] = ()
    record: Path | None = None
    resume: bool = False
    rate: float | None = None
    clock: Path | None = None
    name: str | None = None
    note: str = ""
    nodesets: Path | None = None
    seconds: float | None = None

    @property
    def replayed(self) -> bool:
        """True if both streams are files, which can wait."""
        return all(a.lower().startswith("replay://") for a in (self.robot, self.force))


def origins_of(settings: SenseSettings) -> dict[str, Provenance]:
    """Returns where models and replayed streams come from, by role; a live wire states nothing."""
    found = provenances(settings.files)
    for role in ("robot", "force"):
        address = getattr(settings, role)
        if address.lower().startswith("replay://"):
            found[role] = read_provenance(path_of(address))
    return found


def marked_note(note: str, origin: Provenance) -> str:
    """Returns the note that every sink shows, with the mark in front where it lacks it."""
    mark = simulation_mark(origin, "simulated")
    if not mark or mark in note.lower():
        return note
    return f"{mark}, {note}" if note else mark


def force_rate(settings: SenseSettings) -> float:
    """Returns force samples per second: as stated, of the address, or of a file's first second.

    Raises:
        ConfigurationError: Nothing states it.
    """
    if settings.rate is not None:
        return settings.rate
    stated = _query_value(settings.force, "rate").lower().removesuffix("hz")
    if stated.replace(".", "", 1).isdigit():
        return float(stated)
    usual = protocol_of(settings.force, "force").force_rate
    if usual is not None:
        return usual
    if not settings.force.lower().startswith("replay://"):
        raise ConfigurationError(
            "the force samples per second are not stated.",
            source=without_password(settings.force),
            hint="--rate-hz 1000, or rate=1000Hz in the address.",
        )
    path = Path(path_of(settings.force))
    for block in force_blocks(path, Repeats(), frame="sensor"):
        step = np.diff(block.controller_time[block.valid])
        if len(step) and np.median(step) > 0.0:
            return round(1.0 / float(np.median(step)), 3)
        break
    raise ConfigurationError(
        "the file does not show its samples per second.", source=path, hint="--rate-hz 1000"
    )


def path_of(address: str) -> str:
    """Returns the path of a file in a ``replay://`` address."""
    return address.partition("://")[2].partition("?")[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionSettings:
    """Settings of the robot correction.

    Attributes:
        limits: Largest correction, its fastest change, the watchdog.
        host: Address of the controller; other senders are ignored.
        axes: Of the controller's correction: "base", "tool", "path", or "A,B,C" in deg.
        cutoff: Hz, of the low-pass on corrections.
        trust_restart: RSI: a Delay near zero after a pause is a new RSI_ON without correction.
        confirm_zero: The operator has checked that the robot holds no correction.
    """

    limits: CorrectionLimits
    host: str
    axes: str
    cutoff: float
    trust_restart: bool = False
    confirm_zero: bool = False


def correction_limits(
    robot: str,
    *,
    limit_mm: float | None,
    rate_mm_per_s: float | None,
    watchdog_ms: float,
    recover: bool,
) -> CorrectionLimits:
    """Returns what corrections keep within.

    Args:
        robot: Its address, which may state the cycle.
        limit_mm: Largest correction.
        rate_mm_per_s: Its fastest change.
        watchdog_ms: Corrections ramp to zero when the newest estimate is older.
        recover: After a fault corrections begin again from zero.

    Raises:
        ConfigurationError: No limit or no rate is stated, or an invalid one.
    """
    if limit_mm is None or rate_mm_per_s is None:
        raise ConfigurationError(
            "corrections without limits.",
            hint="--limit-mm 0.2 --rate-mm-per-s 1, and the same in the controller (POSCORR).",
        )
    return CorrectionLimits(
        shift=limit_mm * MM,
        shift_rate=rate_mm_per_s * MM,
        cycle=12e-3 if _query_value(robot, "cycle").startswith("12") else 4e-3,
        timeout=watchdog_ms * 1e-3,
        latch=not recover,
    )


def require_correctable(robot: str, axes: str) -> None:
    """Passes if the robot of an address takes corrections in such axes.

    Raises:
        ConfigurationError: It takes none, or none in the axes of its path.
    """
    protocol = protocol_of(robot)
    require_answers(without_password(robot), protocol)
    if axes == "path" and not protocol.takes_path_axes:
        raise ConfigurationError(
            f"--correct-in path with {without_password(robot)}: only egm:// controllers take a "
            "correction in the axes of their path.",
            hint="base, tool, or A,B,C in deg.",
        )


def corrections_of(settings: CorrectionSettings, robot: str, cell: Cell) -> Corrections:
    """Returns the corrections that a robot is sent.

    Raises:
        ConfigurationError: It takes none of these, or axes that cannot be read.
    """
    require_correctable(robot, settings.axes)
    relative = _query_value(robot, "mode") == CorrectionMode.RELATIVE.value
    mode = CorrectionMode.RELATIVE if relative else CorrectionMode.ABSOLUTE
    guard = answering_guard(settings.limits, mode)
    return Corrections(guard, _axes(settings.axes, cell), cutoff=settings.cutoff)


def without_password(address: str) -> str:
    """Returns an address as it may be written down."""
    scheme, mark, rest = address.partition("://")
    head, at, tail = rest.rpartition("@")
    return f"{scheme}{mark}{'...@' if at and head else ''}{tail}"


def _query_value(address: str, name: str) -> str:
    """Returns the value of ``name`` in the query of an address, or an empty string."""
    return parse_qs(address.partition("?")[2]).get(name, [""])[0]


def _axes(text: str, cell: Cell) -> Callable[[Array], Array]:
    """The axes of the controller's correction in base, for joints as displayed."""
    if text == "base":
        return fixed_axes(np.eye(3))
    if text in ("tool", "path"):

        def pose(joints: Array) -> Array:
            own = cell.robot.controller.to_model(joints)
            return np.asarray(forward(cell.robot, own[None])[0])

        return PathAxes(pose) if text == "path" else lambda joints: pose(joints)[:3, :3]
    angles = parse_number_list(text)
    if len(angles) != 3:
        raise ConfigurationError(
            f"--correct-in {text!r}, expected base, tool, path, or A,B,C in deg.",
            hint="as RSI_ON and the sensor's frame of the running program say.",
        )
    return fixed_axes(matrix_from_abc(angles * DEG))
