"""The commands of the pages about a dry run, a hole and the spindle axis answer as printed."""

from __future__ import annotations

import pytest
from page_answers import check_answers

PAGES = (
    "dry-run",
    "evaluate-a-hole",
    "find-the-spindle-axis",
    "find-a-lost-zero",
    "correct-computed-targets",
)


@pytest.mark.parametrize("page", PAGES)
def test_the_answers_of_a_page_are_current(page: str) -> None:
    check_answers(page)
