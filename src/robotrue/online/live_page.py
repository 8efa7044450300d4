"""The live page as bytes, and what its WebSocket sends: nothing from any other host.

Frames are JSON text: ``hello`` once, ``estimates`` steadily, ``health``.
``hello``: ``cell``, ``note``, ``per_second`` (bins), ``joints``, ``doubts`` (bit -> name),
``invalid`` (the bits that forbid use). ``estimates``: ``bins``, a list of ``t_s`` (host clock, last
sample), ``rows``, ``invalid`` (rows not valid), ``doubt`` (union), ``low`` and ``high`` of ex, ey,
ez um, fx, fy, fz N, ``sd_um`` (largest, one standard deviation), ``static_um``, ``error_um``,
``force_N``, ``moment_Nm``, ``joints_deg`` of the last sample; null is not known. ``health``:
``links`` (counters by name), ``dropped`` (frames this viewer could not take).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.online.estimates import Doubt, EstimateBin, doubt_names
from robotrue.online.link import Health, health_document
from robotrue.online.sinks import SinkSettings

_KINDS: Final = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
_FILES: Final = (
    "live.html", "page.css", "live.css", "page.js", "live.js", "plot.js", "history.js", "words.js",
)  # fmt: skip
HEADERS: Final = (
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-cache"),
)
"""Sent with every file: no script but ours is run, a token in an address goes nowhere."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageFile:
    """A file of the page.

    Attributes:
        kind: Its media type.
        body: Its bytes.
    """

    kind: str
    body: bytes


def page_files() -> dict[str, PageFile]:
    """Returns every file of the page by its request path, including ``/``."""
    folder = _folder()
    found = {
        f"/{name}": PageFile(
            kind=f"{_KINDS[name.rpartition('.')[2]]}; charset=utf-8",
            body=(folder / name).read_bytes(),
        )
        for name in _FILES
    }
    return {"/": found["/live.html"], **found}


def _folder() -> Traversable:
    return resources.files("robotrue.online") / "live"


_TRACES: Final = [0, 1, 2, 9, 10, 11]
"""Columns of error and force among the numbers of a bin."""


def hello_frame(settings: SinkSettings, *, per_second: float) -> str:
    """Returns the first frame a viewer gets."""
    return _text(
        {
            "type": "hello",
            "cell": settings.cell,
            "note": settings.note,
            "per_second": per_second,
            "joints": settings.joints,
            "doubts": {str(bit): name for bit, name in doubt_names().items()},
            "invalid": int(Doubt.INVALID),
        }
    )


def estimates_frame(bins: Sequence[EstimateBin]) -> str:
    """Returns bins as a frame."""
    return _text({"type": "estimates", "bins": [_bin(b) for b in bins]})


def health_frame(healths: Sequence[Health], *, dropped: int) -> str:
    """Returns the counters as a frame."""
    links = [health_document(h) for h in healths]
    return _text({"type": "health", "links": links, "dropped": dropped})


def _bin(b: EstimateBin) -> dict[str, object]:
    return {
        "t_s": round(b.host_time, 6),
        "rows": b.rows,
        "invalid": b.invalid,
        "doubt": b.doubt,
        "low": _list(b.low[_TRACES]),
        "high": _list(b.high[_TRACES]),
        "sd_um": _list(b.high[3:6]),
        "error_um": _list(b.last[0:3]),
        "static_um": _list(b.last[6:9]),
        "force_N": _list(b.last[9:12]),
        "moment_Nm": _list(b.last[12:15]),
        "joints_deg": _list(b.last[15:]),
    }


def _list(values: Array) -> list[float | None]:
    known = np.isfinite(values).tolist()
    rounded = np.round(values, 3).tolist()
    return [v if k else None for v, k in zip(rounded, known, strict=True)]


def _text(document: dict[str, object]) -> str:
    return json.dumps(document, separators=(",", ":"), allow_nan=False)
