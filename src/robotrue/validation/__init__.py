"""How far to believe a calibration: splits, error statistics, coverage, choice of method."""
