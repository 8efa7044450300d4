"""The files of a job: those named, those their dialect expects next to them, those they name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.program.frames_beside import frame_file_names
from robotrue.program.identity import identity_path, read_identity
from robotrue.program.language import Language

_PROJECT: Final = 1 << 20
"""Bytes of a file that names those of its job: fewer."""


@dataclass(frozen=True, slots=True)
class JobFiles:
    """Files that are read together.

    Attributes:
        folder: Where the files lie.
        given: How many were named by the user; they come first.
        files: Name and bytes.
        named: Files that programs of the job name.
    """

    folder: Path
    given: int
    named: frozenset[str]
    files: tuple[tuple[str, bytes], ...]


def paths_of(given: str | Path | Sequence[str | Path], suffixes: Iterable[str]) -> list[Path]:
    """Returns the files that are meant: one, several, or all programs of a folder.

    Args:
        given: A file, a folder, or several files of one folder.
        suffixes: Of programs, in lower case: what is taken of a folder.

    Raises:
        FormatError: An empty folder, files of several, or a damaged identity of a program.
    """
    paths = [Path(given)] if isinstance(given, str | Path) else [Path(each) for each in given]
    if len(paths) == 1 and paths[0].is_dir():
        wanted, frame_files = set(suffixes), frame_file_names()
        found = [
            each
            for each in [*sorted(paths[0].iterdir()), *_files_below(paths[0])]
            if each.suffix.lower() in wanted
            and each.name.lower() not in frame_files
            and not each.name.startswith("$")  # KUKA's own
            and each.is_file()
        ]
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


def _files_below(folder: Path) -> list[Path]:
    """Returns the files in the folders of a folder, at any depth.

    Those with a dot are left out, and programs compensated before: a job may be compensated into a
    subfolder, and again.
    """
    out = []
    for each in sorted(folder.rglob("*")):
        parts = each.relative_to(folder).parts
        hidden = any(part.startswith(".") for part in parts)
        if len(parts) > 1 and not hidden and not _is_compensated(each):
            out.append(each)
    return out


def _is_compensated(path: Path) -> bool:
    """Returns true if the file next to a program marks it as compensated."""
    if not identity_path(path).is_file():
        return False
    identity = read_identity(path, read_bytes(path))
    return identity is not None and identity.compensated


def name_in_job(path: Path, root: Path | None) -> str:
    """Returns the name of a file in a job: with its folders if the job is a folder."""
    return path.name if root is None else path.relative_to(root).as_posix()


def named_last(paths: Sequence[Path], languages: Iterable[Language]) -> list[Path]:
    """Returns the files with those after the others that another of them names.

    Raises:
        FormatError: A file cannot be read.
    """
    named: set[str] = set()
    for language in languages if len(paths) > 1 else ():
        if language.name_files:
            mine = [path for path in paths if path.suffix.lower() in language.suffixes]
            named |= {name for path in mine for name in language.name_files(read_bytes(path))}
    return sorted(paths, key=lambda path: path.name in named)


def companion_paths(path: Path, language: Language) -> list[Path]:
    """Returns the files that lie next to a program because of its name."""
    found: list[Path] = []
    for name in language.name_companions(path.name):
        beside = path.with_name(name)
        if beside.is_file() and not any(beside.samefile(one) for one in (path, *found)):
            found.append(beside)
    return found


def outlined_paths(path: Path, language: Language) -> list[Path]:
    """Returns a file, and those next to it because of its name, or that it names as a project.

    Raises:
        FormatError: The project cannot be read.
    """
    found = [path, *companion_paths(path, language)]
    if language.name_files and path.stat().st_size < _PROJECT:
        named = [path.with_name(name) for name in sorted(language.name_files(read_bytes(path)))]
        mine = [each for each in named if each.suffix.lower() in language.suffixes]
        found += [each for each in mine if each.is_file() and each not in found]
    return found


def gather_files(
    paths: Sequence[Path],
    language: Language,
    *,
    instead: Mapping[str, bytes] | None = None,
    root: Path | None = None,
) -> JobFiles:
    """Returns the files of a job in the order they are read.

    Args:
        paths: The files named by the user.
        language: Of the files.
        instead: Bytes that replace the files of these names, which are not read from the disk.
        root: The folder the job is, if it is one.

    Raises:
        FormatError: A file cannot be read.
    """
    files: list[tuple[str, bytes]] = []
    taken: set[tuple[int, int]] = set()

    def take(path: Path) -> None:
        stat = path.stat() if path.is_file() else None
        if stat is not None and (stat.st_dev, stat.st_ino) not in taken:
            taken.add((stat.st_dev, stat.st_ino))
            name = name_in_job(path, root)
            given = (instead or {}).get(name)
            files.append((name, read_bytes(path) if given is None else given))

    for path in paths:
        if not path.is_file():
            read_bytes(path)  # raises with the cause
        take(path)
    first = len(files)
    for path in paths:
        for beside in companion_paths(path, language):
            take(beside)
    named: set[str] = set()
    if language.name_files:
        named = {name for _, data in files for name in language.name_files(data)}
        for name in sorted(named):
            take(paths[0].with_name(name))
    return JobFiles(root or paths[0].parent, first, frozenset(named), tuple(files))
