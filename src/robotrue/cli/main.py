"""The ``robotrue`` command.

Commands of operations are made from their requests (``generate.py``); the signatures of the others
are here and in the ``*_commands`` files, their work in the file of their name.

Data go to stdout, everything else to stderr. Exit 0: done. Exit 1: understood, but refused or
failed, with a message of the cause (also for a missing file). Exit 2: the command line itself is
wrong: an unknown option, a missing argument. Heavy imports happen inside the commands, so
``robotrue --help`` answers at once.
"""

from __future__ import annotations

import os
import sys
from copy import copy
from typing import Final

import typer

from robotrue.cli import serve_commands
from robotrue.cli.app import app
from robotrue.cli.generate import name_of, register_operations, without_options
from robotrue.errors import RobotrueError

__all__ = [
    "app",
    "run",
    "serve_commands",
]

INTERRUPTED = 130
"""Exception of the command line library for Ctrl-C."""


ORDER: Final = (
    "demo",
    "plan",
    "calibrate",
    "calibrate-lengths",
    "transfer",
    "validate",
    "predict",
    "map",
    "drift",
    "drift-plan",
    "export urdf",
    "export dh",
    "export controller",
    "export ur",
    "export points",
    "probe-plan",
    "register",
    "slot-test",
    "program",
    "compensate",
    "wrap",
    "diff",
    "serve",
    "inspect",
    "drill fit",
    "drill evaluate",
    "drill adjust",
    "drill plan",
    "drill refine",
    "drill report",
    "drill run",
    "dynamics predict",
    "dynamics frf",
    "dynamics force",
    "dynamics fit",
    "dynamics validate",
    "dynamics sensor",
    "reproduce",
    "doctor",
    "warm-up",
    *(f"simulate {name}" for name in ("rsi", "egm", "rtde", "rdt", "drill")),
    *(f"sense {name}" for name in ("run", "align")),
    *(f"workspace {name}" for name in ("init", "add", "list", "show", "history", "delete")),
    *(f"workspace {name}" for name in ("undo", "empty-bin", "export", "import", "verify")),
    *(f"jobs {name}" for name in ("submit", "list", "show", "cancel", "run")),
)
"""Commands in the order of the work, for the help; others follow as they are registered."""
register_operations(app, ORDER)


def run() -> None:
    """Runs the command line and exits with 0, 1 or 2."""
    if sys.stderr.isatty():
        _tell()
    try:
        _pick_asked()(prog_name="robotrue")
    except RobotrueError as error:
        _report(error)
        raise SystemExit(error.exit_code) from None
    except SystemExit as stopped:
        if stopped.code != INTERRUPTED:
            raise
        sys.stderr.write("robotrue: stopped; no file is incomplete.\n")
        raise SystemExit(1) from None
    except BrokenPipeError:
        # The reader of the result has closed the pipe (``| head``); the flush at exit must not
        # fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None


def _tell() -> None:
    """Shows log messages of the packages, e.g. that kernels are compiled, on the terminal."""
    import logging

    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("robotrue: %(message)s"))
    room = logging.getLogger("robotrue")
    room.addHandler(handler)
    room.setLevel(logging.INFO)


def _pick_asked() -> typer.Typer:
    """Loads only the requested command's options; without a known command, all."""
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    only = copy(app)
    only.registered_commands = [each for each in app.registered_commands if word == name_of(each)]
    only.registered_groups = [
        each
        for each in app.registered_groups
        if each.typer_instance and word == each.typer_instance.info.name
    ]
    if only.registered_commands or only.registered_groups:
        return only
    return without_options(app)


def _report(error: RobotrueError) -> None:
    sys.stderr.write(f"robotrue: {error}\n")
    if "--json" in sys.argv:
        import json

        fault = {
            "kind": type(error).__name__,
            "message": error.message,
            "source": error.source,
            "line": error.line,
            "hint": error.hint,
            **error.detail,
        }
        sys.stdout.write(json.dumps({"error": fault}) + "\n")
