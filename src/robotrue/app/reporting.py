"""What an operation reports while it runs: messages and progress, as values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from robotrue.core.provenance import MARK, Provenance, simulation_mark


@dataclass(frozen=True, slots=True)
class Message:
    """One line for the user.

    Attributes:
        text: The line, without its label.
        label: ``note`` for what deserves attention; empty for plain information.
    """

    text: str
    label: str = ""

    def __str__(self) -> str:
        """Returns the line with its label."""
        return f"{self.label}: {self.text}" if self.label else self.text


def note(text: str) -> Message:
    """Returns a line that deserves attention."""
    return Message(text, label="note")


def file_note(name: str, text: str) -> Message:
    """Returns a note about a file; a text that begins with the file and its line keeps it."""
    return note(text if text.startswith(f"{name}:") else f"{name}: {text}")


def provenance_line(provenance: Provenance | None) -> str:
    """Returns the line that says that a result rests on simulated data; empty if it does not."""
    return simulation_mark(provenance, f"{MARK}: no real robot was measured for this result")


class Reporter(Protocol):
    """Whoever listens while an operation runs: a terminal, a job, a test."""

    def report(self, message: Message) -> None:
        """Takes one line."""
        ...

    def step(self, text: str, done: int, of: int) -> None:
        """Takes what is done next, how much is done, and of how much; may raise to cancel."""
        ...


class Silent:
    """A reporter that drops everything."""

    def report(self, message: Message) -> None:
        """Drops one line."""

    def step(self, text: str, done: int, of: int) -> None:
        """Drops the progress."""
