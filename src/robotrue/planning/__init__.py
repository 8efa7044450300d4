"""Planning of measurements: reachable and visible candidates, information, choice, order."""
