"""Validation of a calibration: splits, error statistics, coverage, choice of method."""
