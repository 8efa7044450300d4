"""Verification: every file of a workspace is present and unaltered, every reference resolves."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select

from robotrue.errors import RobotrueError
from robotrue.store.blobs import PLACES, require_whole, stored_path
from robotrue.store.nouns import NOUNS
from robotrue.store.schema import BlobRow, ItemRow, LinkRow
from robotrue.store.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Result of a verification.

    Attributes:
        files: That the database names.
        bytes: Of them.
        items: Of all nouns, deleted ones, too.
        faults: One sentence each; empty: everything is whole.
        unnamed: Files that no row names: left by a process that was killed, or put there by hand.
    """

    files: int
    bytes: int
    items: int
    faults: tuple[str, ...]
    unnamed: tuple[str, ...]


def verify(workspace: Workspace) -> Verification:
    """Returns what is wrong with a workspace, every file read and hashed."""
    faults: list[str] = []
    with workspace.read() as session:
        blobs = [(row.sha256, row.place, row.size) for row in session.scalars(select(BlobRow))]
        items = {row.id: row.noun for row in session.scalars(select(ItemRow))}
        versions: set[tuple[str, int]] = set()
        for noun in NOUNS.values():
            table = noun.table
            rows = session.execute(select(table.id, table.version, table.latest))
            latest: dict[str, int] = {}
            for id, version, newest in rows:
                versions.add((id, version))
                latest[id] = latest.get(id, 0) + bool(newest)
            faults += [
                f"{noun.name} {id} has {count} latest versions, expected 1"
                for id, count in latest.items()
                if count != 1
            ]
            own = {id for id, name in items.items() if name == noun.name}
            faults += [f"{noun.name} {id} has no version" for id in sorted(own - set(latest))]
        for link in session.scalars(select(LinkRow)):
            for end in ((link.id, link.version), (link.to_id, link.to_version)):
                if end not in versions:
                    faults.append(
                        f"a link ({link.role}) names {end[0]} {end[1]}, which is not there"
                    )
    for sha256, place, _ in blobs:
        try:
            require_whole(stored_path(workspace.folder, place, sha256), sha256)
        except RobotrueError as cause:
            faults.append(str(cause))
    named = {stored_path(workspace.folder, place, sha256) for sha256, place, _ in blobs}
    standing = (p for place in PLACES for p in (workspace.folder / place).rglob("*"))
    unnamed = sorted(
        str(path.relative_to(workspace.folder))
        for path in standing
        if path.is_file() and path not in named
    )
    return Verification(
        files=len(blobs),
        bytes=sum(size for _, _, size in blobs),
        items=len(items),
        faults=tuple(faults),
        unnamed=tuple(unnamed),
    )
