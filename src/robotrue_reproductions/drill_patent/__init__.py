"""The drill patent: a correction of the surface normal, linear in three displacements."""
