"""Measurements: the MeasurementSet, instruments' covariance, import, screening."""
