"""Files of an item: imported under their names, copied to a folder to work with."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.store.blobs import require_whole
from robotrue.store.records import Attachment, ItemRecord
from robotrue.store.workspace import Transaction, Workspace

_BAD: Final = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]')
LONGEST: Final = 200


def require_name(name: str) -> str:
    """Returns the name if it can be that of a file in any folder.

    Raises:
        ConfigurationError: It is empty, too long, a path, or has characters that systems refuse.
    """
    if not name or len(name) > LONGEST or _BAD.search(name) or name.strip(". ") == "":
        raise ConfigurationError(
            f"{name[:60]!r} is no file name, expected up to {LONGEST} characters and no path.",
            hint="rename the file.",
        )
    return name


def attach_files(
    into: Transaction, files: Iterable[tuple[str, str, bytes | Path]]
) -> tuple[Attachment, ...]:
    """Returns imported files, from role, name and content of each.

    Raises:
        ConfigurationError: A name is none.
        FormatError: A file cannot be read.
    """
    return tuple(
        Attachment(role=role, name=require_name(name), sha256=into.keep(content))
        for role, name, content in files
    )


def copy_files(
    workspace: Workspace, record: ItemRecord, folder: Path, *roles: str
) -> tuple[Path, ...]:
    """Returns copies of an item's files in a folder, under their names; of some roles, or of all.

    Raises:
        ArchiveError: A file is missing or was altered.
        ConfigurationError: A name leads out of the folder.
        FormatError: The folder cannot be written to.
    """
    copies = []
    for each in record.attachments:
        if roles and each.role not in roles:
            continue
        source = workspace.path_of(each.sha256)
        require_whole(source, each.sha256)
        target = folder / require_name(each.name)
        try:
            shutil.copyfile(source, target)
        except OSError as cause:
            raise FormatError(f"cannot write: {cause.strerror}.", source=target) from cause
        copies.append(target)
    return tuple(copies)
