"""robotrue makes an industrial robot cut where the CAM said."""

from __future__ import annotations

__version__ = "0.1.0"
