"""A newcomer at the workbench: clicks, keys, dropped files and time of each step."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from serving import Watched


@dataclass(slots=True, kw_only=True)
class Step:
    """One step of a walk."""

    name: str
    clicks: int = 0
    keys: int = 0
    drops: int = 0
    seconds: float = 0.0


@dataclass(slots=True, kw_only=True)
class Newcomer:
    """Acts on a page by its marks and keeps count."""

    watched: Watched
    steps: list[Step] = field(default_factory=list)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        self.steps.append(Step(name=name))
        begin = time.perf_counter()
        yield
        self.steps[-1].seconds = time.perf_counter() - begin

    def _place(self, target: Any) -> Any:
        return self.watched.find(target) if isinstance(target, str) else target

    def click(self, target: Any) -> None:
        self.steps[-1].clicks += 1
        self._place(target).click()

    def pick(self, target: Any, text: str | re.Pattern[str]) -> None:
        """Opens a list and presses the row with a text."""
        self.steps[-1].clicks += 2
        place = self._place(target)
        place.wait_for()
        row = place.locator("option").filter(has_text=text).first
        place.select_option(row.get_attribute("value") or row.inner_text())

    def write(self, target: Any, text: str) -> None:
        self.steps[-1].clicks += 1
        self.steps[-1].keys += len(text)
        self._place(target).fill(text)

    def drop(self, *paths: Path, mark: str = "file-input") -> None:
        self.steps[-1].drops += 1
        self.watched.find(mark).set_input_files([str(path) for path in paths])

    def wait(self, mark: str) -> Any:
        place = self.watched.find(mark).first
        place.wait_for()
        return place

    def table(self, title: str) -> str:
        """The steps as lines of a table; machine time, without reading and thinking."""
        total = Step(name="all", **{
            name: sum(getattr(step, name) for step in self.steps)
            for name in ("clicks", "keys", "drops", "seconds")
        })  # fmt: skip
        rows = [
            f"{step.name:44s}{step.clicks:7d}{step.keys:7d}{step.drops:7d}{step.seconds:9.1f}"
            for step in (*self.steps, total)
        ]
        head = f"{title:44s}{'clicks':>7s}{'keys':>7s}{'drops':>7s}{'s':>9s}"
        return "\n".join((head, *rows))
