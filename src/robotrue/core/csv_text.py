"""Tables as CSV that a spreadsheet shows and does not calculate.

A spreadsheet takes a cell that begins with ``=``, ``+``, ``-`` or ``@`` for a formula, which may
fetch an address or start a program. A name that begins so gets an apostrophe in front, which marks
text for a spreadsheet; :func:`as_written` removes it, so that a file that is read here contains the
original name. Numbers stay as they are. Spreadsheets of some countries split at semicolons: a cell
that holds one is quoted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

_NUMBER: Final = re.compile(r"[+-]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf)|")
_FORMULA: Final = re.compile(r"[\s']*[=+\-@\uff1d\uff0b\uff0d\uff20\t\r\n]")
"""What spreadsheets take for the beginning of a formula, the wide signs of East Asia among it."""
_QUOTED: Final = re.compile(r'[",;\t\r\n|]')
_PARTS: Final = re.compile(r"([,;\t|])(\s*)(?=[=+\-@\uff1d\uff0b\uff0d\uff20])")


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Returns rows as CSV with commas, every text in it harmless to a spreadsheet.

    Args:
        rows: The header first; cells are printed by ``str``, None as nothing.
    """
    return "".join(",".join(map(_cell, row)) + "\n" for row in rows)


def csv_remark(text: str) -> str:
    """Returns a line ``# text`` none of whose parts, split at a separator, is a formula."""
    return f"# {_PARTS.sub(_apart, ' '.join(text.split()))}\n"


def as_written(cell: str) -> str:
    """Returns the text of a cell read from a file, without the apostrophe of :func:`csv_text`."""
    return cell[1:] if cell[:1] == "'" and _FORMULA.match(cell, 1) else cell


def _cell(value: object) -> str:
    text = value if isinstance(value, str) else "" if value is None else str(value)
    if _NUMBER.fullmatch(text):
        return text
    if _FORMULA.match(text):
        text = f"'{text}"
    return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text


def _apart(found: re.Match[str]) -> str:
    return f"{found[1]}{found[2]}'"


def axis_names(dof: int) -> tuple[str, ...]:
    """Returns the names of columns of displayed axes: ``a1_deg``, ``a2_deg``, ..."""
    return tuple(f"a{i + 1}_deg" for i in range(dof))
