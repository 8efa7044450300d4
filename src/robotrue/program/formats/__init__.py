"""Programs of every language: read a job, write a program.

A program on a controller is often more than one file: the motions in a ``.src``, the points in the
``.dat`` beside it. A job is all of them, one :class:`Program` each::

    job = read_job("part.src", frames)
    for program in job:
        replacement = ...
        write_atomic(folder / program.name, write_program(program, replacement))

:mod:`robotrue.program.lang` lists the languages.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final

from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.program.formats.job_files import gather_files, named_last, paths_of
from robotrue.program.frames_beside import with_files_beside
from robotrue.program.lang import find_language, language_names
from robotrue.program.language import Language, Unfollowed
from robotrue.program.program import FrameTable, Program, Replacement

_INSTEAD: Final = {
    ".urp": "give the .script that the pendant saves beside it.",
    ".tp": "export the program as text (.LS); TP is its binary form.",
    ".pgf": "give the modules (.mod) that it lists.",
    ".rdk": "give the program that its post processor writes.",
}
"""What to give instead of a file that holds or lists a program in another form, by its suffix."""
_SURE: Final = 0.4
_LOOKED_AT: Final = 1 << 18


def detect(data: bytes, name: str) -> Language:
    """Returns the dialect of a file from its content and, where that is not enough, its name.

    A file whose content no dialect recognises goes to the one that owns its suffix, so that the
    refusal names the line. Bytes with a NUL are no text, whatever words chance put into them.

    Raises:
        FormatError: Neither content nor suffix belongs to a registered dialect.
    """
    suffix = Path(name).suffix.lower()
    sure = _find_sure(data, suffix)
    owners = _list_owners(suffix)
    if sure is not None or owners:
        return sure or owners[0]
    raise FormatError(
        f"not a supported program; supported are {', '.join(language_names())}.",
        source=name,
        line=1,
        hint=_INSTEAD.get(suffix, "give the file the controller runs, with its own suffix."),
    )


def _list_owners(suffix: str) -> list[Language]:
    """Returns the languages that own a suffix."""
    known = (find_language(name) for name in language_names())
    return [each for each in known if suffix in each.suffixes]


def _find_sure(data: bytes, suffix: str) -> Language | None:
    """Returns the language that bytes are in for sure, None if they are in none.

    Owners of the suffix are scored first: most files have one; a language takes milliseconds.
    """
    if b"\0" in data[:_LOOKED_AT]:
        return None
    best, sure = None, 0.0
    for each in [*_list_owners(suffix), *map(find_language, language_names())]:
        score = each.detect(data)
        if score >= 1.0:
            return each
        if score > sure or (score == sure and best is not None and each.name < best.name):
            best, sure = each, score
    return best if sure >= _SURE else None


def read_job(
    path: str | Path | Sequence[str | Path],
    frames: FrameTable | None = None,
    *,
    instead: Mapping[str, bytes] | None = None,
) -> tuple[Program, ...]:
    """Returns the programs of a job: the files named first, then companions that hold targets.

    Tools and work frames in files of the controller next to them (``$config.dat``, ``TOOL.CND``,
    ``UFRAME.CND``, ``SYSFRAME.VA``) are read, too; those of ``frames`` override them.

    Args:
        path: A program file, a folder of one job, or several files of it; companions (KRL: the
            ``.dat`` of a ``.src``) lie beside them.
        frames: Frames that the program names but does not hold; base and flange if not given.
        instead: Bytes that replace the files of these names on the disk: the job as it would read
            if they were written.

    Raises:
        FormatError: A file cannot be read, is not in a registered dialect, or in another than the
            first; below a folder each language is a separate job.
    """
    every = [find_language(name) for name in language_names()]
    given = [Path(path)] if isinstance(path, str | Path) else [Path(each) for each in path]
    root = given[0] if len(given) == 1 and given[0].is_dir() else None
    found = paths_of(path, {s for each in every for s in each.suffixes})
    frames = frames or FrameTable()
    (paths, language), *others = _by_language(named_last(found, every), root)
    programs = list(_read_files(paths, language, frames, root, instead or {}))
    left_out = []
    for paths, language in others:
        try:
            programs += _read_files(paths, language, frames, root, instead or {})
        except FormatError as cause:
            left_out.append(f"{len(paths)} files in {language.name} are left out: {cause}")
    if left_out:
        programs[0] = replace(programs[0], notes=(*programs[0].notes, *left_out))
    return tuple(programs)


def _read_files(
    paths: Sequence[Path],
    language: Language,
    frames: FrameTable,
    root: Path | None,
    instead: Mapping[str, bytes],
) -> tuple[Program, ...]:
    """Returns the programs of files in one language, with companions that hold targets."""
    job = gather_files(paths, language, root=root)
    for name, data in job.files[1 : job.given]:
        other = language if name in job.named or "/" in name else detect(data, name)
        if other.name != language.name:
            raise FormatError(
                f"{name} is a program in {other.name}, {paths[0].name} one in {language.name}.",
                source=paths[0].with_name(name),
                hint="give the files of one job.",
            )
    table, notes = with_files_beside(paths[0], language.name, frames, root=root)
    files = [(name, instead.get(name, data)) for name, data in job.files]
    with _pause_collector():
        programs = language.read_job(files, frames=table)
    if notes:
        programs = (replace(programs[0], notes=(*programs[0].notes, *notes)), *programs[1:])
    named = programs[: job.given]
    return named + tuple(program for program in programs[job.given :] if len(program))


@contextmanager
def _pause_collector() -> Iterator[None]:
    """Keeps the garbage collector from passing over the objects of a reader again and again.

    A reader makes several per target, all of them needed and none in a cycle; of a long program the
    passes take a tenth to a fifth of its time.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _by_language(paths: list[Path], root: Path | None) -> list[tuple[list[Path], Language]]:
    """Returns the files of a job by their language, that of the job first.

    Files below a folder that are in no language for sure are no programs of it.
    """
    deep = [path for path in paths if root is not None and path.parent != root]
    sure = {path: _find_sure(read_bytes(path), path.suffix.lower()) for path in deep}
    if len(deep) < len(paths):
        first = next(path for path in paths if path not in sure)
        language = detect(read_bytes(first), first.name)
    else:
        names = [each.name for each in sure.values() if each is not None]
        if not names:
            return [(deep, detect(read_bytes(deep[0]), deep[0].name))]
        language = find_language(max(dict.fromkeys(names), key=names.count))
    groups: dict[str, list[Path]] = {language.name: []}
    for path in paths:
        own: Language | None = language
        if path in sure and language.detect(read_bytes(path)) < _SURE:
            own = sure[path]
        if own is not None and (path not in sure or path.suffix.lower() in own.suffixes):
            groups.setdefault(own.name, []).append(path)
    return [(group, find_language(name)) for name, group in groups.items()]


def read_program(path: str | Path, frames: FrameTable | None = None) -> Program:
    """Returns the program of a job that is one file.

    Raises:
        FormatError: As :func:`read_job`; or the targets are in more than one file.
    """
    job = read_job(path, frames)
    if len(job) > 1:
        raise FormatError(
            f"the targets are in {len(job)} files: {', '.join(p.name for p in job)}.",
            source=path,
            hint="read them together with read_job and write each.",
        )
    return job[0]


def list_unfollowed(program: Program, replacement: Replacement) -> tuple[Unfollowed, ...]:
    """Returns what the written program cannot hold of a replacement."""
    return find_language(program.dialect).losses(program, replacement)


def write_program(program: Program, replacement: Replacement) -> bytes:
    """Returns the program's bytes with the changed numbers replaced and nothing else touched.

    Raises:
        ConfigurationError: Its dialect is not registered.
        ShapeError: A changed row has a value that cannot be written.
    """
    return find_language(program.dialect).write(program, replacement)
