"""The screens of the workbench: one file each, listed here in the order of the navigation.

A new one is a file with a ``PAGE`` and its templates, its name in :data:`SCREENS`, its texts in
every language (``nav.<name>`` in ``shell.toml`` and a file ``<name>.toml``) and its icon in
``templating.py``.
"""

from __future__ import annotations

from typing import Final

from robotrue.web.page_context import Screen
from robotrue.web.pages import (
    calibration_screen,
    cell_screen,
    drift_screen,
    drilling_screen,
    history_screen,
    live_screen,
    measurements_screen,
    overview_screen,
    plan_screen,
    programs_screen,
    registration_screen,
    tools_screen,
)

SCREENS: Final[tuple[Screen, ...]] = (
    overview_screen.PAGE,
    cell_screen.PAGE,
    plan_screen.PAGE,
    measurements_screen.PAGE,
    calibration_screen.PAGE,
    registration_screen.PAGE,
    programs_screen.PAGE,
    drift_screen.PAGE,
    drilling_screen.PAGE,
    live_screen.PAGE,
    tools_screen.PAGE,
    history_screen.PAGE,
)
