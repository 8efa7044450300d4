"""Plain motions of long UR scripts: moves to literals, one in a line."""

from __future__ import annotations

import re
from typing import Final

from robotrue.program.formats.line_chunks import NUMBER, Keys, LineCutter, LineForm, list_items
from robotrue.program.program import FrameTable

_SIX: Final = rb"\[\s*" + list_items(NUMBER, 6) + rb"\s*\]"


def _put_in_routine(keys: Keys) -> tuple[bytes, bytes, FrameTable]:
    named = sorted({frame for frame, _ in keys if frame})
    frames = b"".join(b"  %b = p[0,0,0,0,0,0]\n" % name for name in named)
    return b"def p():\n" + frames, b"\nend\n", FrameTable()


CUTTER: Final = LineCutter(
    form=LineForm(
    plain=re.compile(
        rb"[ \t]*move(?:[lpj]\(\s*(?:p" + _SIX
        + rb"|pose_trans\(\s*(?P<key_frame>[A-Za-z_]\w*)\s*,\s*p" + _SIX + rb"\s*\))"
        + rb"|(?P<via>c)\(\s*p" + _SIX + rb"\s*,\s*p" + _SIX
        + rb"|(?P<key_axes>j)\(\s*" + _SIX
        + rb")\s*(?:,[\w\s=.,+\-]*)?\)[ \t]*(?:#[^\r\n]*)?[\r\n]*"
    ),
    idle=re.compile(rb"[ \t]*(?:#[^\r\n]*)?[\r\n]*"),
    around=_put_in_routine,
)
)  # fmt: skip
