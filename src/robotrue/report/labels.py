"""Shared parts of reports: tiles, columns, facts and statistics, in the reader's language.

Each is labelled in the language of its :class:`~robotrue.report.words.Words` and named in English
in the JSON of every language.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from robotrue.core.units import MM
from robotrue.report.content import DIGITS, NEUTRAL, Fact, KeyFigure, ReportTable, TableColumn, Tone
from robotrue.report.words import ENGLISH, ReportTexts
from robotrue.validation.metrics import ErrorStatistics


def tile(
    t: ReportTexts,
    key: str,
    value: float,
    unit: str = "",
    *,
    digits: int = DIGITS,
    before: float | None = None,
    note: str = "",
    tone: Tone = NEUTRAL,
) -> KeyFigure:
    """Returns a key number of a catalog text; ``value`` and ``before`` in ``unit``."""
    return KeyFigure(
        label=t(key), key=ENGLISH(key), value=value, unit=unit, digits=digits, before=before,
        note=note, tone=tone,
    )  # fmt: skip


def column(
    t: ReportTexts, name: str, unit: str = "", digits: int = DIGITS, **values: object
) -> TableColumn:
    """Returns a column of a catalog text: its heading in the language, its JSON name in English."""
    return TableColumn(
        title=t(name, **values), unit=unit, digits=digits, key=ENGLISH(name, **values)
    )


def columns(
    t: ReportTexts, *names: str, unit: str = "", digits: int = DIGITS
) -> tuple[TableColumn, ...]:
    """Returns several columns of one unit."""
    return tuple(column(t, name, unit, digits) for name in names)


def plain_columns(*titles: str, unit: str = "", digits: int = DIGITS) -> tuple[TableColumn, ...]:
    """Returns columns of one unit whose titles are their names in JSON, too."""
    return tuple(TableColumn(title=title, unit=unit, digits=digits) for title in titles)


def axis_columns(dof: int) -> tuple[TableColumn, ...]:
    """Returns a column for each axis, as the controller displays it."""
    return plain_columns(*(f"A{i + 1}" for i in range(dof)), unit="deg", digits=2)


def fact(t: ReportTexts, key: str, value: str, **values: object) -> Fact:
    """Returns a line of provenance: its name in the language, its JSON name in English."""
    return Fact(name=t(key, **values), value=value, key=ENGLISH(key, **values))


def statistics_table(
    title: str,
    rows: Sequence[tuple[str, ErrorStatistics]],
    *,
    words: ReportTexts = ENGLISH,
    highlight: int | None = -1,
) -> ReportTable:
    """Returns a table of named statistics: n, mean, sd, 95 %, max, mean + 3 sd, RMS in mm.

    Args:
        title: Heading.
        rows: Name and statistics of each row.
        words: Language of the headings.
        highlight: Row to set off, counted from the end if below 0; None for none.
    """
    names = ("mean", "sd", "p95", "max", "three_sigma", "rms")
    return ReportTable(
        title=title,
        columns=(
            TableColumn(title=""),
            column(words, "n"),
            *columns(words, *names, unit="mm"),
        ),
        rows=tuple(
            (name, s.n, *(v / MM for v in (s.mean, s.std, s.p95, s.max, s.three_sigma, s.rms)))
            for name, s in rows
        ),
        highlight=None if highlight is None else highlight % len(rows),
    )


def per_axis_table(
    title: str, rows: Sequence[tuple[str, ErrorStatistics]], *, words: ReportTexts = ENGLISH
) -> ReportTable:
    """Returns a table of signed mean, standard deviation and largest value per base axis in mm."""
    columns = [TableColumn(title="")]
    for quantity in ("mean_axis", "sd_axis", "max_axis"):
        columns += [column(words, quantity, "mm", axis=axis) for axis in "xyz"]
    return ReportTable(
        title=title,
        columns=tuple(columns),
        rows=tuple(
            (name, *(float(v) / MM for v in (*s.axis_mean, *s.axis_std, *s.axis_max)))
            for name, s in rows
        ),
        highlight=len(rows) - 1,
    )


def versions() -> tuple[Fact, ...]:
    """Returns what made the numbers: robotrue, NumPy and Python with their versions."""
    return (
        Fact(name="robotrue", value=version("robotrue")),
        Fact(name="numpy", value=np.__version__),
        Fact(name="python", value=platform.python_version()),
    )
