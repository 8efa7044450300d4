"""Which poses to measure: candidates that can be taken and seen, information, choice, order."""
