"""A choice of where something lies, as a field of a form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from nicegui.element import Element

from robotrue.store.records import ItemRecord
from robotrue.web.bench import Bench

TEXTS: Final = (
    "box", "ring", "program", "which", "x_mm", "y_mm", "z_mm", "angle_deg", "radius_mm",
    "height_mm",
)  # fmt: skip


class RegionField(Element, component="region.js"):
    """Gives the form a field ``name`` as ``robotrue plan --region`` reads it, or ``program``."""

    def __init__(
        self,
        bench: Bench,
        name: str,
        *,
        title: str,
        anywhere: str,
        programs: Sequence[ItemRecord] = (),
    ) -> None:
        """Makes the field.

        Args:
            bench: Who looks at it.
            name: Of the field.
            title: What is to be chosen.
            anywhere: What it means if nothing is.
            programs: Whose targets may say it instead.
        """
        super().__init__()
        words = {each: bench.say(f"plan.{each}") for each in TEXTS}
        self._props["name"] = name
        self._props["text"] = {**words, "title": title, "any": anywhere}
        self._props["programs"] = [{"id": each.id, "name": each.name} for each in programs]
