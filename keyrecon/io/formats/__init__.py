"""One module per file format, each with read_ and write_ functions."""
