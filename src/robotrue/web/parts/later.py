"""What takes a moment: the page stands at once, and this part of it comes when it is there."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from html import escape
from typing import Any

from nicegui import ui

from robotrue.errors import RobotrueError
from robotrue.web.bench import Bench
from robotrue.web.parts.faults import refusal
from robotrue.web.parts.frame import html


def later(
    bench: Bench, ask: Callable[[], Awaitable[bytes]], fill: Callable[[dict[str, Any]], None]
) -> None:
    """Shows that something is being worked on, then what came of it, or why nothing did.

    Args:
        bench: Who looks.
        ask: Gives the answer as JSON.
        fill: Builds the elements of the answer.
    """
    place = ui.element("div").props('data-testid="later"')
    with place:
        working = escape(bench.say("frame.working"))
        html(f'<p class="note">{working}</p><div class="progress idle"><i></i></div>').classes(
            "card"
        )

    async def come() -> None:
        try:
            found = json.loads(await ask())
        except RobotrueError as error:
            place.clear()
            with place:
                html(refusal(bench.say, error))
            return
        place.clear()
        with place:
            fill(found)

    ui.timer(0.01, come, once=True)
