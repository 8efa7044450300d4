"""The terminal as a shell of operations: messages, a progress bar, results."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager

from robotrue.app.context import Shell
from robotrue.app.operation import AnyOperation, Result
from robotrue.app.presentation import Block, Facts, LiveView, Table, Text
from robotrue.app.reporting import Message
from robotrue.app.request import Request
from robotrue.cli.console import emit_facts, emit_json, emit_table, progress, say, say_mark
from robotrue.core.progress import Progress
from robotrue.core.provenance import Provenance


class TerminalReporter:
    """Messages go to stderr; the bar appears with the first step.

    Args:
        stack: Removes the bar.
        as_json: Messages that have a document go to stdout as a line of JSON.
    """

    def __init__(self, stack: ExitStack, *, as_json: bool = False) -> None:
        self._stack, self._as_json = stack, as_json
        self._step: Progress | None = None

    def report(self, message: Message) -> None:
        """Writes one line."""
        if message.document is None or not self._as_json:
            say(message.line)
            return
        sys.stdout.write(json.dumps(message.document, allow_nan=False) + "\n")
        sys.stdout.flush()

    def step(self, text: str, done: int, of: int) -> None:
        """Moves the bar."""
        if self._step is None:
            self._step = self._stack.enter_context(progress())
        self._step(text, done, of)


class TerminalShell(Shell):
    """Reports to the terminal."""

    def live(self) -> AbstractContextManager[Callable[[LiveView], None]]:
        """Yields what shows a service on stderr."""
        from robotrue.cli.live_view import show_live

        return show_live()

    def confirm(self, question: str, word: str) -> bool | None:
        """Prompts on stderr and reads a line, where stdin is a terminal."""
        if not sys.stdin.isatty():
            return None
        say(question)
        return sys.stdin.readline().strip().lower() == word


@contextmanager
def terminal_reporter(*, as_json: bool = False) -> Iterator[TerminalReporter]:
    """Yields a reporter whose bar is gone afterwards."""
    with ExitStack() as stack:
        yield TerminalReporter(stack, as_json=as_json)


def run_operation(operation: AnyOperation, request: Request, *, as_json: bool) -> None:
    """Runs an operation on files and shows its result.

    Raises:
        RobotrueError: What the operation raises.
    """
    from robotrue.app.files_context import FilesContext, check_outputs

    check_outputs(request)
    with terminal_reporter(as_json=as_json) as reporter:
        result = operation.run(request, FilesContext(reporter, TerminalShell()))
    show_result(result, as_json=as_json)


def show_result(result: Result, *, as_json: bool) -> None:
    """Writes a result to stdout, marked if it rests on simulated data."""
    say_mark(result.provenance)
    if as_json:
        document = result.document()
        if document is not None:
            emit_json(document, None if "simulated" in document else result.provenance)
        return
    for block in tuple(result.blocks()):
        _show(block, result.provenance)


def _show(block: Block, provenance: Provenance | None) -> None:
    if isinstance(block, Facts):
        emit_facts(block.title, block.rows, None if block.measured else provenance)
    elif isinstance(block, Table):
        emit_table(block.title, block.columns, block.rows, words=block.words, provenance=provenance)
    elif isinstance(block, Text):
        sys.stdout.write(block.text)
    else:
        say(block.text)
