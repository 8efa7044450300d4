"""The files of a job: those named, those their dialect expects beside them, those they name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.program.program import Dialect


@runtime_checkable
class NamesFiles(Protocol):
    """A dialect whose programs name further files of their job."""

    def named_files(self, data: bytes) -> tuple[str, ...]:
        """Returns the names of files beside the program that its text names."""
        ...


@dataclass(frozen=True, slots=True)
class JobFiles:
    """What is read together.

    Attributes:
        folder: Where the files lie.
        given: How many were named by the user; they come first.
        files: Name and bytes.
    """

    folder: Path
    given: int
    files: tuple[tuple[str, bytes], ...]


def paths_of(given: str | Path | Sequence[str | Path], suffixes: Iterable[str]) -> list[Path]:
    """Returns the files that are meant: one, several, or all programs of a folder.

    Args:
        given: A file, a folder, or several files of one folder.
        suffixes: Of programs, in lower case: what is taken of a folder.

    Raises:
        FormatError: An empty folder, or files of several.
    """
    paths = [Path(given)] if isinstance(given, str | Path) else [Path(each) for each in given]
    if len(paths) == 1 and paths[0].is_dir():
        wanted = set(suffixes)
        found = [each for each in sorted(paths[0].iterdir()) if each.suffix.lower() in wanted]
        if not found:
            raise FormatError(
                f"no program in this folder; files end in {', '.join(sorted(wanted))}.",
                source=paths[0],
                hint="name the files.",
            )
        return found
    folders = {path.parent.resolve() for path in paths}
    if len(folders) != 1:
        raise FormatError(
            f"{len(paths)} files in {len(folders)} folders, expected those of one job in one.",
            source=paths[0] if paths else None,
            hint="copy the job into one folder, as it lies on the controller.",
        )
    return paths


def gathered(paths: Sequence[Path], language: Dialect) -> JobFiles:
    """Returns the files of a job in the order they are read.

    Raises:
        FormatError: A file cannot be read.
    """
    files: list[tuple[str, bytes]] = []
    taken: list[Path] = []

    def take(path: Path) -> None:
        if path.is_file() and not any(path.samefile(other) for other in taken):
            taken.append(path)
            files.append((path.name, read_bytes(path)))

    for path in paths:
        if not path.is_file():
            read_bytes(path)  # says what is wrong
        take(path)
    given = len(files)
    for path in paths:
        for name in language.companions(path.name):
            take(path.with_name(name))
    if isinstance(language, NamesFiles):
        for _, data in list(files):
            for name in language.named_files(data):
                take(paths[0].with_name(name))
    return JobFiles(paths[0].parent, given, tuple(files))
