"""The kinds of jobs that workers of robotrue can do, by name; importing it loads no work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from robotrue.app.job_kinds import job_kinds

KINDS: Final[Mapping[str, str]] = {
    **job_kinds(),
}
"""``module:function`` by name."""
