"""A job under way, wherever it was asked for: it is there again after a reload."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Final

from nicegui.element import Element

from robotrue.store import jobs
from robotrue.store.workspace import Workspace
from robotrue.web.bench import Bench

TEXTS: Final = (
    "cancel", "open", "state_queued", "state_running", "state_done", "state_failed",
    "state_cancelled",
)  # fmt: skip
STEPS: Final = (
    "drawing postures", "choosing poses", "exchanging poses", "comparing plans", "reading",
    "predicting", "compensating", "writing", "writing the report", "judging", "setting pages",
    "nominal", "geometric", "elastic", "ripple", "gp", "chosen", "blocks", "regions", "sets",
    "random",
)  # fmt: skip
"""What jobs say they are at, as far as it is known; a text of the group ``step`` each."""

JUST_NOW: Final = timedelta(seconds=15)
"""Ago."""


class JobCard(Element, component="job.js"):
    """Shows a job until it is over; what came of it is opened then."""

    def __init__(self, bench: Bench, job: jobs.Job, *, title: str, go: str, field: str) -> None:
        """Makes the card.

        Args:
            bench: Who looks at it.
            job: Shown.
            title: What it does.
            go: Page opened when it is done; ``{id}`` is that of what came of it.
            field: Of the job's result that names it.
        """
        super().__init__()
        words = {name: bench.say(f"job.{name}") for name in TEXTS} | {"title": title}
        steps = {each: bench.say(f"step.{each.replace(' ', '_')}") for each in STEPS}
        for name, value in (
            ("id", job.id), ("text", words), ("steps", steps), ("go", go), ("field", field),
        ):  # fmt: skip
            self._props[name] = value


def under_way(workspace: Workspace, kind: str) -> list[jobs.Job]:
    """Returns the jobs of a kind that are not over, and the newest one if it has failed.

    One that is done within the moment the page takes to come again is among them: its card leads
    who asked for it to the result, and shows itself to nobody else.
    """
    found = jobs.search(workspace, kind=kind, limit=20).items
    newest = [each for each in found[:1] if each.state in (jobs.FAILED, jobs.CANCELLED)]
    since = datetime.now(UTC) - JUST_NOW
    just = [each for each in found if each.finished and each.finished > since]
    done = [each for each in just if each.state == jobs.DONE]
    return ([each for each in found if not each.over] or newest) + done
