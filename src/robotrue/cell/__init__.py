"""The robot cell: robot, tool, reflector, tracker, payload and work frame, read from cell.toml."""
