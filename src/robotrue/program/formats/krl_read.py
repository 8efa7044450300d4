"""Reads the files of a KRL job: refuses what is not KRL, then scans, walks and builds."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from robotrue.errors import FormatError
from robotrue.program.formats.krl_build import Builder
from robotrue.program.formats.krl_frames import Frames
from robotrue.program.formats.krl_job import is_job, read_parts
from robotrue.program.formats.krl_resolve import resolve
from robotrue.program.formats.krl_scan import STATEMENT, Scan, scan
from robotrue.program.formats.krl_walk import KrlWalk
from robotrue.program.formats.text_lines import require_text
from robotrue.program.lang import languages
from robotrue.program.program import FrameTable, Program


def read_krl(files: Sequence[tuple[str, bytes]], frames: FrameTable) -> tuple[Program, ...]:
    """Returns one program per file, in the order given; ``.dat`` files are read for the others.

    Raises:
        FormatError: A file is not KRL, is cut off, or has a number that cannot be read.
    """
    if is_job(files):
        return read_parts(files, frames, _build)
    builder = _build(files, frames)
    return tuple(builder.program(file) for file in range(len(files)))


def _build(
    files: Sequence[tuple[str, bytes]],
    frames: FrameTable,
    owners: Sequence[tuple[int, str]] = (),
    beside: Collection[str] = (),
    parts: Sequence[tuple[str, bytes]] = (),
) -> Builder:
    """Returns the builder of the programs of one main file and its data files.

    Args:
        files: The main file and data files.
        frames: What they name but do not hold.
        owners: From which line of the main file on names are those of which file.
        beside: Names of the CAMRob files there are.
        parts: The files the main file is made of, if it is several.
    """
    names = [name for name, _ in files]
    for name, data in files:
        require_text(data, name)
    scans = [scan(data, name=name) for name, data in files]
    stores = [i for i, name in enumerate(names) if name.lower().endswith(".dat")]
    mains = [i for i in range(len(files)) if i not in stores]
    walk = KrlWalk(scans, names, Frames(frames, names[mains[0]] if mains else names[0]))
    walk.scope.owners = owners
    walk.beside = {name.lower() for name in beside}
    if len(stores) > 1:
        walk.scope.share(files[i][1] for i in stores)
    for file in stores:
        walk.data_file(file)
    for name, data in frames.declarations:
        walk.outside_file(name, data)
    walk.scope.share_routines((name, data) for name, data in parts or [files[i] for i in mains])
    for file in mains:
        walk.main_file(file)
    resolve(walk)
    main = mains[0] if mains else -1
    if not walk.story.has_def:
        _require_content(walk, main)
    return Builder(walk, main, frames)


def _require_content(walk: KrlWalk, main: int) -> None:
    """Refuses files without a DEF that hold no motion (main file) or no point (data files)."""
    found, told = walk.scans[main], walk.story.uses or walk.story.definitions
    if main >= 0 and not told and not (found.line_kind > STATEMENT).any():
        _refuse(found, walk.names[main])
    for store, name in zip(walk.scans, walk.names, strict=True):
        if main < 0 and not len(store.agg_line):
            _refuse(store, name)


def _refuse(found: Scan, name: str) -> None:
    text = found.data
    signs = [(language.sign, language.called) for language in languages().values()]
    guess = next((called for sign, called in signs if sign and sign.search(text)), "")
    why = f"it looks like {guess}" if guess else "no DEF, DEFDAT, point or motion was found"
    line = next((i for i, kind in enumerate(found.line_kind.tolist()) if kind), 0)
    shown = found.code(line).strip()[:60] if len(found.line_kind) else ""
    raise FormatError(
        f"not a KRL program: {why}. The first statement is {shown!r}.",
        source=name,
        line=line + 1,
        hint="give the .src (and .dat) that the controller runs.",
    )
