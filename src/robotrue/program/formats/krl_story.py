"""What is collected while the lines of a KRL job are read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from robotrue.program.program import Motion, Reason


class Definition(NamedTuple):
    """A stored point: its file, aggregate, and name ``variable[index].path`` in lower case."""

    file: int
    agg: int
    variable: str
    subscript: str
    path: str


class Called(NamedTuple):
    """A call of ``CR_PROCESS_FILE``: zero-based line, file, its first and last line (-1: all)."""

    line: int
    name: str
    first: int
    last: int


@dataclass(slots=True)
class ParsedKrl:
    """What the walk collects.

    Attributes:
        definitions: Every stored point.
        uses: (file, aggregate) to the (line, motion) it is moved to with.
        flags: (file, aggregate) to the reason it cannot be compensated.
        arcs: Pairs of (file, aggregate): auxiliary and end point.
        tainted: (variable, path) that take part in an expression, with a line.
        sequence: (line, aggregate of the main file or -1, is auxiliary): what moves the robot;
            -1 where it is not known what moved it.
        notes: Sentences for the user.
        has_def: The file has a DEF, DEFFCT or DEFDAT.
        called_files: CAMRob files whose targets the robot moves through.
        lost: (line, motion) of moves to a target that is not known.
        shared: Names of GLOBAL points of the data files.
        written: (file, aggregate) of targets that are written out: first byte and end of the text
            they take the place of, and the variables they are computed from.
        spelled: Names of called routines as the program writes them, by lower case.
    """

    definitions: list[Definition]
    uses: dict[tuple[int, int], list[tuple[int, Motion]]]
    flags: dict[tuple[int, int], Reason]
    arcs: list[tuple[tuple[int, int], tuple[int, int]]]
    tainted: dict[tuple[str, str], int]
    sequence: list[tuple[int, int, bool]]
    notes: list[str]
    has_def: bool
    called_files: list[Called]
    spelled: dict[str, str]
    lost: list[tuple[int, Motion]]
    shared: set[str]
    written: dict[tuple[int, int], tuple[int, int, frozenset[str]]] = field(default_factory=dict)
