"""The screens of the workbench: one file each, listed here in the order of the navigation.

A new one is a file with a ``PAGE`` and its templates, its name in :data:`SCREENS`, its texts in
every language (``nav.<name>`` in ``shell.toml`` and a file ``<name>.toml``) and its icon in
``icons.py``.
"""

from __future__ import annotations

from typing import Final

from robotrue.web.page_context import Screen
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

SCREENS: Final[tuple[Screen, ...]] = (
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
