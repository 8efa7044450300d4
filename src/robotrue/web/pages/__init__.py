"""The screens of the workbench, in the order of the navigation.

A new one is a row of :data:`SCREENS`, a file ``<name>_screen.py`` with ``BUILDS``, its templates,
texts in every language (``nav.<name>`` in ``shell.toml`` and a file ``<name>.toml``) and an icon in
``templating.py``. Its file is imported when it is first shown.
"""

from __future__ import annotations

from typing import Final

from robotrue.web.page_context import Screen

PLAN_STYLES: Final = ("plan.css",)
SCREENS: Final[tuple[Screen, ...]] = (
    Screen(name="overview", path="/", styles=("overview.css",)),
    Screen(name="cell", path="/cell", stage="setup", styles=("cell.css",)),
    Screen(name="plan", path="/plan", stage="measure", styles=PLAN_STYLES, operations=("plan",)),
    Screen(name="measurements", path="/measurements", stage="measure"),
    Screen(
        name="calibration",
        path="/calibration",
        stage="calibrate",
        styles=PLAN_STYLES,
        operations=("calibrate", "report"),
    ),
    Screen(
        name="registration",
        path="/registration",
        stage="use",
        styles=("touch.css",),
        operations=("register", "probe_plan", "report"),
    ),
    Screen(
        name="programs",
        path="/programs",
        stage="use",
        styles=PLAN_STYLES,
        operations=("compensate", "report"),
    ),
    Screen(
        name="drift",
        path="/drift",
        stage="monitor",
        styles=PLAN_STYLES,
        operations=("drift", "drift_plan", "transfer"),
    ),
    Screen(
        name="drilling",
        path="/drilling",
        stage="monitor",
        styles=("drilling.css",),
        operations=("drill_fit", "drill_report"),
    ),
    Screen(
        name="live",
        path="/live",
        stage="monitor",
        styles=("live/live.css", "live.css"),
    ),
    Screen(name="tools", path="/tools", below="/tools/{operation}", styles=PLAN_STYLES),
    Screen(name="history", path="/history"),
)
