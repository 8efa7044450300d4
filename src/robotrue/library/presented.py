"""What every object of the library can do: a summary, a table, a picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING

from robotrue.app.presentation import Block
from robotrue.app.reporting import Message
from robotrue.core.provenance import Provenance
from robotrue.library.block_formats import blocks_to_html, blocks_to_text

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture


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
        """Where the data come from that it rests on; None if it rests on none."""

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
        """Whether anything it rests on was simulated."""
        return self.provenance is not None and self.provenance.simulated

    @property
    def notes(self) -> tuple[str, ...]:
        """What deserves attention, one sentence each."""
        return tuple(each.text for each in self.messages if each.label == "note")

    def summary(self) -> str:
        """Returns text: what the command line prints for the same request."""
        return blocks_to_text(self.blocks(), self.messages, self.provenance)

    def _repr_html_(self) -> str:
        """Returns the summary as HTML, for notebooks."""
        return blocks_to_html(self.blocks(), self.messages, self.provenance)

    def __repr__(self) -> str:
        """Returns one line in angle brackets."""
        return f"<{'SIMULATED ' if self.simulated else ''}{self._describe()}>"
