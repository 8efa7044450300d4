"""Drilling normal: a pressure foot squares the spindle to the surface in one move."""
