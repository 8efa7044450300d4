"""Frequency response, cutting force and the dynamic error they make; what is learned of its rest."""
