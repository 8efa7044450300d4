"""Answers as JSON; long arrays as base64 of little-endian float32, which browsers read at once."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.json_values import json_values


def packed(values: Array) -> dict[str, Any]:
    """Returns an array for :func:`answer`; NaN stays NaN."""
    data = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"f32": base64.b64encode(data).decode("ascii"), "shape": list(np.shape(values))}


def answer(document: Mapping[str, Any]) -> bytes:
    """Returns a document as JSON; numbers that are not finite become null."""
    return json.dumps(json_values(document), allow_nan=False, separators=(",", ":")).encode()
