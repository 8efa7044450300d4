"""What is kept: model files, and workspaces of cells, measurements, models, programs and jobs."""
