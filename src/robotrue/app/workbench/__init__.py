"""Queries and actions of the workbench, computed in processes beside its server."""
