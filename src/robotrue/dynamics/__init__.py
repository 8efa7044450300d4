"""Frequency response, cutting force, the dynamic error they make, and learning its rest."""
