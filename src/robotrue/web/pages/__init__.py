"""The screens of the workbench: one file each, listed here in the order of the navigation.

A new one is a file with a ``PAGE``, its name in :data:`PAGES`, its texts in every language
(``nav.<name>`` in ``shell.toml`` and a file ``<name>.toml``) and its icon in ``parts/icons.py``.
"""

from __future__ import annotations

from typing import Final

from robotrue.web.bench import Page
from robotrue.web.pages import (
    calibration,
    cell,
    drift,
    drilling,
    history,
    live,
    measurements,
    plan,
    programs,
    registration,
)

PAGES: Final[tuple[Page, ...]] = (
    cell.PAGE,
    plan.PAGE,
    measurements.PAGE,
    calibration.PAGE,
    registration.PAGE,
    programs.PAGE,
    drift.PAGE,
    drilling.PAGE,
    live.PAGE,
    history.PAGE,
)
