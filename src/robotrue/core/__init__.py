"""Frames, poses, units, arrays, archives: NumPy only, knows no robot."""
