"""What was measured: the MeasurementSet, instruments' covariance, import, screening."""
