"""The swing model fitted to what was seen, by least squares (CVPR 2005, Sections 4 and 5)."""
