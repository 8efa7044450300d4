"""What the store answers with: an immutable record per noun, pages of them, what to ask for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ref:
    """One version of one item."""

    id: str
    version: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """What a version rests on.

    Attributes:
        role: ``data``, ``cell``, ``model``, ``parent``, ``before``, ``robot``, ``tool``, ...
        to: The version it rests on.
    """

    role: str
    to: Ref


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A file of a version.

    Attributes:
        role: What it is to the item: ``file``, ``raw``, ``model``, ``report``, ...
        name: The name it came with.
        sha256: Of its content; where it stands in the workspace.
    """

    role: str
    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One version of an item.

    Attributes:
        id: Never changes, also through export and import.
        version: From 1.
        latest: No newer version stands.
        deleted: This version says that the item is deleted.
        name: For people; need not be unique.
        note: What the user wrote.
        created: When this version was made.
        detail: What else its noun knows, JSON values; lengths and angles named with their unit or
            SI.
        links: What it rests on.
        attachments: Its files.
    """

    id: str
    version: int
    latest: bool
    deleted: bool
    name: str
    note: str
    created: datetime
    detail: Mapping[str, Any]
    links: tuple[Link, ...] = ()
    attachments: tuple[Attachment, ...] = ()

    @property
    def ref(self) -> Ref:
        """This version."""
        return Ref(id=self.id, version=self.version)

    def linked(self, role: str) -> tuple[Ref, ...]:
        """Returns what it rests on in one role, in order."""
        return tuple(link.to for link in self.links if link.role == role)

    def files(self, role: str) -> tuple[Attachment, ...]:
        """Returns its files of one role, in order."""
        return tuple(each for each in self.attachments if each.role == role)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotRecord(Record):
    """An arm as its controller computes it; ``identity`` is that of its nominal geometry."""

    maker: str
    dof: int
    identity: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolRecord(Record):
    """A tool; ``detail["T_flange_tool"]`` is its frame (4, 4), m."""

    identity: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CellRecord(Record):
    """A cell.toml with the files it names; links ``robot``, ``tool``."""

    digest: str
    robot: str
    frame: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementRecord(Record):
    """A measurement set; link ``cell``, files ``raw``.

    Attributes:
        frame: Of the positions: base or tracker.
        poses: Rows.
        dof: Joints.
        full_poses: Rows with orientation.
        data: SHA-256 of joints and positions, as fits record it.
        samples: SHA-256 of the Parquet file with the rows.
    """

    frame: str
    poses: int
    dof: int
    full_poses: int
    data: str
    samples: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRecord(Record):
    """An error model; links ``data``, ``cell``, ``parent``, ``job``; file ``model``.

    Attributes:
        kind: Of its archive.
        method: That made it.
        robot: Name of the arm.
        identity: SHA-256 by which programs and registrations know it.
        made_by: Version of robotrue.
        settings: That decided the result.
    """

    kind: str
    method: str
    robot: str
    identity: str
    made_by: str
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationRecord(Record):
    """Where a part stands; links ``cell``, ``model``; files ``cell``, ``points``."""

    method: str
    verdict: str
    frames: int
    identity: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramRecord(Record):
    """The files of one job; links ``before``, ``model``; files ``program``, ``identity``.

    Attributes:
        stage: ``before``: as the CAM made it. ``after``: compensated.
        dialect: The controller's language.
        file_count: How many.
        bytes: Of all files together.
    """

    stage: str
    dialect: str
    file_count: int
    bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DocumentRecord(Record):
    """What a job leaves besides models and programs; ``kind`` is plan, validation, report, ..."""

    kind: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftCheckRecord(Record):
    """A few poses against a stored model; links ``model``, ``data``.

    Attributes:
        poses: Measured.
        statistic: Chi-square.
        p_value: Of it under the stored model.
        verdict: keep, update or recalibrate.
    """

    poses: int
    statistic: float
    p_value: float
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """What to list.

    Attributes:
        text: Part of the name or the note, in any case of letters; empty: all.
        where: Fields of the record that must have these values.
        linked: A role and the id of the item it must rest on.
        sort: Field to sort by, with ``-`` before it: greatest first.
        offset: Items left out before the page.
        limit: Items on the page.
        deleted: Those that are deleted, instead of those that are not.
    """

    text: str = ""
    where: Mapping[str, str | int | float] = field(default_factory=dict)
    linked: tuple[str, str] | None = None
    sort: str = "-created"
    offset: int = 0
    limit: int = 50
    deleted: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Generic[T]):
    """Some of what was asked for.

    Attributes:
        items: In order.
        total: How many there are on all pages.
        offset: Items before this page.
    """

    items: tuple[T, ...]
    total: int
    offset: int
