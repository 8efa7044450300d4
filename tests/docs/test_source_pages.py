"""The commands of the pages about planning poses, stiffness and the drill answer as printed."""

from __future__ import annotations

import pytest
from page_answers import check_answers

PAGES = (
    "fit-the-rigid-flexible-model",
    "plan-poses",
    "square-the-drill",
    "learn-a-foot",
    "refine-a-foot",
)


@pytest.mark.parametrize("page", PAGES)
def test_the_answers_of_a_page_are_current(page: str) -> None:
    check_answers(page)
