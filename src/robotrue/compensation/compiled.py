"""The compiler of this room's kernels, which is that of all rooms."""

from robotrue.core.compiled import EXACT, SUMS, F, compiled

__all__ = ["EXACT", "SUMS", "F", "compiled"]
