"""Messages and progress that an operation reports while it runs, as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Message:
    """One line for the user.

    Attributes:
        text: The line, without its label.
        label: ``note`` for what deserves attention; empty for plain information.
        document: The same as JSON values, where a service answers while it runs.
        line: The text with its label before it.
    """

    text: str
    label: str = ""
    document: Mapping[str, object] | None = None
    line: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Prepends the label to the text."""
        line = f"{self.label}: {self.text}" if self.label else self.text
        object.__setattr__(self, "line", line)


def note(text: str) -> Message:
    """Returns a line that deserves attention."""
    return Message(text, label="note")


def place_in_file(name: str, text: str) -> str:
    """Returns a text about a file with its name before it; one that begins so keeps its line."""
    return text if text.startswith(f"{name}:") else f"{name}: {text}"


class Reporter(Protocol):
    """Receives the reports of a running operation: a terminal, a job, a test."""

    def report(self, message: Message) -> None:
        """Takes one line."""
        ...

    def step(self, text: str, done: int, of: int) -> None:
        """Reports the next step and the progress, ``done`` of ``of``; may raise to cancel."""
        ...


class Notes:
    """A reporter that keeps what deserves attention, for a result that shows it.

    Attributes:
        texts: Of the notes.
    """

    def __init__(self) -> None:
        self.texts: list[str] = []

    def report(self, message: Message) -> None:
        """Keeps one line if it is a note."""
        if message.label == "note":
            self.texts.append(message.text)

    def step(self, text: str, done: int, of: int) -> None:
        """Drops the progress."""


class Silent:
    """A reporter that drops everything."""

    def report(self, message: Message) -> None:
        """Drops one line."""

    def step(self, text: str, done: int, of: int) -> None:
        """Drops the progress."""
