"""What was learnt of how bodies move: rules for depth, lengths and sides, and how they learn."""
