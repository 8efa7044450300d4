"""Model files: an error model and the cell it was measured in, in one archive."""
