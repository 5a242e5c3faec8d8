"""From image to space: Taylor's lifting, depth signs, interpolation, refinement."""
