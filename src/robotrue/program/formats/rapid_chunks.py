"""Plain motions of long RAPID modules: moves to literals, one in a line."""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from robotrue.program.formats.line_chunks import NUMBER, Keys, LineCutter, LineForm, list_items
from robotrue.program.program import FrameTable

_ABSENT: Final = rb"(?:9[eE]\+?0?9|0(?:\.0*)?)"
_TARGET: Final = (
    rb"\[\s*\[" + list_items(NUMBER, 3) + rb"\]\s*,\s*\[" + list_items(NUMBER, 4) + rb"\]\s*,\s*\["
    + list_items(rb"-?\d+", 4) + rb"\]\s*,\s*\[" + list_items(_ABSENT, 6) + rb"\]\s*\]"
)  # fmt: skip
_AXES: Final = (
    rb"\[\s*\[" + list_items(NUMBER, 6) + rb"\]\s*,\s*\[" + list_items(_ABSENT, 6) + rb"\]\s*\]"
)
_VALUE: Final = rb"(?:\w+|\[[\d.,eE+\-\s]*\])"


def _put_in_module(keys: Keys) -> tuple[bytes, bytes, FrameTable]:
    tools, works = ({key[k].decode("ascii") for key in keys} for k in (1, 2))
    frames = FrameTable(
        tools={name: np.eye(4) for name in tools if name.lower() != "tool0"},
        bases={name: np.eye(4) for name in works if name.lower() not in ("", "wobj0")},
    )
    return b"MODULE m\nPROC p()\n", b"\nENDPROC\nENDMODULE\n", frames


CUTTER: Final = LineCutter(
    moved_frames=True,
    form=LineForm(
    plain=re.compile(
        rb"[ \t]*Move(?:(?:L|J|(?P<via>C))[ \t]+"
        + _TARGET + rb"(?(via)\s*,\s*" + _TARGET + rb")"
        rb"|(?P<key_axes>AbsJ)[ \t]+" + _AXES + rb"(?:\\NoEOffs)?)"
        rb"\s*,\s*" + _VALUE + rb"(?:\\[VT]:=[\d.]+)?\s*,\s*" + _VALUE
        + rb"\s*,\s*(?P<key_tool>\w+)"
        rb"\s*,?\s*(?:\\WObj\s*:=\s*(?P<key_work>\w+)\s*)?;[ \t]*(?:![^\r\n]*)?[\r\n]*",
        re.IGNORECASE,
    ),
    idle=re.compile(rb"[ \t]*(?:![^\r\n]*)?[\r\n]*"),
    around=_put_in_module,
),
)  # fmt: skip
