"""A virtual cell for demonstration, tutorials and tests: no method may import it."""
