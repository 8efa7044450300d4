"""Live: joints, force and the tool's error while it cuts, limits, and what was beyond them."""

from __future__ import annotations

from typing import Final

from robotrue.online.live_page import view_markup
from robotrue.web.live_sources import is_allowed, sources
from robotrue.web.page_context import PageContext, Screen
from robotrue.web.settings import SENSE_PORT

FILES: Final = "/live/files"
"""Where the view's scripts and style are served."""
ADDRESS: Final = f"ws://127.0.0.1:{SENSE_PORT}"
COMMAND: Final = f"robotrue sense cell.toml --robot rsi://... --force rdt://... --out {ADDRESS}"


async def _build(context: PageContext) -> str:
    found = await context.ask(sources, context.workspace)
    shown = next((each for each in found if each.id == context.query.get("source")), None)
    if shown is None and found:
        shown = found[-1]
    return context.render(
        "live.html",
        sources=found,
        shown=shown,
        allowed=shown is not None and is_allowed(shown.address, context.server.settings.sense),
        markup=view_markup(),
        files=FILES,
        address=ADDRESS,
        command=COMMAND,
    )


PAGE: Final = Screen(
    name="live", path="/live", build=_build, styles=(f"{FILES}/live.css", "/static/live.css")
)
