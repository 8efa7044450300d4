"""The model a program was made with: a small separate file, so that the program is unchanged.

``job.src`` has ``job.src.identity.json``: the SHA-256 of the program, the identity of the model,
whether its targets are compensated already, and the part frame it was written for. A program edited
afterwards no longer has the hash: the file then does not apply.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.core.model_identity import ModelIdentity, identity_from, require_same_model
from robotrue.core.provenance import MEASURED, Provenance, provenance_from
from robotrue.errors import FormatError, ModelMismatchError

FORMAT: Final = "robotrue-program-identity"
VERSION: Final = 1
SUFFIX: Final = ".identity.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramIdentity:
    """Origin of a program.

    Attributes:
        model: The model it was made with, or whose registration its frame is.
        compensated: Its targets are commands by that model, not the intended tool poses.
        part: Name of the part frame it is written for; empty: it contains its frames.
        made_from: File name of the program or tool path it came from.
        made_from_sha256: Of that file.
        provenance: Of the model, and of the part frame.
    """

    model: ModelIdentity
    compensated: bool
    part: str = ""
    made_from: str = ""
    made_from_sha256: str = ""
    provenance: Provenance = MEASURED


def identity_path(program: str | Path) -> Path:
    """Returns the path of the identity of a program."""
    path = Path(program)
    return path.with_name(path.name + SUFFIX)


def write_identity(program: str | Path, data: bytes | str, identity: ProgramIdentity) -> None:
    """Writes the identity next to a program of these bytes, whole or not at all.

    Args:
        program: The program file.
        data: Its bytes, or their SHA-256 in hexadecimal.
        identity: Its identity.

    Raises:
        FormatError: The file cannot be written.
    """
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "program": Path(program).name,
        "program_sha256": _digest(data),
        "model": identity.model.document(),
        "compensated": identity.compensated,
        "part": identity.part,
        "made_from": identity.made_from,
        "made_from_sha256": identity.made_from_sha256,
        "provenance": identity.provenance.to_document(),
    }
    text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
    write_atomic(identity_path(program), text.encode())


def _digest(data: bytes | str) -> str:
    return data if isinstance(data, str) else sha256(data)


def read_identity(program: str | Path, data: bytes | str) -> ProgramIdentity | None:
    """Returns the identity of a program of these bytes; None without an identity file for them.

    Args:
        program: The program file.
        data: Its bytes, or their SHA-256 in hexadecimal.

    Raises:
        FormatError: The file next to it is damaged or from a newer robotrue.
    """
    path = identity_path(program)
    if not path.is_file():
        return None
    document = _document(path)
    if document.get("program_sha256") != _digest(data):
        return None
    return ProgramIdentity(
        model=identity_from(document.get("model")),
        compensated=bool(document.get("compensated")),
        part=str(document.get("part", "")),
        made_from=str(document.get("made_from", "")),
        made_from_sha256=str(document.get("made_from_sha256", "")),
        provenance=provenance_from(document.get("provenance")),
    )


def _document(path: Path) -> dict[str, object]:
    try:
        found = json.loads(read_bytes(path).decode("utf-8"))
    except ValueError as cause:
        raise FormatError(
            f"not the identity of a program ({cause}).", source=path, hint="delete it."
        ) from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise FormatError("not the identity of a program.", source=path, hint="delete it.")
    if found.get("format_version") != VERSION:
        raise FormatError(
            f"format version {found.get('format_version')}, this robotrue reads {VERSION}.",
            source=path,
            hint="update robotrue.",
        )
    return found


def _find_copied(folder: Path, digest: str) -> tuple[Path, ProgramIdentity] | None:
    """Returns the program in a folder that has these bytes and is compensated, and its identity."""
    if not folder.is_dir():
        return None
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        try:
            stated = _document(path).get("program_sha256")
            known = None if stated != digest else read_identity(_program_of(path), digest)
        except FormatError:
            continue  # of another program: it matters where that one is compensated
        changed = known is not None and known.made_from_sha256 != digest
        if known is not None and known.compensated and changed:
            return _program_of(path), known
    return None


def _program_of(identity: Path) -> Path:
    return identity.with_name(identity.name.removesuffix(SUFFIX))


def require_compensable(
    program: str | Path,
    data: bytes | str,
    model: ModelIdentity,
    *,
    copies: str | Path | None = None,
) -> bool:
    """Passes if a program may be compensated by a model; returns whether its identity is known.

    Args:
        program: The program file.
        data: Its bytes, or their SHA-256 in hexadecimal.
        model: The model that is to compensate it.
        copies: Another folder in which a compensated program of the same bytes may lie.

    Raises:
        ModelMismatchError: It or a program of the same bytes is compensated already, or it belongs
            to another model.
        FormatError: As :func:`read_identity`.
    """
    known, what = read_identity(program, data), "the program"
    if known is None:
        folders = dict.fromkeys([Path(program).parent, *([Path(copies)] if copies else [])])
        found = [each for each in (_find_copied(f, _digest(data)) for f in folders) if each]
        if not found:
            return False
        known, what = found[0][1], f"the program is a copy of {found[0][0].name}, which"
    if known.compensated:
        raise ModelMismatchError(
            f"{what} is compensated already, with {known.model}; the correction would be applied "
            "twice.",
            source=program,
            hint=f"compensate {known.made_from or 'the program it came from'}.",
        )
    require_same_model(known.model, model, what="the program", source=str(program))
    return True
