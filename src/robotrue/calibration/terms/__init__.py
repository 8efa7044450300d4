"""Physical errors of an arm, one file each, behind one protocol."""
