"""One self-contained page and one JSON file from the same numbers."""
