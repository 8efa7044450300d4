"""The parsed source tree of the package, of the working copy or of a commit."""

from __future__ import annotations

import ast
import gc
import io
import subprocess
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
SOURCE: Final = "src"
PACKAGE: Final = "src/robotrue/"


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFile:
    """One Python file.

    Attributes:
        path: In the repository, with slashes.
        text: Its source.
        tree: Parsed.
    """

    path: str
    text: str
    tree: ast.Module

    @property
    def module(self) -> str:
        """Returns the dotted name it is imported by."""
        return (
            self.path.removeprefix("src/")
            .removesuffix(".py")
            .replace("/", ".")
            .removesuffix(".__init__")
        )

    @property
    def room(self) -> str:
        """Returns the package below ``robotrue`` it belongs to, '' for files beside the rooms.

        Files of another package than ``robotrue`` have the name of that package.
        """
        if not self.path.startswith(PACKAGE):
            return self.module.split(".")[0]
        return self.module.split(".")[1] if self.path.count("/") > 2 else ""

    @property
    def name(self) -> str:
        """Returns the file name without folder and suffix."""
        return self.path.rpartition("/")[2].removesuffix(".py")

    @property
    def lines(self) -> int:
        """Returns the number of lines, as ``wc -l`` counts them."""
        return self.text.count("\n")


def read_tree(revision: str | None = None) -> list[SourceFile]:
    """Returns the files under ``src``, sorted by path; of the working copy without a revision.

    Raises:
        SystemExit: Git does not know the revision.
    """
    gc.disable()  # a million nodes that all stay: looking for garbage among them takes most time
    found = _working_copy() if revision is None else _committed(revision)
    return [
        SourceFile(path=path, text=text, tree=ast.parse(text, path))
        for path, text in sorted(found)
        if path.endswith(".py")
    ]


def statements(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yields every statement of a file, those inside others too, but no expressions."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.stmt):
            yield node
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            waiting.extend(getattr(node, part, ()))


def _working_copy() -> Iterator[tuple[str, str]]:
    for path in (ROOT / SOURCE).rglob("*.py"):
        yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def _committed(revision: str) -> Iterator[tuple[str, str]]:
    done = subprocess.run(  # noqa: S603
        ["git", "-C", str(ROOT), "archive", "--format=tar", revision, SOURCE],  # noqa: S607
        capture_output=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stderr.decode().strip())
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        for member in archive:
            if member.isfile() and member.name.endswith(".py"):
                content = archive.extractfile(member)
                yield member.name, content.read().decode() if content else ""
