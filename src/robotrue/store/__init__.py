"""Storage: model files, and workspaces of cells, measurements, models, programs and jobs."""
