"""A workspace: a folder with a database and the files its rows name; opened, written, swept."""

from __future__ import annotations

import contextlib
import json
import os
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final

from sqlalchemy import Connection, Engine, insert, select
from sqlalchemy.exc import IntegrityError, InterfaceError, OperationalError
from sqlalchemy.orm import Session

from robotrue.core.files import read_bytes, write_atomic
from robotrue.errors import ArchiveError, ConfigurationError, FormatError, ModelMismatchError
from robotrue.store.blobs import BLOBS, Staging, require_whole, stored_path, sweep
from robotrue.store.database import WRITING, engine_at, may_write, read_only, unreachable
from robotrue.store.locks import POSIX, hold_alone, hold_shared
from robotrue.store.migrate import HEAD, migrate, require_known, revision_of
from robotrue.store.schema import BlobRow, WorkspaceRow
from robotrue.version import __version__

MARK: Final = "workspace.json"
LOCK: Final = "lock"
VARIABLE: Final = "ROBOTRUE_DB"
FORMAT: Final = "robotrue-workspace"
FORMAT_VERSION: Final = 1


class Workspace:
    """An open workspace; several processes may have it open and write to it.

    Attributes:
        folder: Where it is.
        url: Of the database where that is not the one in the folder; may hold a password.
        id: Of the workspace, in the folder and in the database.
        engine: The database.
        swept: Files of killed processes that opening removed.
    """

    def __init__(self, folder: Path, url: str | None, identity: str, engine: Engine) -> None:
        self.folder, self.url, self.id, self.engine = folder, url, identity, engine
        self.swept = 0

    @classmethod
    def create(cls, path: str | Path, url: str | None = None) -> Workspace:
        """Makes a workspace in an empty or new folder, and opens it.

        Args:
            path: The folder.
            url: ``postgresql+psycopg://...``; None: that of ROBOTRUE_DB, else SQLite in the folder.

        Raises:
            ConfigurationError: The folder holds something already; the database does not answer.
            ModelMismatchError: The database belongs to another workspace.
            FormatError: The folder cannot be written to.
        """
        folder = Path(path).absolute()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            held = sorted(each.name for each in folder.iterdir())
        except OSError as cause:
            raise FormatError(f"cannot be a folder: {cause.strerror}.", source=path) from cause
        if held:
            what = "is a workspace already" if MARK in held else f"is not empty ({held[0]}, ...)"
            raise ConfigurationError(f"the folder {what}.", source=path, hint="a new folder.")
        mark = {"format": FORMAT, "format_version": FORMAT_VERSION, "id": str(uuid.uuid4())}
        engine = engine_at(folder, _url(url))
        with (
            _dispose_on_failure(engine, folder),
            _exclusively(folder),
            writing(engine) as connection,
        ):
            migrate(connection)
            row = connection.execute(select(WorkspaceRow.id)).scalar()
            if row is not None:
                raise ModelMismatchError(
                    f"the database belongs to workspace {row} already.",
                    source=path,
                    hint="one database for each workspace: CREATE DATABASE ...",
                )
            connection.execute(
                insert(WorkspaceRow),
                {"id": mark["id"], "created": now(), "made_by": __version__},
            )
            for name in (BLOBS, "samples"):
                (folder / name).mkdir(exist_ok=True)
            write_atomic(folder / MARK, (json.dumps(mark, indent=1) + "\n").encode())
        engine.dispose()
        return cls.open(folder, url)

    @classmethod
    def open(cls, path: str | Path, url: str | None = None) -> Workspace:
        """Opens a workspace; one of an older robotrue is brought up to date.

        Where the folder may not be written to, it can be read.

        Args:
            path: The folder.
            url: As in :meth:`create`.

        Raises:
            ConfigurationError: No workspace, its database does not answer, or it is of an older
                robotrue and read-only.
            ArchiveError: Damaged, or of a newer robotrue.
            ModelMismatchError: The database belongs to another workspace.
        """
        folder = Path(path).absolute()
        identity, url = _mark(folder), _url(url)
        engine = engine_at(folder, url)
        with _dispose_on_failure(engine, folder):
            with engine.connect() as connection:
                revision = revision_of(connection)
                require_known(revision)
            if revision != HEAD:
                if not may_write(folder):
                    raise ConfigurationError(
                        "the workspace is of an older robotrue, and read-only for this user.",
                        source=path,
                        hint="open it once with write access.",
                    )
                with _exclusively(folder), writing(engine) as connection:
                    migrate(connection)
            with engine.connect() as connection:
                _require_own(connection, identity, folder)
            opened = cls(folder, url, identity, engine)
            opened.swept = opened._sweep()
        return opened

    def close(self) -> None:
        """Lets go of the database."""
        self.engine.dispose()

    def __enter__(self) -> Workspace:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @contextlib.contextmanager
    def read(self) -> Iterator[Session]:
        """Gives a session to read with.

        Raises:
            DatabaseDownError: The database does not answer.
        """
        with _convert_unreachable(self.folder), Session(self.engine) as session:
            yield session

    @contextlib.contextmanager
    def write(self) -> Iterator[Transaction]:
        """Yields a transaction, committed when the block ends, rolled back on an error.

        Raises:
            DatabaseDownError: The database does not answer.
        """
        transaction = Transaction(self)
        with _convert_unreachable(self.folder), transaction.running():
            yield transaction

    def path_of(self, digest: str) -> Path:
        """Returns the path of a file, for reading.

        Raises:
            ConfigurationError: No row names it.
        """
        with self.read() as session:
            row = session.get(BlobRow, digest)
            if row is None:
                raise ConfigurationError(f"no file {digest[:12]} in the workspace.")
            return stored_path(self.folder, row.place, digest)

    def content(self, digest: str) -> bytes:
        """Returns the content of a file, checked.

        Raises:
            ConfigurationError: No row names it.
            ArchiveError: It is missing or was altered.
        """
        path = self.path_of(digest)
        require_whole(path, digest)
        return read_bytes(path)

    def _sweep(self) -> int:
        # Without locks a process that still writes cannot be detected.
        if not POSIX or not may_write(self.folder):
            return 0
        with hold_alone(self.folder / LOCK, wait=False) as mine:
            if not mine:
                return 0
            with self.read() as session:
                return sweep(self.folder, lambda digest: session.get(BlobRow, digest) is not None)


class Transaction:
    """Files and rows that are committed together.

    Files are imported first, so that the database is locked for rows alone.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._staging = Staging(workspace.folder, uuid.uuid4().hex)
        self._stack = contextlib.ExitStack()
        self._session: Session | None = None
        self._kept: dict[str, tuple[str, int]] = {}
        self._locked = False

    @property
    def session(self) -> Session:
        """The session; from here on other writers wait."""
        if self._session is None:
            engine = self.workspace.engine.execution_options(**{WRITING: True})
            self._session = self._stack.enter_context(Session(engine))
            self._session.connection()
        for digest, (place, size) in sorted(self._kept.items()):  # one order: no deadlock
            if self._session.get(BlobRow, digest) is None:
                row = BlobRow(sha256=digest, place=place, size=size, created=now())
                with _first_wins(self._session):
                    self._session.add(row)
                    self._session.flush()
        self._kept.clear()
        return self._session

    def keep(self, source: bytes | Path | BinaryIO, *, place: str = BLOBS) -> str:
        """Imports a file and returns its SHA-256.

        Raises:
            FormatError: It cannot be read, or the workspace not be written to.
            ConfigurationError: This user may only read the workspace.
        """
        if not self._locked:
            if not may_write(self.workspace.folder):
                raise read_only(self.workspace.folder)
            self._stack.enter_context(hold_shared(self.workspace.folder / LOCK))
            self._locked = True
        digest, size = self._staging.keep(source, place)
        self._kept[digest] = (place, size)
        return digest

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Commits at the end of the block, or takes everything back."""
        with self._stack:
            yield
            if self._session is not None or self._kept:
                self.session.commit()
            self._staging.clear()


@contextlib.contextmanager
def _first_wins(session: Session) -> Iterator[None]:
    """Resolves a race of two writers for the same file: its row is written once."""
    with contextlib.suppress(IntegrityError), session.begin_nested():
        yield


@contextlib.contextmanager
def transaction(where: Workspace | Transaction) -> Iterator[Transaction]:
    """Gives the transaction itself, or a new one of the workspace."""
    if isinstance(where, Transaction):
        yield where
    else:
        with where.write() as begun:
            yield begun


@contextlib.contextmanager
def reading(where: Workspace | Transaction) -> Iterator[Session]:
    """Gives the session of the transaction, or a new one of the workspace."""
    if isinstance(where, Transaction):
        yield where.session
    else:
        with where.read() as session:
            yield session


def now() -> datetime:
    """Returns the time, with its zone."""
    return datetime.now(UTC)


@contextlib.contextmanager
def writing(engine: Engine) -> Iterator[Connection]:
    """Gives a connection in a transaction that writes from its beginning."""
    with engine.execution_options(**{WRITING: True}).begin() as connection:
        yield connection


@contextlib.contextmanager
def _dispose_on_failure(engine: Engine, folder: Path) -> Iterator[Engine]:
    """Gives the engine; lets go of the database where the block fails."""
    try:
        with _convert_unreachable(folder):
            yield engine
    except BaseException:
        engine.dispose()
        raise


@contextlib.contextmanager
def _convert_unreachable(folder: Path) -> Iterator[None]:
    try:
        yield
    except (OperationalError, InterfaceError) as cause:
        raise unreachable(cause, folder) from None


@contextlib.contextmanager
def _exclusively(folder: Path) -> Iterator[None]:
    with hold_alone(folder / LOCK, wait=True):
        yield


def _url(url: str | None) -> str | None:
    return url or os.environ.get(VARIABLE) or None


def _mark(folder: Path) -> str:
    path = folder / MARK
    if not path.is_file():
        raise ConfigurationError(
            "no workspace.", source=folder, hint="robotrue workspace init FOLDER makes one."
        )
    try:
        stated = json.loads(read_bytes(path))
        version, identity = int(stated["format_version"]), str(stated["id"])
    except (ValueError, KeyError, TypeError) as cause:
        raise ArchiveError(
            f"the mark of the workspace is damaged ({cause}).",
            source=path,
            hint="fetch it from a backup.",
        ) from None
    if stated.get("format") != FORMAT or version > FORMAT_VERSION:
        raise ArchiveError(
            f"workspace format {version}, this robotrue reads up to {FORMAT_VERSION}.",
            source=path,
            hint="update robotrue.",
        )
    return identity


def _require_own(connection: Connection, identity: str, folder: Path) -> None:
    found = connection.execute(select(WorkspaceRow.id)).scalar()
    if found != identity:
        raise ModelMismatchError(
            f"the folder is workspace {identity}, its database that of {found}.",
            source=folder,
            hint=f"set {VARIABLE} to the database of this folder, or unset it.",
        )
