"""What is observed of a swing: joints, club, silhouette, events (CVPR 2005, Section 4)."""
