"""Video in and out, records on disk, the project folder, file formats."""
