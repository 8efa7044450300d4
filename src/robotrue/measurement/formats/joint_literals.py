"""Joints as controllers write them: constants and moves of programs, read as a table.

Only numbers that are written out are read: no program runs here. A line that is commented out is
none, and a position in coordinates has no joints.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from robotrue.core.files import read_bytes, sha256
from robotrue.core.provenance import file_provenance
from robotrue.errors import FormatError
from robotrue.measurement.formats.sheet import Sheet

AXES: Final = ("A1", "A2", "A3", "A4", "A5", "A6")
"""Columns of the sheet, besides ``name``: axes of the controller."""
_NUMBER: Final = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LIST: Final = rf"\s*{_NUMBER}(?:\s*,\s*{_NUMBER})*\s*"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Language:
    """Notation of joints in a language.

    Attributes:
        name: Of the language.
        literal: Groups ``name`` (may be missing) and ``values``.
        value: One number within the values, as its group 1.
        comment: Start of a comment in a line.
        radians: Joints are in rad.
    """

    name: str
    literal: re.Pattern[str]
    value: re.Pattern[str]
    comment: str
    radians: bool = False


_PLAIN: Final = re.compile(rf"({_NUMBER})")
_LANGUAGES: Final = (
    _Language(
        name="RAPID",
        literal=re.compile(
            rf"(?:jointtarget\s+(?P<name>\w+)\s*:=|MoveAbsJ)\s*\[\s*\[(?P<values>{_LIST})\]", re.I
        ),
        value=_PLAIN,
        comment="!",
    ),
    _Language(
        name="KRL",
        literal=re.compile(
            r"(?:\bE?6?AXIS\s+(?P<name>\w+)\s*=|\bS?PTP)\s*\{(?:\s*E6AXIS\s*:)?"
            r"(?P<values>\s*A1\b[^{}]*)\}",
            re.I,
        ),
        value=re.compile(rf"\bA\d\s+({_NUMBER})", re.I),
        comment=";",
    ),
    _Language(
        name="Fanuc",
        literal=re.compile(
            r"(?:\bP\[(?P<number>\d+)(?:\s*:\s*\"(?P<name>[^\"]*)\")?\]\s*\{|"
            r"\[\d+,\s*(?P<register>\d+)\]\s*=\s*'(?P<label>[^']*)')"
            rf"(?P<values>[^{{}}\[\]]*?\bJ6\s*[=:]\s*{_NUMBER})",
            re.I,
        ),
        value=re.compile(rf"\bJ\d\s*[=:]\s*({_NUMBER})", re.I),
        comment="!",
    ),
    _Language(
        name="URScript",
        literal=re.compile(rf"(?:\b(?P<name>\w+)\s*=|\bmovej\s*\()\s*\[(?P<values>{_LIST})\]"),
        value=_PLAIN,
        comment="#",
        radians=True,
    ),
)


def read_joint_literals(path: str | Path) -> tuple[Sheet, bool] | None:
    """Returns the joints written in a program file, and whether they are in rad; None: a table.

    The columns are ``name`` and ``AXES``; a literal without a name is called by its line.

    Raises:
        FormatError: Unreadable, or a literal that has not six joints.
    """
    data = read_bytes(path)
    if data.startswith(b"PK"):  # a workbook
        return None
    text = data.decode("utf-8-sig", "replace")
    for language in _LANGUAGES:
        literals = [hit for hit in language.literal.finditer(text) if _is_live(text, hit, language)]
        if not literals:
            continue
        rows = [_read_literal(path, text, hit, language) for hit in literals]
        digest = sha256(data)
        sheet = Sheet(
            source=str(path),
            digest=digest,
            header=("name", *AXES),
            cells=tuple(cells for _, cells in rows),
            lines=tuple(line for line, _ in rows),
            header_line=None,
            decimal=".",
            provenance=file_provenance(Path(path).name, digest),
        )
        return sheet, language.radians
    return None


def _is_live(text: str, hit: re.Match[str], language: _Language) -> bool:
    """True if no comment begins before the literal on its line."""
    begun = text.rfind("\n", 0, hit.start()) + 1
    return language.comment not in text[begun : hit.start()]


def _read_literal(
    path: str | Path, text: str, hit: re.Match[str], language: _Language
) -> tuple[int, tuple[str, ...]]:
    line = text.count("\n", 0, hit.start()) + 1
    values = language.value.findall(hit["values"])
    if len(values) != len(AXES):
        raise FormatError(
            f"{len(values)} joints in a literal of {language.name}, expected {len(AXES)}.",
            source=path,
            line=line,
            hint="give the joints as a table, one column per joint, with a mapping.",
        )
    groups = hit.groupdict()
    names = (groups.get(key) for key in ("name", "label", "number", "register"))
    return line, (next((name for name in names if name), f"line {line}"), *values)
