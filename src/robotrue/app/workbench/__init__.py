"""What the workbench in a browser asks and does, computed beside its server."""
