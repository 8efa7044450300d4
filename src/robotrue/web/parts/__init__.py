"""What several pages show: the frame around them, tiles, tables, the scene, charts."""
