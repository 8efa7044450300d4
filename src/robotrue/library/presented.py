"""Base of the library's objects: a summary, a table, a picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Final

from robotrue.app.presentation import Block, Facts, Note, Table
from robotrue.app.reporting import Message
from robotrue.core.provenance import Provenance, mark_sentence, mark_title

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture


_GAP: Final = "   "


class Presented(ABC):
    """An object with ``summary()``, ``to_dataframe()``, ``plot()`` and a short ``repr``."""

    __slots__ = ()

    @property
    @abstractmethod
    def messages(self) -> tuple[Message, ...]:
        """Lines that the operation reported, notes included."""

    @property
    @abstractmethod
    def provenance(self) -> Provenance | None:
        """Provenance of the data behind the object; None without data."""

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Returns facts, tables and notes, as every shell shows them."""

    @abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per item; units are in the column names."""

    @abstractmethod
    def plot(self) -> Picture:
        """Returns a matplotlib figure; ``savefig(path)`` writes it."""

    @abstractmethod
    def _describe(self) -> str:
        """The words of the ``repr``."""

    @property
    def simulated(self) -> bool:
        """True if any data behind the object were simulated."""
        return self.provenance is not None and self.provenance.simulated

    @property
    def _mark(self) -> str:
        """Prefix for the title of a picture of simulated data."""
        return "SIMULATED: " if self.simulated else ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes and warnings, one sentence each."""
        return tuple(each.text for each in self.messages if each.label == "note")

    def summary(self) -> str:
        """Returns text: what the command line prints for the same request."""
        return _blocks_to_text(self.blocks(), self.messages, self.provenance)

    def _repr_html_(self) -> str:
        """Returns the summary as HTML, for notebooks."""
        return _blocks_to_html(self.blocks(), self.messages, self.provenance)

    def __repr__(self) -> str:
        """Returns one line in angle brackets."""
        return f"<{'SIMULATED ' if self.simulated else ''}{self._describe()}>"


def _blocks_to_text(
    blocks: Iterable[Block], messages: Sequence[Message], provenance: Provenance | None
) -> str:
    """Lines without a line end: the mark of simulated data, blocks, then messages."""
    parts = [mark_sentence(provenance)]
    parts += [_block_text(block, provenance) for block in blocks]
    parts += [message.line for message in messages]
    return "\n".join(part for part in parts if part)


def _blocks_to_html(
    blocks: Iterable[Block], messages: Sequence[Message], provenance: Provenance | None
) -> str:
    """The same as HTML; every text is escaped."""
    mark = mark_sentence(provenance)
    parts = [f"<p><strong>{escape(mark)}</strong></p>" if mark else ""]
    parts += [_block_html(block, provenance) for block in blocks]
    parts += [f"<p>{escape(message.line)}</p>" for message in messages]
    return "\n".join(part for part in parts if part)


def _rows_of(block: Facts | Table) -> tuple[Sequence[str], Sequence[Sequence[str]]]:
    """Headings and rows; facts and tables without headings have none."""
    if isinstance(block, Facts):
        return (), block.rows
    return (block.columns if any(block.columns) else ()), block.rows


def _title(block: Facts | Table, provenance: Provenance | None) -> str:
    measured = isinstance(block, Facts) and block.measured
    return mark_title(block.title, None if measured else provenance)


def _block_text(block: Block, provenance: Provenance | None) -> str:
    if not isinstance(block, Facts | Table):
        return block.text.rstrip("\n")
    headings, rows = _rows_of(block)
    lines = [tuple(row) for row in ([headings, *rows] if headings else rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)] if lines else []
    numbers = isinstance(block, Table) and not block.words
    printed = [
        _GAP.join(
            text.rjust(width) if numbers and k else text.ljust(width)
            for k, (text, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    return "\n".join([_title(block, provenance), *(f"  {line}" for line in printed)])


def _block_html(block: Block, provenance: Provenance | None) -> str:
    if isinstance(block, Note):
        return f"<p>{escape(block.text)}</p>"
    if not isinstance(block, Facts | Table):
        return f"<pre>{escape(block.text)}</pre>"
    headings, rows = _rows_of(block)
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows
    )
    caption = f"<caption>{escape(_title(block, provenance))}</caption>"
    return f"<table>{caption}{f'<thead><tr>{head}</tr></thead>' if head else ''}{body}</table>"
