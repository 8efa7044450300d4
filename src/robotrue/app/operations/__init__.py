"""One file per operation, found by the registry; the first line of each is its help."""
