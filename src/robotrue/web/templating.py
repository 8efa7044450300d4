"""Jinja2 templates of the pages; all inserted values are escaped."""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Final

from jinja2 import Environment, FileSystemBytecodeCache, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from robotrue.core.provenance import simulation_mark
from robotrue.report.theme import DARK, LIGHT, STYLE, css_variables
from robotrue.store.records import ItemRecord, provenance_of_record
from robotrue.version import __version__
from robotrue.web.language import LANGUAGES
from robotrue.web.static_files import STATIC_ROOT

FOLDER: Final = Path(__file__).parent / "templates"
ICONS: Final = {
    "overview": "M4 6a2 2 0 1 0 4 0 2 2 0 1 0-4 0M8 6h8a4 4 0 0 1 0 8H8a3 3 0 0 0 0 6h8M16 20a2 2 0 1 0 4 0 2 2 0 1 0-4 0",  # noqa: E501
    "cell": "M5 20v-6l5-7 6 4M3 20h8M16 11l3 2M16 11l2-3",
    "measurements": "M4 20l5-5M9 15a3 3 0 1 0 4-4 3 3 0 0 0-4 4M14 10l3-3M17 3v4h4M4 4h5M4 8h3",
    "calibration": "M12 3v3M12 18v3M3 12h3M18 12h3M12 12m-5 0a5 5 0 1 0 10 0 5 5 0 1 0-10 0M12 12h.01",  # noqa: E501
    "programs": "M5 3h10l4 4v14H5zM15 3v4h4M8.5 12l-2 2.5 2 2.5M15.5 12l2 2.5-2 2.5M13 11l-2 7",
    "tools": "M14 6a4 4 0 0 1 5-3l-3 3 2 2 3-3a4 4 0 0 1-5 5L8 18a2 2 0 0 1-3-3z",
    "history": "M4 12a8 8 0 1 0 3-6.2M4 4v4h4M12 8v4l3 2",
    "plan": "M4 6h4M4 12h4M4 18h4M12 6h8M12 12h8M12 18h5",
    "registration": "M12 21s7-6 7-11a7 7 0 1 0-14 0c0 5 7 11 7 11M12 10h.01",
    "drilling": "M12 3v12M9 6l6 2M9 10l6 2M12 15l-1 4 1 2 1-2zM4 21h5M15 21h5",
    "live": "M3 12h4l3-8 4 16 3-8h4",
    "drift": "M12 4v16M4 12h16M12 12l5-5M13 7h4v4",
    "moon": "M20 14A8 8 0 1 1 10 4a6.5 6.5 0 0 0 10 10",
    "settings": (
        "M4 7h10M18 7h2M4 17h2M10 17h10M14 7a2 2 0 1 0 4 0 2 2 0 1 0-4 "
        "0M6 17a2 2 0 1 0 4 0 2 2 0 1 0-4 0"
    ),
    "keyboard": "M3 7h18v10H3zM7 11h.01M11 11h.01M15 11h.01M8 14h8",
    "leave": "M14 4h5v16h-5M10 8l-4 4 4 4M6 12h9",
    "download": "M12 4v11M7 11l5 5 5-5M4 20h16",
    "pen": "M4 20l1-4L16 5l3 3L8 19zM14 7l3 3",
    "upload": "M12 16V5M7 9l5-5 5 5M4 20h16",
}
"""Line icons, 24 by 24, drawn in the colour of the text."""


def render(template: str, **values: object) -> Markup:
    """Returns a template of the folder ``templates`` with its values inserted."""
    return Markup(TEMPLATES.get_template(template).render(values))  # noqa: S704  escaped there


def macro(template: str, name: str, *values: object) -> Markup:
    """Returns what one macro of a template writes."""
    return Markup(getattr(TEMPLATES.get_template(template).module, name)(*values))  # noqa: S704


def format_time(moment: datetime) -> str:
    """Returns a time as people of the cell read it, in the zone of the server."""
    return moment.astimezone().strftime("%Y-%m-%d %H:%M")


def _is_simulated(record: ItemRecord) -> bool:
    """True if a record states that it rests on simulated data."""
    return provenance_of_record(record).simulated


def _palette() -> Markup:
    """The reports' colours, for the light or dark that was chosen."""
    return Markup(  # noqa: S704  our own colours
        f":root{{color-scheme:light;{css_variables(LIGHT)}}}"
        f":root[data-theme=dark]{{color-scheme:dark;{css_variables(DARK)}}}"
    )


def _environment() -> Environment:
    compiled = None
    with suppress(OSError, RuntimeError):  # no safe folder for it
        compiled = FileSystemBytecodeCache()
    made = Environment(
        loader=FileSystemLoader(FOLDER),
        bytecode_cache=compiled,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["time"] = format_time
    made.tests["simulated"] = _is_simulated
    made.globals.update(
        version=__version__,
        static=STATIC_ROOT,
        icons=ICONS,
        languages=LANGUAGES,
        palette=_palette(),
        report_style=Markup(STYLE),  # noqa: S704  our own style
        simulation_mark=simulation_mark,
    )
    return made


TEMPLATES: Final = _environment()
