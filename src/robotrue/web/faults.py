"""Refusals on a page: their kind and what to do in the reader's language, the detail as it came.

What exactly was wrong is said where it was found, below the web room, in English. Around it stands
what a reader of another language needs: which kind of fault that is, and what always helps.
``bench.fault`` of ``static/bench.js`` says the same of the answers of the HTTP interface.
"""

from __future__ import annotations

from typing import Final

from markupsafe import Markup

from robotrue.errors import RobotrueError
from robotrue.web.language import Wording
from robotrue.web.problems import source_name, title_of
from robotrue.web.templating import render

KINDS: Final = (
    "configuration error", "database down error", "format error", "implausible data error",
    "shape error", "observability error", "convergence error", "reach error",
    "model mismatch error", "step error", "archive error", "missing extra error",
    "missing error", "unanswered", "invalid request", "too large", "no connection", "other",
)  # fmt: skip
OF_COMMANDS: Final = ("--", "robotrue workspace ")
"""Beginnings of hints for who types commands; the page has buttons for what they say."""


def refusal(say: Wording, error: RobotrueError, *, title: str = "") -> Markup:
    """Returns a card that says what was refused, why, and what to try.

    Args:
        say: The words of the reader.
        error: As it was raised.
        title: In the place of the kind of error; empty: the kind.
    """
    place, file = "", source_name(error)
    if file is not None:
        line = f":{error.line}" if error.line is not None else ""
        place = f"{file}{line}: "
    return fault_card(say, title_of(error), place + error.message, error.hint, title=title)


def fault_card(
    say: Wording, kind: str, message: str, hint: str | None, *, title: str = ""
) -> Markup:
    """Returns the card of a refusal of which kind, message and hint are known.

    Args:
        say: The words of the reader.
        kind: One of :data:`KINDS`; another counts as the last.
        message: In English.
        hint: Likewise; None: there is none.
        title: In the place of the kind.
    """
    hint = None if hint is not None and hint.startswith(OF_COMMANDS) else hint
    key = f"fault.{(kind if kind in KINDS else KINDS[-1]).replace(' ', '_')}"
    return render("fault.html", say=say, title=title, key=key, message=message, hint=hint)


def fault_words(say: Wording) -> dict[str, object]:
    """Returns what ``bench.fault`` needs to say the same in the browser."""
    keys = {kind: f"fault.{kind.replace(' ', '_')}" for kind in KINDS}
    return {
        "kinds": {kind: {"title": say(key), "do": say(f"{key}_do")} for kind, key in keys.items()},
        "english": say("fault.english"),
        "try": say("fault.try"),
        "plain": say.language == "en",
        "commands": OF_COMMANDS,
    }
