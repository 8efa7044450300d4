"""A post description: how programs that machine are written in one language, as a TOML file.

A file has blocks of lines (``[moves]``, ``[points]``, ``[joints]``, ``[frames]``). Each block has a
text for an event of the program: its begin, a straight move, a comment. The files of the program
(``[[files]]``) are made of blocks. ``krl.toml`` is the shortest example.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from robotrue.core.arm_words import Maker
from robotrue.core.files import parse_toml, read_bytes
from robotrue.core.schema_faults import check_tables, line_of_key
from robotrue.errors import ConfigurationError
from robotrue.program.lang import language_names
from robotrue.program.posts.line_template import LineTemplate, parse_template
from robotrue.program.posts.post_fields import (
    AXES,
    AXIS,
    COUNTS,
    FEED,
    FRAME,
    JOB,
    PLACE,
    ROTATION,
    TOOL,
    WORDS_OF,
)

BLOCKS: Final = ("moves", "points", "joints", "frames")
_NAMES: Final = ("program", "PROGRAM", "output")
_TEXT: Final = re.compile(r"[\t\n -~]*")
_TARGET: Final = (*FRAME, *PLACE, *ROTATION, *AXIS, *COUNTS)
_TEXTS: Final = {"comment": ("text",), "tool_call": ("tool",)}
_WITH_WORDS: Final = ("joint", "configuration", "linear", "blended")


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class BlockTable(_Table):
    """``[moves]`` and its like: the lines of each event, with its fields besides those of all."""

    line_number: str | None = None
    first_line: int = 1
    head: Annotated[str | None, ()] = None
    comment: Annotated[str | None, ()] = None
    start: Annotated[str | None, ()] = None
    new_frame: Annotated[str | None, FRAME] = None
    side: Annotated[str | None, FRAME] = None
    joint: Annotated[str | None, (*_TARGET, *AXES)] = None
    frame: Annotated[str | None, FRAME] = None
    feed: Annotated[str | None, (*FRAME, *FEED)] = None
    configuration: Annotated[str | None, ()] = None
    linear: Annotated[str | None, (*_TARGET, *FEED)] = None
    blended: Annotated[str | None, (*_TARGET, *FEED)] = None
    stop: Annotated[str | None, ()] = None
    wait: Annotated[str | None, ("seconds",)] = None
    spindle_right: Annotated[str | None, ("rpm",)] = None
    spindle_left: Annotated[str | None, ("rpm",)] = None
    spindle_off: Annotated[str | None, ()] = None
    coolant_on: Annotated[str | None, ()] = None
    coolant_off: Annotated[str | None, ()] = None
    tool_call: Annotated[str | None, ()] = None
    foot: Annotated[str | None, ()] = None


class FileTable(_Table):
    """``[[files]]``: one file of the program; the one without a name is that of ``--output``."""

    name: str = ""
    text: str = "{moves}"


class PostFile(_Table):
    """A post description as read from its file."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    language: str
    title: str
    makers: list[Literal["kuka", "abb", "fanuc", "yaskawa", "ur", "staubli"]] = []
    suffixes: Annotated[list[Annotated[str, Field(pattern=r"^\.[^.A-Z\s]+$")]], Field(min_length=1)]
    name_length: Annotated[int, Field(ge=1)] = 24
    line_end: Literal["crlf", "lf"] = "crlf"
    first_number: Annotated[int, Field(ge=0)] = 1
    comment_length: Annotated[int, Field(ge=1)] = 100
    not_in_comments: list[str] = []
    one_frame: bool = False
    straight_between_sides: bool = False
    configuration: Literal["", "kuka", "abb", "fanuc", "yaskawa"] = ""
    at_controller: list[str] = []
    words: dict[str, list[str]] = {}
    moves: BlockTable
    points: BlockTable = BlockTable()
    joints: BlockTable = BlockTable()
    frames: BlockTable = BlockTable()
    files: Annotated[list[FileTable], Field(min_length=1)] = [FileTable()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Lines of one part of a program.

    Attributes:
        events: Template of each event that has lines here.
        line_number: Stands before every line; None where lines have no number.
        first_line: Number of the first.
    """

    events: Mapping[str, LineTemplate]
    line_number: LineTemplate | None
    first_line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FileText:
    """One file of a program.

    Attributes:
        name: Of the file; None is the file of ``--output``.
        lines: The name of a block for its lines, or a literal line.
    """

    name: LineTemplate | None
    lines: tuple[str | LineTemplate, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Post:
    """Format of machining programs in one language.

    Attributes:
        stated: The description as written in its file.
        source: The file.
        blocks: By name.
        files: The file of ``--output`` first.
        at_controller: Required settings of the controller, one sentence each.
        names: All fields that are used.
    """

    stated: PostFile
    source: Path
    blocks: Mapping[str, Block]
    files: tuple[FileText, ...]
    at_controller: tuple[LineTemplate, ...]
    names: frozenset[str]

    @property
    def words_of(self) -> Maker:
        """Maker whose configuration words it writes."""
        return self.stated.configuration


def read_post(path: Path) -> Post:
    """Returns the post description in a file.

    Raises:
        ConfigurationError: Not TOML, a key or a field that is missing, or a value that is not
            allowed; with the line, the key and what is allowed.
        FormatError: The file cannot be read.
    """
    tables, text = parse_toml(read_bytes(path), path, example="the guide from CAM to program")
    stated = check_tables(PostFile, tables, path=path, text=text)
    return _PostBuilder(stated, path, text).build()


class _PostBuilder:
    """Checks the lines of a description and makes templates of them."""

    def __init__(self, stated: PostFile, path: Path, text: str) -> None:
        self._stated, self._path, self._text = stated, path, text
        self._names: set[str] = set()

    def build(self) -> Post:
        """Returns the post."""
        stated = self._stated
        if stated.language not in language_names():
            allowed = ", ".join(language_names())
            raise self._fault(
                ("language",), f"language is {stated.language!r}, expected one of {allowed}"
            )
        self._check_words()
        blocks = {name: self._block(name, getattr(stated, name)) for name in BLOCKS}
        events = blocks["moves"].events
        for needed in ("linear", "joint", "comment"):
            if needed not in events:
                raise self._fault(("moves", needed), f"moves.{needed} is missing")
        files = tuple(
            sorted((self._file(k, file) for k, file in enumerate(stated.files)),
                   key=lambda file: file.name is not None)
        )  # fmt: skip
        if sum(file.name is None for file in files) != 1:
            raise self._fault(("files",), "one of [[files]], and no more, has no name")
        told = tuple(
            self._template(("at_controller",), line, (*JOB, *TOOL, *FRAME), _NAMES)
            for line in stated.at_controller
        )
        return Post(
            stated=stated,
            source=self._path,
            blocks=blocks,
            files=files,
            at_controller=told,
            names=frozenset(self._names),
        )

    def _check_words(self) -> None:
        stated, known = self._stated, WORDS_OF[self._stated.configuration]
        if stated.configuration and stated.makers != [stated.configuration]:
            raise self._fault(
                ("configuration",),
                f"configuration is {stated.configuration!r} for arms of {stated.makers}, expected "
                f"makers = [{stated.configuration!r}]",
            )
        for name, letters in stated.words.items():
            if name not in known or len(letters) != 2:
                raise self._fault(
                    ("words", name),
                    f"words.{name} is {letters}, expected two texts, for 0 and 1, of one of "
                    f"{', '.join(known) or 'none, as configuration is empty'}",
                )

    def _block(self, name: str, table: BlockTable) -> Block:
        events: dict[str, LineTemplate] = {}
        for event, field in BlockTable.model_fields.items():
            text = getattr(table, event)
            if text is None or not field.metadata:
                continue
            (own,) = field.metadata
            words = WORDS_OF[self._stated.configuration] if event in _WITH_WORDS else ()
            spelled = [word for word in words if word in self._stated.words]
            numbers = {*JOB, *TOOL, *own, *words} - set(spelled)
            texts = (*_NAMES, *_TEXTS.get(event, ()), *spelled)
            events[event] = self._template((name, event), text, numbers, texts)
        number = table.line_number
        return Block(
            events=events,
            line_number=None
            if number is None
            else self._template((name, "line_number"), number, ("line",), ()),
            first_line=table.first_line,
        )

    def _file(self, k: int, table: FileTable) -> FileText:
        lines: list[str | LineTemplate] = []
        for line in table.text.removesuffix("\n").split("\n"):
            if line[1:-1] in BLOCKS and line == f"{{{line[1:-1]}}}":
                lines.append(line[1:-1])
            else:
                numbers = (*JOB, *TOOL, "lines")
                lines.append(self._template(("files", k, "text"), line, numbers, _NAMES))
        named = self._template(("files", k, "name"), table.name, (), _NAMES)
        return FileText(name=named if table.name else None, lines=tuple(lines))

    def _template(
        self,
        where: tuple[str | int, ...],
        text: str,
        numbers: tuple[str, ...] | set[str],
        texts: tuple[str, ...],
    ) -> LineTemplate:
        key = ".".join(str(part) for part in where if isinstance(part, str))
        if not _TEXT.fullmatch(text):
            raise self._fault(where, f"{key} has letters that are not ASCII")
        try:
            made = parse_template(text, frozenset(numbers), frozenset(texts))
        except ConfigurationError as cause:
            raise self._fault(where, f"{key}: {cause.message.rstrip('.')}", cause.hint) from cause
        self._names |= made.names
        return made

    def _fault(
        self, where: tuple[str | int, ...], what: str, hint: str | None = None
    ) -> ConfigurationError:
        line = line_of_key(self._text, where)
        return ConfigurationError(f"{what}.", source=self._path, line=line, hint=hint)
