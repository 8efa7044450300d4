"""Physical errors of an arm, one file each, with one protocol."""
