"""Controller dialects by name, and the two verbs that use them: read a job, write a program.

A program on a controller is often more than one file: the motions in a ``.src``, the points in the
``.dat`` beside it. A job is all of them, one :class:`Program` each::

    job = read_job("part.src", frames)
    for program in job:
        replacement = ...
        write_atomic(folder / program.name, write_program(program, replacement))

A dialect is a leaf file with a module-level ``DIALECT``; :func:`register` names it, and it is
imported when it is first asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Final, Protocol, cast, runtime_checkable

from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.controller_files import with_files_beside
from robotrue.program.formats.job_files import gather_files, named_last, paths_of
from robotrue.program.insertion import Inserter
from robotrue.program.program import Dialect, FrameTable, Program, Replacement

_MODULES: Final[dict[str, str]] = {
    "apt": "robotrue.program.formats.apt_program",
    "fanuc_gcode": "robotrue.program.formats.fanuc_gcode",
    "fanuc_ls": "robotrue.program.formats.fanuc_ls",
    "heidenhain": "robotrue.program.formats.heidenhain",
    "jbi": "robotrue.program.formats.jbi",
    "krl": "robotrue.program.formats.krl",
    "rapid": "robotrue.program.formats.rapid",
    "sinumerik": "robotrue.program.formats.sinumerik",
    "toolpath_csv": "robotrue.program.formats.csv_program",
    "urscript": "robotrue.program.formats.urscript",
}
_INSERTERS: Final[dict[str, str]] = {
    "apt": "robotrue.program.formats.path_insert",
    "fanuc_gcode": "robotrue.program.formats.path_insert",
    "krl": "robotrue.program.formats.krl_insert",
    "sinumerik": "robotrue.program.formats.path_insert",
    "toolpath_csv": "robotrue.program.formats.path_insert",
    "fanuc_ls": "robotrue.program.formats.fanuc_insert",
    "jbi": "robotrue.program.formats.jbi_insert",
    "rapid": "robotrue.program.formats.rapid_insert",
    "urscript": "robotrue.program.formats.urscript_insert",
}
"""Dialects that can put targets into a program."""
_INSTEAD: Final = {
    ".urp": "give the .script that the pendant saves beside it.",
    ".tp": "export the program as text (.LS); TP is its binary form.",
    ".pgf": "give the modules (.mod) that it lists.",
    ".rdk": "give the program that its post processor writes.",
}
"""What to give instead of a file that holds or lists a program in another form, by its suffix."""
_SURE: Final = 0.4
_LOOKED_AT: Final = 1 << 18


def register(name: str, module: str) -> None:
    """Adds a dialect: ``module`` is imported on first use and holds it as ``DIALECT``.

    Raises:
        ConfigurationError: The name is taken by another module.
    """
    if _MODULES.get(name, module) != module:
        raise ConfigurationError(f"dialect {name!r} is already {_MODULES[name]}.")
    _MODULES[name] = module


def dialects() -> tuple[str, ...]:
    """Returns the registered names, sorted."""
    return tuple(sorted(_MODULES))


def dialect(name: str) -> Dialect:
    """Returns a dialect by its name.

    Raises:
        ConfigurationError: No dialect has this name.
    """
    if name not in _MODULES:
        raise ConfigurationError(
            f"no dialect is called {name!r}.", hint=f"one of {', '.join(dialects())}."
        )
    return cast(Dialect, import_module(_MODULES[name]).DIALECT)


def register_inserter(name: str, module: str) -> None:
    """Adds what puts targets into programs of a dialect; ``module`` holds it as ``INSERTER``.

    Raises:
        ConfigurationError: The dialect has another already.
    """
    if _INSERTERS.get(name, module) != module:
        raise ConfigurationError(f"targets are put into {name!r} by {_INSERTERS[name]} already.")
    _INSERTERS[name] = module


def inserter(name: str) -> Inserter:
    """Returns what puts targets into programs of a dialect.

    Raises:
        ConfigurationError: This dialect has no way to do so.
    """
    if name not in _INSERTERS:
        raise ConfigurationError(
            f"moves of a {name} program are not split; robotrue splits those of "
            f"{', '.join(sorted(_INSERTERS)) or 'no dialect'}.",
            hint="leave --split away.",
        )
    return cast(Inserter, import_module(_INSERTERS[name]).INSERTER)


def detect(data: bytes, name: str) -> Dialect:
    """Returns the dialect of a file from its content and, where that is not enough, its name.

    A file whose content no dialect recognises goes to the one that owns its suffix, so that the
    refusal names the line. Bytes with a NUL are no text, whatever words chance put into them.

    Raises:
        FormatError: Neither content nor suffix belongs to a registered dialect.
    """
    known = [dialect(each) for each in dialects()]
    text = b"" if b"\0" in data[:_LOOKED_AT] else data
    best, sure = known[0], -1.0
    for each in known:
        found = each.detect(text)
        if found > sure:
            best, sure = each, found
        if sure >= 1.0:
            break
    if sure >= _SURE:
        return best
    suffix = Path(name).suffix.lower()
    for each in known:
        if suffix in each.suffixes:
            return each
    raise FormatError(
        f"not a program robotrue reads; it knows {', '.join(dialects())}.",
        source=name,
        line=1,
        hint=_INSTEAD.get(suffix, "give the file the controller runs, with its own suffix."),
    )


def read_job(
    path: str | Path | Sequence[str | Path],
    frames: FrameTable | None = None,
    *,
    instead: Mapping[str, bytes] | None = None,
) -> tuple[Program, ...]:
    """Returns the programs of a job: the files named first, then companions that hold targets.

    Tools and work frames in files of the controller beside them (``$config.dat``, ``TOOL.CND``,
    ``UFRAME.CND``, ``SYSFRAME.VA``) are known, too; those of ``frames`` go before them.

    Args:
        path: A program file, a folder of one job, or several files of it; companions (KRL: the
            ``.dat`` of a ``.src``) lie beside them.
        frames: What the program names but does not hold; base and flange if not given.
        instead: Bytes to take for files of these names instead of what stands on the disk: a job
            as it would read if they were written.

    Raises:
        FormatError: A file cannot be read, is not in a registered dialect, or in another than the
            first.
    """
    every = [dialect(name) for name in dialects()]
    paths = named_last(paths_of(path, {s for each in every for s in each.suffixes}), every)
    first = read_bytes(paths[0])
    language = detect(first, paths[0].name)
    job = gather_files(paths, language, instead={paths[0].name: first})
    for name, data in job.files[1 : job.given]:
        other = language if name in job.named else detect(data, name)
        if other.name != language.name:
            raise FormatError(
                f"{name} is a program in {other.name}, {paths[0].name} one in {language.name}.",
                source=paths[0].with_name(name),
                hint="give the files of one job.",
            )
    table, notes = with_files_beside(paths[0], language.name, frames or FrameTable())
    files = [(name, (instead or {}).get(name, data)) for name, data in job.files]
    programs = language.read_job(files, frames=table)
    if notes:
        programs = (replace(programs[0], notes=(*programs[0].notes, *notes)), *programs[1:])
    named = programs[: job.given]
    return named + tuple(program for program in programs[job.given :] if len(program))


def read_program(path: str | Path, frames: FrameTable | None = None) -> Program:
    """Returns the program of a job that is one file.

    Raises:
        FormatError: As :func:`read_job`; or the targets stand in more than one file.
    """
    job = read_job(path, frames)
    if len(job) > 1:
        raise FormatError(
            f"the targets stand in {len(job)} files: {', '.join(p.name for p in job)}.",
            source=path,
            hint="read them together with read_job and write each.",
        )
    return job[0]


@runtime_checkable
class Partial(Protocol):
    """A dialect that cannot say all of a target."""

    def list_unfollowed(self, program: Program, replacement: Replacement) -> tuple[str, ...]:
        """Returns what the written file cannot say of the new targets, one sentence each."""
        ...


def list_unfollowed(program: Program, replacement: Replacement) -> tuple[str, ...]:
    """Returns what the written program cannot say of a replacement, one sentence each."""
    language = dialect(program.dialect)
    return language.list_unfollowed(program, replacement) if isinstance(language, Partial) else ()


def write_program(program: Program, replacement: Replacement) -> bytes:
    """Returns the program's bytes with the changed numbers replaced and nothing else touched.

    Raises:
        ConfigurationError: Its dialect is not registered.
        ShapeError: A changed row has a value that cannot be written.
    """
    return dialect(program.dialect).write(program, replacement)
