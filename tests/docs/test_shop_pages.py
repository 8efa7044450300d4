"""The commands of the pages about registering, tool and blank answer as printed."""

from __future__ import annotations

import pytest
from page_answers import check_answers

PAGES = (
    "three-points-and-rounds",
    "tool-point-from-the-table",
    "from-cam-to-program",
    "test-with-slots",
    "join-joints-and-points",
    "monuments-and-repeats",
    "transfer-between-regions",
)


@pytest.mark.parametrize("page", PAGES)
def test_the_answers_of_a_page_are_current(page: str) -> None:
    check_answers(page)
