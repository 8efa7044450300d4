"""A session at the part, and the form that begins one, as elements of a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from nicegui.element import Element

from robotrue.store.nouns import CellRecord, ModelRecord
from robotrue.web.bench import Bench
from robotrue.web.preferences import ANGLE_NAMES

TEXTS: Final = (
    "all", "all_text", "approach", "approach_leaned", "approach_straight", "at", "away",
    "away_text", "back", "counted", "curve", "enter_joints", "enter_position", "expected",
    "export", "file", "finish", "finish_name", "finish_nogo", "frame_there", "gain", "held_off",
    "held_title", "in_part", "keep", "known", "known_at", "known_to", "last_dropped", "last_kept",
    "last_skipped", "last_undone", "machined", "map", "no_frame", "no_frame_text", "notes",
    "place", "point", "points", "pose", "promised", "residual", "result", "retake", "rms",
    "route_frame", "route_joint", "sd", "skip", "state", "state_doubted", "state_far",
    "state_held", "state_kept",
    "state_open", "state_skipped", "step", "step_chosen", "surface", "take", "tolerance", "undo",
    "unreachable", "why_ball", "why_feature", "why_none", "why_radians", "why_repeated",
    "why_scale", "why_sign", "working",
)  # fmt: skip
BEGIN_TEXTS: Final = (
    "axes", "axes_controller", "axes_model", "begin", "begin_drop", "begin_hint", "begin_title",
    "cell", "fit", "fit_auto", "fit_frame", "fit_joint", "frame", "lean_deg", "model", "more",
    "name", "nominal", "probe_radius_mm", "reads", "reads_joints", "reads_position", "rough_mm",
    "tip_axis", "tolerance_mm", "tool_sigma_mm", "touch_sigma_mm", "working",
)  # fmt: skip


class TouchSession(Element, component="touch.js"):
    """The next point, its reading, and where the part stands; kept in the store at every step."""

    def __init__(self, bench: Bench, id: str) -> None:
        super().__init__()
        self._props["id"] = id
        self._props["text"] = {key: bench.say(f"registration.{key}") for key in TEXTS}
        self._props["unit"] = bench.view.unit
        self._props["angles"] = bench.view.angles
        self._props["letters"] = ", ".join(ANGLE_NAMES[bench.view.angles])


class TouchBegin(Element, component="touch_begin.js"):
    """Asks for cell, model and points, and begins a session."""

    def __init__(
        self, bench: Bench, cells: Sequence[CellRecord], models: Sequence[ModelRecord]
    ) -> None:
        super().__init__()
        self._props["text"] = {key: bench.say(f"registration.{key}") for key in BEGIN_TEXTS}
        for name, found in (("cells", cells), ("models", models)):
            self._props[name] = [{"id": each.id, "name": each.name} for each in found]
