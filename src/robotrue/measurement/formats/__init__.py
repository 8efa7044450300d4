"""Measurement files: one general reader, one mapping per layout, a registry by name."""
