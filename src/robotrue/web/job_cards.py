"""Jobs that a page shows, wherever they were asked for: they are there again after a reload."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Final

from robotrue.store import jobs
from robotrue.store.workspace import Workspace

JUST_NOW: Final = timedelta(seconds=15)
"""Ago."""


def shown_jobs(workspace: Workspace, kind: str) -> list[jobs.Job]:
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
