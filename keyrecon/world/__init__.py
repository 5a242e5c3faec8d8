"""Where the camera stands, where the ground is, and the motion in the world."""
