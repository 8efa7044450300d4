"""Machining programs in and out: one Program type, one file per controller dialect."""
