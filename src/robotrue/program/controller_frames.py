"""A found frame or tool as controllers take it: text to paste or to type in, Euler order named.

Numbers are printed to 1e-4 mm and 1e-6 deg (0.02 um over a metre). A controller's user frame is in
its world frame; where that is not the robot's root ($ROBROOT, a shifted ABB base frame, Fanuc's
world at the height of axis 2) the difference has to be added there.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from robotrue.core.arrays import Array, frozen
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.program.lang import languages
from robotrue.program.language import FrameForm, TableForm

FIRST: Final = 1
"""Entry of a controller's table that is filled where none is stated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerFrame:
    """A frame in a controller's own words.

    Attributes:
        system: The system that reads it.
        order: How its three or four rotation numbers make the matrix.
        text: The lines.
    """

    system: str
    order: str
    text: str


def frame_forms() -> Mapping[str, FrameForm]:
    """Returns the forms a frame can be printed in, by name."""
    forms = [language.frame_form for language in languages().values() if language.frame_form]
    return {form.name: form for form in forms}


def controller_frame(
    T_base_part: Array, form: str, *, name: str = "part", number: int = FIRST
) -> ControllerFrame:
    """Returns the frame as the controller takes it.

    Args:
        T_base_part: (4, 4) m.
        form: A name of :func:`frame_forms`.
        name: Of the part; becomes a variable name.
        number: Of the controller's frame table.

    Raises:
        ConfigurationError: An unknown form, or a number the controller does not have.
    """
    tables = {name: (form, form.frame) for name, form in frame_forms().items()}
    return _print_entry(
        "frame", frozen(T_base_part, (4, 4), "T_base_part"), tables, form, name, number
    )


def controller_tool(
    T_flange_tool: Array, form: str, *, name: str = "tool", number: int = FIRST
) -> ControllerFrame:
    """Returns a tool as the controller takes it.

    Args:
        T_flange_tool: (4, 4) m.
        form: A name of :func:`frame_forms` that takes tools.
        name: Of the tool.
        number: Of the controller's tool table.

    Raises:
        ConfigurationError: An unknown form, or a number the controller does not have.
    """
    tables = {name: (form, form.tool) for name, form in frame_forms().items() if form.tool}
    return _print_entry(
        "tool", frozen(T_flange_tool, (4, 4), "T_flange_tool"), tables, form, name, number
    )


def _print_entry(
    what: str,
    T: Array,
    tables: Mapping[str, tuple[FrameForm, TableForm]],
    asked: str,
    name: str,
    number: int,
) -> ControllerFrame:
    if asked not in tables:
        raise ConfigurationError(
            f"{what} format {asked!r}, expected {', '.join(tables)}.", hint=f"--{what}-format krl"
        )
    form, table = tables[asked]
    if not table.first <= number <= table.last:
        raise ConfigurationError(
            f"{what} number {number} of {asked}, allowed {table.first} to {table.last}.",
            hint=f"--{what}-number {table.first}",
        )
    text = table.print(T[:3, 3] / MM, T[:3, :3], _make_word(name), number)
    return ControllerFrame(
        system=form.system.format(form.counted_from + number), order=form.order, text=text
    )


def _make_word(name: str) -> str:
    """A variable name every one of the languages takes."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", name) or "part"
    return word if word[0].isalpha() else f"p_{word}"
