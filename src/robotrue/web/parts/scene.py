"""The 3-D view: an address to fetch what is seen from, and everything else in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import nicegui
from nicegui.element import Element

from robotrue.web.bench import Bench
from robotrue.web.preferences import ANGLE_NAMES

THREE: Final = Path(nicegui.__file__).parent / "elements" / "scene" / "dist"
"""Three.js as NiceGUI ships it."""
TEXTS: Final = (
    "loading", "fault", "before", "after", "scale", "field", "field_none", "field_error",
    "field_bound", "layer_robot", "layer_reach", "layer_frames", "simulated", "point", "joints",
)  # fmt: skip


class SceneView(Element, component="scene.js", esm={"nicegui-scene": str(THREE)}):
    """A view of a cell with its own controls; ``bench-select`` on the window marks a point."""

    def __init__(self, bench: Bench, source: str) -> None:
        super().__init__()
        self._props["src"] = source
        self._props["unit"] = bench.view.unit
        self._props["angles"] = bench.view.angles
        self._props["letters"] = ", ".join(ANGLE_NAMES[bench.view.angles])
        self._props["text"] = {name: bench.say(f"scene.{name}") for name in TEXTS}
