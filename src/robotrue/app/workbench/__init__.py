"""Queries and actions of the workbench, computed in processes next to its server."""
