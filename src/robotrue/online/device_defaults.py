"""Ports, rates and silences of devices, without the libraries that read them."""

from __future__ import annotations

from typing import Final

RDT_PORT: Final = 49152
RSI_PORT: Final = 49152
EGM_PORT: Final = 6510
RTDE_PORT: Final = 30004
RSI_CYCLE_MS: Final = 4
"""IPO_FAST."""
RTDE_RATE_HZ: Final = 500.0
"""The most a controller sends."""
RTDE_SILENCE_S: Final = 1.0
"""Then a controller is lost."""
RDT_SILENCE_S: Final = 0.5
"""Then a force sensor is lost."""
