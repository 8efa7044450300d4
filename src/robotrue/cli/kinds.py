"""The kinds of jobs that workers of robotrue can do, by name; importing it loads none of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

KINDS: Final[Mapping[str, str]] = {
    "calibrate": "robotrue.cli.job_kinds:calibrate",
    "compensate": "robotrue.cli.job_kinds:compensate",
    "drift": "robotrue.cli.job_drift:drift",
    "drift_plan": "robotrue.cli.job_drift:drift_plan",
    "drill_fit": "robotrue.cli.job_drilling:drill_fit",
    "drill_report": "robotrue.cli.job_drilling:drill_report",
    "plan": "robotrue.cli.job_kinds:plan",
    "report": "robotrue.cli.job_report:report",
    "transfer": "robotrue.cli.job_drift:transfer",
    "validate": "robotrue.cli.job_kinds:validate",
}
"""``module:function`` by name."""
