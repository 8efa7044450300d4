"""The pages on the virtual cell of ``robotrue demo`` answer as printed. SIMULATED."""

from __future__ import annotations

import pytest
from page_answers import check_answers

PAGES = (
    ("tutorial", "first-calibration"),
    ("reference", "cli"),
    ("howto", "compensate-a-program"),
    ("howto", "g-code"),
    ("howto", "import-a-tracker-file"),
    ("howto", "map-the-workspace"),
    ("howto", "transfer-a-calibration"),
)


@pytest.mark.parametrize(("guide", "page"), PAGES, ids=[page for _, page in PAGES])
def test_the_answers_of_a_page_are_current(guide: str, page: str) -> None:
    check_answers(page, guide=guide)
