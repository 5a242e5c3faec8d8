"""The swing model fitted to observations, by least squares (CVPR 2005, Sections 4 and 5)."""
