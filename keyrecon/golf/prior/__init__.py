"""The swing model: PCA over captured swings in joint-angle space (CVPR 2005, Section 3)."""
