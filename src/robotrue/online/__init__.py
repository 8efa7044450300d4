"""Robots and sensors as they run: bytes of their protocols, samples, replay; no motion here."""
