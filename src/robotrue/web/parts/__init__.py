"""Parts that several pages share: the frame around them, tiles, tables, the scene, charts."""
