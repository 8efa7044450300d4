"""Live: joints, force and the tool's error while it cuts, limits, and what was beyond them."""

from __future__ import annotations

from importlib import resources
from typing import Final

from robotrue.web.live_sources import is_allowed, sources
from robotrue.web.page_context import PageContext
from robotrue.web.serve_settings import SENSE_PORT
from robotrue.web.static_files import STATIC_ROOT

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
        markup=_view_markup(),
        files=f"{STATIC_ROOT}/live",
        address=ADDRESS,
        command=COMMAND,
    )


def _view_markup() -> str:
    """The view alone out of the sensing service's own page, whose scripts draw it here, too."""
    file = resources.files("robotrue.online") / "live" / "live.html"
    page = file.read_text(encoding="utf-8")
    return page.partition('<div class="live">')[2].partition("</footer>")[0] + "</footer>"


BUILDS: Final = {"": _build}
