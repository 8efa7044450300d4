"""The form that makes a cell, and the text of one, as elements of a page."""

from __future__ import annotations

from typing import Final

from nicegui.element import Element

from robotrue.store.nouns import CellRecord
from robotrue.web.bench import Bench

FORM_TEXTS: Final = (
    "careful_rated", "centre_x_mm", "centre_y_mm", "centre_z_mm", "form_title", "frame",
    "frame_base", "frame_unknown", "group_instrument", "group_load", "group_tool", "joints",
    "keep", "mass_kg", "name", "preview_text", "reach", "repeatability_mm", "robot", "sigma_um",
    "sigma_um_per_m", "tool_a_deg", "tool_b_deg", "tool_c_deg", "tool_x_mm", "tool_y_mm",
    "tool_z_mm", "wrong_exact", "wrong_massless", "wrong_number", "wrong_preset", "wrong_range",
)  # fmt: skip
TEXT_TEXTS: Final = ("keep_old", "keep_text", "line")


class CellForm(Element, component="cell_form.js"):
    """Asks for robot, tool, load and instrument, and shows the cell.toml they make."""

    def __init__(self, bench: Bench) -> None:
        super().__init__()
        self._props["text"] = {key: bench.say(f"cell_form.{key}") for key in FORM_TEXTS}


class CellText(Element, component="cell_text.js"):
    """One version of a cell's text; what is changed becomes the next."""

    def __init__(self, bench: Bench, record: CellRecord, latest: int) -> None:
        super().__init__()
        self._props["id"] = record.id
        self._props["version"] = record.version
        self._props["latest"] = latest
        self._props["text"] = {key: bench.say(f"cell_form.{key}") for key in TEXT_TEXTS}
