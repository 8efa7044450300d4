"""Where the files of a job are written: one name each, none of them a file that is read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robotrue.app.outputs import check_output, require_suffix
from robotrue.errors import ConfigurationError
from robotrue.program.lang import find_language, languages


def job_outputs(names: Sequence[str], folder: Path, output: Path, language: str) -> list[Path]:
    """Returns the file that each file of a job is written to.

    A folder takes all of them under their own names. A file is the first; a companion that belongs
    to it by its name takes its new name, others keep theirs beside it, since programs name them.

    Args:
        names: Of the files of the job, the program first.
        folder: Where they were read.
        output: A file, or a folder that exists.
        language: Name of their dialect.

    Raises:
        ConfigurationError: A file that is read, no folder, or one name for two files.
    """
    if output.is_dir():
        paths = [output / name for name in names]
        for folder in dict.fromkeys(path.parent for path in paths):
            folder.mkdir(parents=True, exist_ok=True)
    else:
        _require_language(output, names[0], language)
        paths = [output]
        beside = {each.lower() for each in find_language(language).name_companions(names[0])}
        for name in map(Path, names[1:]):
            alike = name.stem.lower() == Path(names[0]).stem.lower() and name.name.lower() in beside
            paths.append(output.with_name(output.stem + name.suffix if alike else name.name))
    originals = [folder / name for name in names]
    for path in paths:
        _require_other(path, originals, several=len(names) > 1)
    twice = [path for k, path in enumerate(paths) if path in paths[:k]]
    if twice:
        raise ConfigurationError(
            f"two files of the job, {', '.join(names)}, would be written to {twice[0].name}.",
            source=output,
            hint="a folder after -o: every file keeps its name there.",
        )
    return paths


def _require_language(output: Path, source: str, language: str) -> None:
    """Refuses a name that says another language than that of the program, or no program at all."""
    own = find_language(language)
    kin = [each for each in languages().values() if own.family and each.family == own.family]
    suffixes = [suffix for each in kin or [own] for suffix in each.suffixes]
    usual = Path(source).suffix.lower()
    what = f"a program in {own.name}, as {source} is,"
    require_suffix(output, what, tuple(dict.fromkeys([usual, *own.table_suffixes, *suffixes])))


def _require_other(path: Path, originals: Sequence[Path], *, several: bool) -> None:
    try:
        check_output(path, originals)
    except ConfigurationError as cause:
        if not several or not path.exists() or path.is_dir():
            raise
        raise ConfigurationError(
            cause.message,
            source=path,
            hint="another folder after -o: every file of the job keeps its name there.",
        ) from cause
