"""Settings of the sensing service, and what their addresses and files state."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs

import numpy as np

from robotrue.core.provenance import Provenance, read_provenance, simulation_mark
from robotrue.errors import ConfigurationError
from robotrue.online.correction_settings import CorrectionSettings, without_password
from robotrue.online.replay_blocks import Repeats, force_blocks
from robotrue.online.sensing_files import SensingFiles, provenances


@dataclass(frozen=True, slots=True, kw_only=True)
class SenseSettings:
    """The service: what it reads, what it writes, how long it runs.

    Attributes:
        files: Of the estimator.
        robot: Address of the joints.
        force: Address of the forces.
        peer: Host and port of the controller; other senders are ignored.
        correction: Of the robot; None sends none.
        out: Addresses of sinks.
        record: Folder of the record.
        resume: Goes on with the record and the files that are there.
        rate: Force samples per second, where no address says it.
        clock: File of ``robotrue sense align``.
        name: Of the cell, in topics and pages.
        note: Shown beside every estimate.
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
        """Whether both streams are files, that can wait."""
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
    stated = parse_qs(settings.force.partition("?")[2]).get("rate", [])
    if settings.rate is not None:
        return settings.rate
    if stated and stated[0].lower().removesuffix("hz").replace(".", "", 1).isdigit():
        return float(stated[0].lower().removesuffix("hz"))
    scheme = settings.force.partition("://")[0].lower()
    if scheme == "egm":
        return 250.0
    if scheme == "rtde":
        return 500.0
    if scheme != "replay":
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
