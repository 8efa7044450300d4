"""Jinja2 templates of the pages; whatever is put into one is escaped."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from robotrue.core.provenance import simulation_mark
from robotrue.report.theme import DARK, LIGHT, STYLE
from robotrue.store.records import ItemRecord, provenance_of_record
from robotrue.version import __version__
from robotrue.web.icons import PATHS
from robotrue.web.language import LANGUAGES

FOLDER: Final = Path(__file__).parent / "templates"


def render(template: str, **values: object) -> Markup:
    """Returns a template of the folder ``templates`` with its values put in."""
    return Markup(TEMPLATES.get_template(template).render(values))  # noqa: S704  escaped there


def macro(template: str, name: str, *values: object) -> Markup:
    """Returns what one macro of a template writes."""
    return Markup(getattr(TEMPLATES.get_template(template).module, name)(*values))  # noqa: S704


def format_time(moment: datetime) -> str:
    """Returns a time as people of the cell read it, in the zone of the server."""
    return moment.astimezone().strftime("%Y-%m-%d %H:%M")


def _is_simulated(record: ItemRecord) -> bool:
    """Whether a record says that it rests on simulated data."""
    return provenance_of_record(record).simulated


def _palette() -> Markup:
    """The reports' colours, for the light or dark that was chosen."""

    def variables(colours: dict[str, str]) -> str:
        return "".join(f"--{name}:{value};" for name, value in colours.items())

    return Markup(  # noqa: S704  our own colours
        f":root{{color-scheme:light;{variables(LIGHT)}}}"
        f":root[data-theme=dark]{{color-scheme:dark;{variables(DARK)}}}"
    )


def _environment() -> Environment:
    made = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["time"] = format_time
    made.tests["simulated"] = _is_simulated
    made.globals.update(
        version=__version__,
        icons=PATHS,
        languages=LANGUAGES,
        palette=_palette(),
        report_style=Markup(STYLE),  # noqa: S704  our own style
        simulation_mark=simulation_mark,
    )
    return made


TEMPLATES: Final = _environment()
